"""Supervisor process of a run: records for a forked child and outlives its crash.

`supervise` is called before large packages are imported. It forks: it returns in the child, never in the parent. The child
records into shared memory; the parent drains it into a file and forwards signals. When the child dies, the parent forks
another one, which gets the crash report and finishes the run. Without `fork` a thread of the process drains the memory.
"""

from __future__ import annotations

import atexit
import gc
import marshal
import os
import select
import signal
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from twin.process.crash_report import LINES, CrashReport, current_frames
from twin.process.process_identity import (
    MemoryFolder,
    folder_of,
    memory_folder,
    process_identity,
    remove,
    sweep,
    temporary_folder,
)
from twin.process.shared import NOTES, Drainer, Shared
from twin.process.stop import SIGNALS, once
from twin.process.supervisor_channel import INTERVAL, SupervisorChannel, Watched

STOP_TIME = 10.0  # for a case to end after a signal [s]
FINISH_TIME = 120.0  # for writing all results after a signal [s]
DUMP_TIME = 0.5  # for Python to dump its stack [s]
DUMP = getattr(signal, "SIGUSR2", 0)
UNLIMITED = ": termination"  # activities without a timeout: drives are stopped in them
TRIES = 2  # crashes while finishing before the supervisor gives up


def command_line() -> None:
    """Declare that this process runs a command and nothing else: `supervise` may fork it."""
    Supervisor.allowed = hasattr(os, "fork")


def supervise(timeout: float = 0.0) -> SupervisorChannel:
    """Continue in a supervised child process; it is killed after `timeout` without progress [s], 0: never.

    Outside of a command line, and without `fork`, the process continues unsupervised.
    """
    if not Supervisor.allowed:
        return SupervisorChannel()
    locations = [location for location in (temporary_folder(), memory_folder()) if location is not None]
    folders = [create_folder(folder_of(location, process_identity())) for location in locations]
    with suppress(OSError):  # no process can be created
        remove_at_end([folder for folder in folders if folder])
    supervisor = Supervisor(Shared(), timeout, *folders)
    link = supervisor.begin()
    if link is not None:
        return link
    try:
        for location in locations:
            sweep(location)
        code_or_link = supervisor.run()
    finally:
        if supervisor.link is None:
            for folder in filter(None, folders):
                remove(Path(folder))
    return code_or_link if isinstance(code_or_link, SupervisorChannel) else leave(code_or_link)


def create_folder(folder: Path) -> str:
    """Create a folder for temporary files; empty if that fails: a full disk, or a folder of another user."""
    try:
        folder.mkdir(mode=0o700)
    except OSError:
        return ""
    return str(folder)


def remove_at_end(folders: list[str]) -> None:
    """Start a process that removes folders when this process and its children have ended, even if all are killed at once.

    It has its own session and keeps only the end of a pipe open, whose other ends these processes hold.
    """
    if not folders:
        return
    end, _ = os.pipe()
    if (pid := os.fork()) != 0:
        os.close(end)
        os.waitpid(pid, 0)
        return
    os.setsid()
    if os.fork() == 0:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in range(3):
            os.dup2(nothing, descriptor)
        os.closerange(3, end)
        os.closerange(end + 1, os.sysconf("SC_OPEN_MAX"))
        os.read(end, 1)
        for folder in folders:
            remove(Path(folder))
    os._exit(0)


def leave(code: int) -> NoReturn:
    """Exit this process at once, ignoring signals; it holds nothing that needs cleaning up."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def end(code: int) -> NoReturn:
    """Exit the process of a command that is done, ignoring signals unless a thread must be waited for."""
    if all(thread.daemon or thread is threading.main_thread() for thread in threading.enumerate()):
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
    gc.freeze()  # else Python looks through all objects once more before it ends
    sys.exit(code)


class Supervisor:
    """Parent process of a run. `link` is set in a forked child."""

    allowed = False  # whether this process may be forked

    def __init__(self, shared: Shared, timeout: float, folder: str, quick: str = "") -> None:
        self.shared, self.timeout, self.folder, self.quick = shared, timeout, folder, quick
        self.link: Watched | None = None
        self.successor_values: dict[str, Any] = {}
        self.attempt = self.tries = 0
        self.stop_signal = 0  # first signal that came
        self.stop_requested_at = 0.0
        self.wake, self._woken = os.pipe()
        for end in (self.wake, self._woken):
            os.set_blocking(end, False)

    def begin(self, previous: CrashReport | None = None) -> Watched | None:
        """Fork a child; return its link in the child, None in the parent."""
        self.shared.clear()
        pipes = [os.pipe() for _ in range(4)]  # messages, answers, native stderr, stacks
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            self.link = self._child(pipes, previous)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            return self.link
        (self.messages, out), (back, self.answers), (self.errors, err), (self.stacks, dump) = pipes
        for end in (out, back, err, dump):
            os.close(end)
        for end in (self.messages, self.errors, self.stacks):
            os.set_blocking(end, False)
        self.drainer = Drainer(self.shared)
        self.pending, self.stack = b"", b""
        self.done, self.last = False, (0, 0, 0)
        self.silent_time = 0.0
        self.lines: dict[str, deque[str]] = {}
        if self.attempt == 0:
            for number in SIGNALS:
                if signal.getsignal(number) is not signal.SIG_IGN or number == signal.SIGINT:
                    signal.signal(number, self._forward_signal)
            signal.signal(signal.SIGCHLD, lambda *_: None)
            signal.set_wakeup_fd(self._woken, warn_on_full_buffer=False)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return None

    def _child(self, pipes: list[tuple[int, int]], previous: CrashReport | None) -> Watched:
        import faulthandler

        Supervisor.allowed = False
        parent = os.getppid()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, once)
        (messages, out), (back, answers), (errors, err), (stacks, dump) = pipes
        for end in (messages, answers, errors, stacks, self.wake, self._woken):
            os.close(end)
        terminal = os.dup(2)
        os.dup2(err, 2)
        os.close(err)
        sys.stderr = os.fdopen(terminal, "w", buffering=1, encoding=sys.stderr.encoding, errors="backslashreplace")
        faulthandler.enable(dump)
        faulthandler.register(DUMP, dump)
        MemoryFolder.folder = self.quick
        if self.folder:
            os.environ["TMPDIR"] = self.folder
            if "tempfile" in sys.modules:
                sys.modules["tempfile"].tempdir = None  # type: ignore[attr-defined]
        link = Watched(self.shared, out, back, parent)
        link.attempt, link.successor_values, link.crash_report, link.temporary = (
            self.attempt,
            dict(self.successor_values),
            previous,
            self.folder,
        )
        atexit.register(link.done)
        die_with(parent)
        return link

    def _forward_signal(self, number: int, _frame: object) -> None:
        """Forward a signal to the child. A terminal sends it to both; the child reacts to the first one only."""
        if not self.stop_signal:
            self.stop_signal, self.stop_requested_at = number, time.monotonic()
        if self.pid:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def run(self) -> int | SupervisorChannel:
        """Supervise children until one ends normally; return its exit code, or in a further child its link."""
        while True:
            status = self.watch()
            code = os.waitstatus_to_exitcode(status)
            if self.done or (code == 0 and not self.successor_values):
                return max(code, 0) if code >= 0 else self.successor_values.get("code", 1)
            crash = self.crash_report(code)
            is_finishing, has_started = (self.successor_values.pop(key, False) for key in ("finishing", "begun"))
            self.tries += bool(is_finishing or not has_started)
            if "resume" not in self.successor_values or self.tries >= TRIES:
                return self.give_up(crash)
            self.attempt += 1
            self.stop_requested_at = time.monotonic()
            for end in (self.messages, self.answers, self.errors, self.stacks):
                os.close(end)
            if (link := self.begin(crash)) is not None:
                return link

    def give_up(self, crash: CrashReport) -> int:
        """Report a crash after which nothing can be finished; return the exit code."""
        print(f"error: {crash.text()}", file=sys.stderr)
        if hint := self.successor_values.get("hint"):
            print(hint, file=sys.stderr)
        return 130 if crash.from_outside else 1

    def watch(self) -> int:
        """Drain the ring and read the pipes until the child has ended; return its wait status."""
        silent = 0.0
        previous_time = time.monotonic()
        while True:
            busy = self.drainer.file >= 0 or self.timeout or self.stop_signal
            with suppress(InterruptedError):
                select.select([self.messages, self.errors, self.stacks, self.wake], [], [], INTERVAL if busy else 1.0)
            with suppress(BlockingIOError):
                os.read(self.wake, 512)
            self.read_pipes()
            self.drainer.drain()
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.read_pipes()
                self.drainer.drain()
                self.drainer.close()
                self.pid = 0
                return status
            now = time.monotonic()
            silent, previous_time = self.stuck_time(silent, min(now - previous_time, 4 * INTERVAL)), now
            is_overdue = self.stop_signal and now - self.stop_requested_at > (
                FINISH_TIME if self.successor_values.get("finishing") else STOP_TIME
            )
            if (self.timeout and silent > self.timeout) or is_overdue:
                self.silent_time = silent if not is_overdue else 0.0
                self.kill()

    def stuck_time(self, silent: float, passed: float) -> float:
        """Return how long the child has made no progress [s]; a suspended process does not count as stuck."""
        layout = self.drainer.layout
        words = (
            self.shared.word(NOTES),
            *((self.shared.word(layout[key]) for key in ("tick", "at")) if layout else (0, 0)),
        )
        noted = self.shared.noted
        at_work = bool(words[2]) or (bool(noted) and not noted.endswith(UNLIMITED))
        if words == self.last and at_work:
            return silent + passed
        self.last = words
        return 0.0

    def kill(self) -> None:
        """Kill the child after it has dumped its Python stack."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, DUMP)
            end = time.monotonic() + DUMP_TIME
            while time.monotonic() < end and b"Current thread" not in self.stack:
                select.select([self.stacks], [], [], 0.05)
                self.read_pipes()
            time.sleep(0.02)
            self.read_pipes()
            os.kill(self.pid, signal.SIGKILL)

    def read_pipes(self) -> None:
        """Read the child's messages, stack dump and stderr."""
        self.pending += read_available(self.messages)
        while len(self.pending) >= 4 and len(self.pending) >= 4 + (size := int.from_bytes(self.pending[:4], "little")):
            message = marshal.loads(self.pending[4 : 4 + size])  # noqa: S302 - from our own child
            self.pending = self.pending[4 + size :]
            self.handle_message(message)
        self.stack += read_available(self.stacks)
        self.pass_on()

    def pass_on(self) -> None:
        """Forward what native code printed to stderr, and keep its last lines."""
        if text := read_available(self.errors):
            with suppress(OSError):
                os.write(2, text)
            lines = self.lines.setdefault("", deque(maxlen=LINES))
            lines.extend(line for line in text.decode(errors="replace").splitlines() if line.strip())

    def handle_message(self, message: dict[str, Any]) -> None:
        """Process a message of the child."""
        if "open" in message:
            self.drainer.open(message["open"])
        if "sync" in message:
            self.drainer.drain()
        if "shut" in message:
            self.drainer.drain()
            self.drainer.close()
            self.drainer.layout = {}
            self.pass_on()
            self.lines.clear()  # log lines belong to one case
        if "keep" in message:
            self.successor_values |= message["keep"]
        if "log" in message:
            member, line = message["log"]
            self.lines.setdefault(member, deque(maxlen=LINES)).append(line)
        self.done = self.done or "done" in message
        if "count" in message:
            with suppress(BrokenPipeError):
                os.write(self.answers, bytes([message["count"]]))

    def crash_report(self, code: int) -> CrashReport:
        """Return the crash report of the child."""
        layout = self.drainer.layout
        tick, at = (self.shared.word(layout[key]) for key in ("tick", "at")) if layout else (0, 0)
        number = -code if code < 0 else 0
        return CrashReport(
            signal=number,
            exit=code if code >= 0 else None,
            unresponsive_time=round(self.timeout, 3) if self.silent_time else 0.0,
            stop_signal=self.stop_signal,
            tick=tick,
            at=at,
            note=self.shared.noted,
            log={member: list(lines) for member, lines in self.lines.items()},
            stack=current_frames(self.stack.decode(errors="replace")),
        )


def read_available(file: int) -> bytes:
    """Read all available bytes of a non-blocking pipe."""
    result = b""
    with suppress(BlockingIOError):
        while data := os.read(file, 1 << 16):
            result += data
    return result


def die_with(parent: int) -> None:
    """Request SIGTERM from the system when the supervisor dies; elsewhere the loop detects it a moment later."""
    if sys.platform != "linux":
        return
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGTERM)
