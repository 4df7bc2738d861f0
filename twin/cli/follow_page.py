"""Page of a followed rig, served by a process of its own: it takes no time from the following."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

ENDING = 20.0  # longest time in which the process ends [s]
RETRY = 1.0  # until a run that ends is opened again [s]


@dataclass(frozen=True, slots=True)
class PageOptions:
    """How the page is served. `port`: None for a free one."""

    port: int | None
    no_open: bool


class FollowPage:
    """Page of a run in progress. `show`: gets its URL and its messages, in a thread. The process ends with this one."""

    def __init__(self, folder: Path, options: PageOptions, show: Callable[[str], object]) -> None:
        words = [str(folder), str(options.port or ""), "" if options.no_open else "open"]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "twin.cli.follow_page", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._forward, args=(show,), daemon=True)
        self._reader.start()

    def _forward(self, show: Callable[[str], object]) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            show(line.rstrip())

    def wait(self) -> None:
        """Wait until Ctrl-C."""
        try:
            self._process.wait()
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(ENDING)


def serve(folder: Path, port: int | None, show: Callable[[str], None], *, open_browser: bool) -> None:
    """Serve the page of a run until Ctrl-C."""
    from twin.errors import TwinError
    from twin.viewer import RunCollection, open_recorded_run
    from twin.viewer import serve as serve_runs

    def attempt() -> None:
        serve_runs(RunCollection([open_recorded_run(folder)]), port, show, open_browser=open_browser)

    try:
        attempt()
    except (OSError, TwinError):  # the run may have ended while it was opened
        time.sleep(RETRY)
        attempt()


def interrupt_at_end_of_input() -> None:
    """Interrupt this process when its parent closes the pipe, or has ended."""
    sys.stdin.read()
    os.kill(os.getpid(), signal.SIGINT)


def main() -> None:
    """Serve the page of a run until Ctrl-C or the end of the standard input. Arguments: folder, port, `open` for a browser."""
    from twin.errors import TwinError

    folder, port, opened = sys.argv[1:4]
    threading.Thread(target=interrupt_at_end_of_input, daemon=True).start()
    try:
        serve(
            Path(folder), int(port) if port else None, lambda text: print(text, flush=True), open_browser=bool(opened)
        )
    except TwinError as error:
        print(error, flush=True)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
