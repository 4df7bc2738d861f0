"""Live state of the drives of a hardware file, from `twin hil monitor` in a separate process: SDO uploads, no writes.

It listens before it sends, and ends as soon as another program uses the drives.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

RETRY_PERIOD = 20.0  # after another program was heard, or the bus could not be opened [s]
PERIOD = 0.5  # between two readings [s]
END_TIMEOUT = 3.0  # of the process after Ctrl-C; then it is killed, which leaves the drives as they are [s]


class StateWatch:
    """Reader of state, position and current while `is_on`; `pause` and `resume` it around commands. Thread-safe.

    `rows`: name and value of each object by node, empty without a reading; `problem`: why there is none.
    """

    def __init__(self, file: Path, build: Path) -> None:
        self.file, self.build = file, build
        self.rows: dict[str, list[tuple[str, str]]] = {}
        self.problem = ""
        self.is_on = False
        self.is_wanted = True  # until it is switched off
        self.retry_at = 0.0  # by time.monotonic(), after it has ended by itself
        self._process: subprocess.Popen[str] | None = None
        self._listener: threading.Thread | None = None
        self._lock = threading.Lock()

    def resume(self) -> None:
        """Start reading if it is switched on and not running."""
        with self._lock:
            if not self.is_on or (self._listener is not None and self._listener.is_alive()):
                return
            self.problem = ""
            words = [
                "monitor",
                "-f",
                str(self.file),
                "--json",
                "--alone",
                f"--every={PERIOD}",
                "--build",
                str(self.build),
            ]
            self._process = subprocess.Popen(
                [sys.executable, "-c", "from twin.cli import main; main()", "hil", *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,  # Ctrl-C is for the server, which ends it
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )
            self._listener = threading.Thread(target=self._listen, args=[self._process], daemon=True)
            self._listener.start()

    def pause(self) -> None:
        """End the process and wait until it has left the bus."""
        with self._lock:
            process, listener, self._process = self._process, self._listener, None
            if process is None or listener is None:
                return
            process.send_signal(signal.SIGINT)
            try:
                process.wait(END_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            listener.join()

    def _listen(self, process: subprocess.Popen[str]) -> None:
        """Collect its readings until it ends; one that ends by itself is switched off with its error."""
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stdout:
            self.rows = {name: [(title, value) for title, value in rows] for name, rows in json.loads(line).items()}
        error = process.stderr.read()
        process.wait()
        self.rows = {}
        if self._process is process:
            self.is_on, self.retry_at = False, time.monotonic() + RETRY_PERIOD
            self.problem = " ".join(error.removeprefix("error: ").split()) or "the reading has ended."
        process.stdout.close()
        process.stderr.close()
