"""What a process that works says to the one that watches it; where nobody watches, a thread takes the rows."""

from __future__ import annotations

import marshal
import os
import threading
import time
from contextlib import suppress
from errno import ENOENT
from typing import TYPE_CHECKING, Any

from twin.process.crash_report import Death
from twin.process.process_identity import process_identity
from twin.process.shared import HEAD, NOTES, RECORD, TAIL, TROUBLE, Drainer, Shared

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

INTERVAL = 0.03  # between two looks at the ring [s]: what is younger than 0.1 s may be lost, on a busy machine too
LETTERS = 1000  # of a log line that is told
RETRY_INTERVAL = 0.0005  # between two looks for room in the ring [s]


class Link:
    """A process alone: a thread of its own drains the ring. `kept` and `death` are of the process before this one, if any."""

    attempt = 0
    temporary = ""  # folder for temporary files that somebody else removes, or nothing
    watched = False
    stopped = False  # whether who watched is gone: then this process is to stop too

    def __init__(self, shared: Shared | None = None) -> None:
        self.shared = shared or Shared()
        self.kept: dict[str, Any] = {}
        self.death: Death | None = None
        self.layout: dict[str, Any] | None = None
        self._lock = threading.Lock()
        self._drainer: Drainer | None = None
        self._end = threading.Event()

    def open(self, layout: dict[str, Any]) -> None:
        """Have the rows of a case taken into a file, from the front of the ring."""
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
        """Take what is left of a case, and close its file."""
        if self._drainer is not None:
            with self._lock:
                self._drainer.drain()
                self._drainer.close()
        self.layout = None

    def wait(self) -> None:
        """Let a little time pass, for the ring is full."""
        self.sync()
        time.sleep(RETRY_INTERVAL)

    @property
    def owners(self) -> str:
        """The processes that look after what is recorded."""
        return process_identity()

    @property
    def tail(self) -> int:
        """How far the ring was taken [byte]."""
        return self.shared.word(TAIL)

    @property
    def trouble(self) -> OSError | None:
        """Why rows cannot be written, or nothing."""
        number = self.shared.word(TROUBLE)
        if not number:
            return None
        text = "its folder has disappeared" if number == ENOENT else os.strerror(number)
        return OSError(number, text, (self.layout or {}).get("file"))

    @property
    def record_offset(self) -> int:
        """Where in the memory the loop's record lies."""
        return RECORD

    @property
    def ring_offset(self) -> int:
        """Where in the memory the ring begins."""
        return HEAD

    def look(self) -> None:
        """Notice whether who watched is dead."""

    def note(self, text: str) -> None:
        """Say what this process is at outside of the loop."""
        self.shared.note(text)

    def beat(self) -> None:
        """Say that what was noted goes on."""
        self.shared.put(NOTES, self.shared.word(NOTES) + 1)

    def keep(self, **values: Any) -> None:
        """Small values that the next process is to have, should this one die."""
        self.kept |= values

    def log(self, member: str, line: str) -> None:
        """Tell a line that a member logged."""

    def close(self) -> None:
        """Take what is left, and end."""
        self.shut()
        self._end.set()
        with self._lock:  # the thread may be between its look at it and its use
            self._drainer = None


class Watched(Link):
    """A process that a supervisor watches, and drains."""

    watched = True

    def __init__(self, shared: Shared, out: int, back: int, supervisor: int) -> None:
        super().__init__(shared)
        self._out, self._back, self._supervisor = out, back, supervisor
        self._count = 0

    @property
    def owners(self) -> str:
        """The processes that look after what is recorded: either can finish it."""
        return f"{process_identity()} {process_identity(self._supervisor)}"

    def _send(self, **message: Any) -> bool:
        """Tell something, in one piece; False if nobody is there any more."""
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
        """Tell something, and wait until it was done."""
        self._count = self._count % 250 + 1
        if not self._send(count=self._count, **message):
            return False
        while (answer := os.read(self._back, 1)) != bytes([self._count]):
            if not answer:
                self._continue_alone()
                return False
        return True

    def _continue_alone(self) -> None:
        """Who watched is dead: go on draining here."""
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
        """Take what is left of a case, and close its file."""
        if self.layout is not None and not self._request(shut=True):
            super().shut()
        self.layout = None

    def look(self) -> None:
        """Notice whether who watched is dead."""
        if self._out >= 0 and os.getppid() != self._supervisor:
            self._continue_alone()

    def keep(self, **values: Any) -> None:
        """Small values that the next process is to have, should this one die."""
        super().keep(**values)
        self._send(keep=values)

    def log(self, member: str, line: str) -> None:
        """Tell a line that a member logged."""
        with suppress(OSError):
            self._send(log=(member, line[:LETTERS]))

    def done(self) -> None:
        """Say that this process ends by itself."""
        self._send(done=True)


class Lines(list[str]):
    """Log lines of a member, each of which is also told at once."""

    def __init__(self, lines: Sequence[str], on_line: Callable[[str], object]) -> None:
        super().__init__(lines)
        self._on_line = on_line

    def append(self, line: str) -> None:
        """Keep a line, and tell it."""
        super().append(line)
        self._on_line(line)
