"""Report of a process that crashed, was killed or did not return: cause, time and function."""

from __future__ import annotations

import os
import re
import signal
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin import clock

ENGINE = str(Path(__file__).parents[1])
FRAME = re.compile(r'  File "(?P<file>.+)", line (?P<line>\d+)(?: in (?P<function>.+))?')
CALLERS = tuple(os.path.join(ENGINE, room) for room in ("coupling", "fmi", "conformance", "run", "cli"))  # noqa: PTH118
LINES = 5
KILL = 9  # SIGKILL, on POSIX


@dataclass
class CrashReport:
    """Crash report of a process. `member` and `function` were being executed in the step from `time_ns`."""

    signal: int = 0
    exit: int | None = None
    unresponsive_time: float = 0.0  # time without progress after which it was killed [s]
    stop_signal: int = 0  # earlier signal that requested a stop
    tick: int = 0  # communication points reached
    at: int = 0  # address of the loop's row that was being executed, or 0
    note: str = ""  # activity outside of the loop
    member: str = ""
    function: str = ""
    time_ns: clock.Time | None = None
    log: dict[str, list[str]] = field(default_factory=dict)  # last lines of each member; of stderr under an empty name
    stack: list[str] = field(default_factory=list)  # of Python, the innermost frame first

    @property
    def from_outside(self) -> bool:
        """Whether a user or the system (out of memory) ended the process: then nothing else is started."""
        return bool(self.stop_signal) or (self.signal == KILL and not self.unresponsive_time)

    @property
    def how(self) -> str:
        """Cause of the end as text."""
        if self.unresponsive_time:
            return f"did not return for {self.unresponsive_time:g} s"
        if self.stop_signal and self.signal == KILL:
            return f"did not stop after {signal_name(self.stop_signal)}, and was killed"
        if self.signal == KILL:
            return "was killed (SIGKILL) by another process, or by the system for lack of memory"
        if self.signal:
            return f"crashed with {signal_name(self.signal)} ({signal.strsignal(self.signal)})"
        return f"ended the process with exit code {self.exit}"

    @property
    def location(self) -> str:
        """Line of user code in Python that was being executed, `model.py:12`, or empty."""
        for frame in filter(None, map(FRAME.match, self.stack)):
            if frame["file"].startswith(CALLERS):
                break  # the engine's call of native code
            if not frame["file"].startswith((ENGINE, "<")) and not is_library(frame["file"]):
                return f"{frame['file']}:{frame['line']}"
        return ""

    def text(self) -> str:
        """Format the report as one line."""
        from twin import clock

        when = (
            ""
            if self.time_ns is None
            else f", {'in the step from' if self.at else 'at'} t = {clock.text(self.time_ns)}"
        )
        function = f" in {self.function}" if self.function else ""
        where = f", at {self.location}" if self.location else ""
        lines = [*self.log.get(self.member or self.note.partition(":")[0], []), *self.log.get("", [])]
        log = f" Last log: {' | '.join(lines[-LINES:])}" if lines else ""
        if self.from_outside:
            work = f", {self.member} at work" if self.member else ""
            return f"the run {self.how}{when}{work}{function}{where}.{log}"
        return f"{self.member or self.note or 'the run'}: {self.how}{function}{when}{where}.{log}"


def is_library(file: str) -> bool:
    """Whether a file belongs to Python or to an installed package."""
    return "site-packages" in file or file.startswith(str(Path(os.__file__).parent))


def signal_name(number: int) -> str:
    """Return the name of a signal, such as `SIGSEGV`."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def current_frames(text: str) -> list[str]:
    """Return the frames of the current thread in a faulthandler dump, the innermost first."""
    _, _, current = text.rpartition("Current thread")
    body = current.partition("\n")[2]
    frames = []
    for line in body.splitlines():
        if not FRAME.match(line):
            break
        frames.append(line)
    return frames
