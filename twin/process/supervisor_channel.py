"""Channel from a worker process to its supervisor; without a supervisor a thread drains the recording."""

from __future__ import annotations

import marshal
import os
import threading
import time
from contextlib import suppress
from errno import ENOENT
from typing import TYPE_CHECKING, Any

from twin.process.crash_report import CrashReport
from twin.process.process_identity import process_identity
from twin.process.shared import HEAD, NOTES, RECORD, TAIL, TROUBLE, Drainer, Shared

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

INTERVAL = 0.03  # between two drains of the ring [s]: at most 0.1 s may be lost, also on a busy machine
LETTERS = 1000  # largest length of a log line that is sent
RETRY_INTERVAL = 0.0005  # between two checks for space in the ring [s]


class SupervisorChannel:
    """Channel of an unsupervised process: a thread drains the ring.

    `successor_values`: values for a successor process; `crash_report`: the crash report of the process before this one, if any.
    """

    attempt = 0
    temporary = ""  # folder for temporary files that the supervisor removes, or empty
    watched = False
    stopped = False  # whether the supervisor has died: then this process must stop too

    def __init__(self, shared: Shared | None = None) -> None:
        self.shared = shared or Shared()
        self.successor_values: dict[str, Any] = {}
        self.crash_report: CrashReport | None = None
        self.layout: dict[str, Any] | None = None
        self._lock = threading.Lock()
        self._drainer: Drainer | None = None
        self._end = threading.Event()

    def open(self, layout: dict[str, Any]) -> None:
        """Start draining the rows of a case into a file, from the front of the ring."""
        self.shared.put(TAIL, 0)
        self.shared.put(TROUBLE, 0)
        self.layout = layout
        self._begin()

    def _begin(self) -> None:
        assert self.layout is not None
        with self._lock:
            if self._drainer is None:
                self._drainer = Drainer(self.shared)
                threading.Thread(target=self._drain, name="recording", daemon=True).start()
            self._drainer.open(self.layout)

    def _drain(self) -> None:
        while not self._end.wait(INTERVAL):
            with self._lock:
                if self._drainer is not None:
                    self._drainer.drain()

    def sync(self) -> None:
        """Return when every row is in the file, or cannot be written."""
        if self._drainer is not None:
            with self._lock:
                self._drainer.drain()

    def shut(self) -> None:
        """Drain the remaining rows of a case and close its file."""
        if self._drainer is not None:
            with self._lock:
                self._drainer.drain()
                self._drainer.close()
        self.layout = None

    def wait(self) -> None:
        """Drain and sleep briefly: the ring is full."""
        self.sync()
        time.sleep(RETRY_INTERVAL)

    @property
    def owners(self) -> str:
        """Identity of the process that can finish the recording."""
        return process_identity()

    @property
    def tail(self) -> int:
        """Drained part of the ring [byte]."""
        return self.shared.word(TAIL)

    @property
    def trouble(self) -> OSError | None:
        """Error that keeps rows from being written, or None."""
        number = self.shared.word(TROUBLE)
        if not number:
            return None
        text = "its folder has disappeared" if number == ENOENT else os.strerror(number)
        return OSError(number, text, (self.layout or {}).get("file"))

    @property
    def record_offset(self) -> int:
        """Offset of the loop's record in the shared memory [byte]."""
        return RECORD

    @property
    def ring_offset(self) -> int:
        """Offset of the ring in the shared memory [byte]."""
        return HEAD

    def look(self) -> None:
        """Check whether the supervisor is alive; no-op here."""

    def note(self, text: str) -> None:
        """Publish the current activity outside of the loop."""
        self.shared.note(text)

    def beat(self) -> None:
        """Signal progress of the current activity."""
        self.shared.put(NOTES, self.shared.word(NOTES) + 1)

    def keep(self, **values: Any) -> None:
        """Keep small values for a successor process, should this one die."""
        self.successor_values |= values

    def log(self, member: str, line: str) -> None:
        """Send a line that a member logged; no-op without a supervisor."""

    def close(self) -> None:
        """Drain the remaining rows and stop the thread. Safe to call twice."""
        self.shut()
        self._end.set()
        with self._lock:  # the thread may be about to use the drainer
            self._drainer = None


class Watched(SupervisorChannel):
    """Channel of a process whose supervisor drains the ring."""

    watched = True

    def __init__(self, shared: Shared, out: int, back: int, supervisor: int) -> None:
        super().__init__(shared)
        self._out, self._back, self._supervisor = out, back, supervisor
        self._count = 0

    @property
    def owners(self) -> str:
        """Identities of the processes that can finish the recording: this one and its supervisor."""
        return f"{process_identity()} {process_identity(self._supervisor)}"

    def _send(self, **message: Any) -> bool:
        """Send a message atomically; False if the supervisor has died."""
        if self._out < 0:
            return False
        data = marshal.dumps(message)
        try:
            os.write(self._out, len(data).to_bytes(4, "little") + data)
        except BrokenPipeError:
            self._continue_alone()
            return False
        return True

    def _request(self, **message: Any) -> bool:
        """Send a message and wait until it is processed; False if the supervisor has died."""
        self._count = self._count % 250 + 1
        if not self._send(count=self._count, **message):
            return False
        while (answer := os.read(self._back, 1)) != bytes([self._count]):
            if not answer:
                self._continue_alone()
                return False
        return True

    def _continue_alone(self) -> None:
        """Drain in this process: the supervisor has died."""
        if self._out >= 0:
            os.close(self._out)
            self._out, self.stopped = -1, True
            if self.layout is not None:
                super()._begin()

    def _begin(self) -> None:
        if not self._request(open=self.layout) and self._drainer is None:
            super()._begin()

    def sync(self) -> None:
        """Return when every row is in the file, or cannot be written."""
        if self.layout is None:
            return
        if not self._request(sync=True):
            super().sync()

    def shut(self) -> None:
        """Drain the remaining rows of a case and close its file."""
        if self.layout is not None and not self._request(shut=True):
            super().shut()
        self.layout = None

    def look(self) -> None:
        """Check whether the supervisor is alive; drain in this process if it has died."""
        if self._out >= 0 and os.getppid() != self._supervisor:
            self._continue_alone()

    def keep(self, **values: Any) -> None:
        """Keep small values for a successor process, should this one die."""
        super().keep(**values)
        self._send(keep=values)

    def log(self, member: str, line: str) -> None:
        """Send a line that a member logged; no-op without a supervisor."""
        with suppress(OSError):
            self._send(log=(member, line[:LETTERS]))

    def done(self) -> None:
        """Announce that this process ends normally."""
        self._send(done=True)


class LogLines(list[str]):
    """Log lines of a member; each appended line is also passed to a callback at once."""

    def __init__(self, lines: Sequence[str], on_line: Callable[[str], object]) -> None:
        super().__init__(lines)
        self._on_line = on_line

    def append(self, line: str) -> None:
        """Append a line and pass it on."""
        super().append(line)
        self._on_line(line)
