"""Member in a separate process, for members that must not share an address space with others.

The process is started before the member is instantiated, so an FMU's library is loaded only there. Calls of the loop go
through shared memory (isolated.c), all others through messages. When the process dies, the member fails with its cause.
"""

from __future__ import annotations

import ctypes
import marshal
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import weakref
from collections import deque
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from twin import clock, errors
from twin.coupling.isolation.isolated_worker import (
    CHANNEL,
    HAS_CORES,
    HEAD,
    READY,
    ROW,
    map_memory,
    native,
    system_calls,
    to_plain,
    unmap_memory,
    words,
)
from twin.coupling.member import Access, Member
from twin.errors import CouplingError, SimulationError, TwinError, described
from twin.process import SIGNALS, CrashReport

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

LINES = 20  # largest number of log lines
EXIT_TIMEOUT = 1.0  # from the end of a process's pipes to its exit [s]
START_TIMEOUT = 60.0  # for the start of a process, before timeouts of its calls begin [s]
CLOSE_TIMEOUT = 10.0  # for closing a member, before its process is killed [s]


@contextmanager
def shared_file(size: int) -> Iterator[int]:
    """Create an unnamed, zeroed file of a size [byte], in memory where the system supports it; yields its descriptor."""
    if hasattr(os, "memfd_create"):
        shared = os.memfd_create("isolated")
    else:
        with tempfile.TemporaryFile() as file:
            shared = os.dup(file.fileno())
    try:
        os.ftruncate(shared, size)
        yield shared
    finally:
        os.close(shared)


def pickled(inner: Member, build: Path, room: tuple[int, int] | None) -> bytes:
    """Pickle the start message of the process; CouplingError if that process could not import the member's class."""
    try:
        return pickle.dumps((inner, build, room))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise CouplingError(
            f"{inner.name}: another process cannot make it: {described(error)}. "
            "Define its class at the top of a module, not of a script or in a function, or leave `isolate` out."
        ) from None


def in_process(method: str) -> Callable[..., Any]:
    """Return a method that calls the member's own in its process."""

    def call(self: IsolatedMember, *arguments: Any) -> Any:
        return self._request(method, *arguments)

    return call


class IsolatedMember(Member):
    """Member in a child process, which is started by the constructor. `inner`: the member, not yet instantiated.

    CouplingError on systems without POSIX, or if another process cannot import the member's class.
    """

    concurrent = True
    living: ClassVar[list[IsolatedMember]] = []  # started by this process and not closed

    def __new__(cls, inner: Member, build: Path) -> Self:  # noqa: ARG004
        """Create an `IsolatedClocks` for a member with clocks."""
        from twin.coupling.isolation.isolated_clocks import IsolatedClocks

        return super().__new__(IsolatedClocks if inner.clocked else cls)  # type: ignore[return-value]

    def __init__(self, inner: Member, build: Path) -> None:
        if not hasattr(signal, "pthread_sigmask"):
            raise CouplingError(f"{inner.name}: `isolate` needs POSIX, which this system lacks. Leave it out.")
        self.name, self.variables, self.driven = inner.name, inner.variables, inner.driven
        self.period_ns, self.identity, self.has_cheap_fmu_state = (
            inner.period_ns,
            inner.identity,
            inner.has_cheap_fmu_state,
        )
        self.has_fmu_state = inner.has_fmu_state
        self.log: list[str] = []
        self.crash_text = ""
        self._inner, self._native, self._build = inner, native(build), build
        self._phase, self._count = "instantiation", 0
        self._functions: dict[int, str] = {}  # names by the offset of their rows
        self._errors: deque[str] = deque(maxlen=5)  # last lines of stderr
        self._answers: SimpleQueue[tuple[int, str, Any] | None] = SimpleQueue()
        self._is_ready = threading.Event()
        self._span: tuple[int, int] | None = None  # offsets between which the values of a member with clocks lie
        with shared_file(self._memory_size()) as shared:
            self._share(shared)
            self.step_function, self.instance = self._native["step"], self._memory
            self.halves = self._native["begin"], self._native["end"]  # of a step, by address
            self._start_process(shared)

    def _share(self, shared: int) -> None:
        """Map the shared memory; unused pages are never touched."""
        self._size = self._memory_size()
        self._memory = map_memory(shared, self._size)
        weakref.finalize(self, unmap_memory, self._memory, self._size)
        self._used = HEAD
        self._channel = words(self._memory, CHANNEL)[0:1]
        for name, address in system_calls(["read", "write"]).items():
            self._channel[name] = address
        self._channel["loop_core"] = self._channel["own_core"] = -1

    def _memory_size(self) -> int:
        size = sum(v.size * v.dtype.itemsize + 64 for v in self.variables.values() if v.connectable)
        return HEAD + 4 * (size + 64 * 8 * len(ROW))

    # processes

    def _start_process(self, shared: int) -> None:
        from multiprocessing.connection import Pipe

        message = pickled(self._inner, self._build, self._span)
        (called, self._call), (self._returned, back), (self._stderr, stderr) = os.pipe(), os.pipe(), os.pipe()
        self._messages, messages = Pipe()
        self._channel["call"], self._channel["returned"] = self._call, self._returned
        ends = called, back, shared, messages.fileno()
        line = f"import sys; sys.path[:] = {sys.path!r}; from twin.coupling.isolation.isolated_worker import main; main{ends}"
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # until the child ignores them
        try:
            self._process = subprocess.Popen([sys.executable, "-c", line], stderr=stderr, pass_fds=ends)
        except OSError as error:
            self._close_ends()
            raise CouplingError(f"{self.name}: no process can be started for it: {error.strerror}.") from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            for end in (called, back, stderr):
                os.close(end)
            messages.close()
        self.living.append(self)
        self._reader = threading.Thread(target=self._read_messages, name=f"messages of {self.name}", daemon=True)
        self._reader.start()
        with suppress(OSError):  # The process may have died at once; the next request reports that.
            self._messages.send_bytes(message)

    def _close_ends(self) -> None:
        for end in (self._call, self._returned, self._stderr):
            os.close(end)
        self._messages.close()

    def _read_messages(self) -> None:
        """Read answers, log lines and stderr of the process until its end; runs in a thread."""
        from multiprocessing.connection import wait

        while ready := wait([self._messages, self._stderr]):
            if self._stderr in ready:
                self._forward_stderr(os.read(self._stderr, 1 << 16))
            if self._messages not in ready:
                continue
            try:
                count, failure, value = marshal.loads(self._messages.recv_bytes())  # noqa: S302 - from our own child
            except (EOFError, OSError):
                break
            if count == READY:
                self._is_ready.set()
            elif count:
                self._answers.put((count, failure, value))
            else:
                self.log.append(value)
                del self.log[:-LINES]
        os.set_blocking(self._stderr, False)
        with suppress(BlockingIOError):
            while text := os.read(self._stderr, 1 << 16):
                self._forward_stderr(text)
        self._answers.put(None)
        self._is_ready.set()

    def wait(self) -> None:
        """Wait until the process has started or ended, so that timeouts do not include its start."""
        self._is_ready.wait(START_TIMEOUT)

    def _forward_stderr(self, text: bytes) -> None:
        """Forward output of the process to stderr, and keep its last lines."""
        with suppress(OSError):
            os.write(2, text)
        self._errors.extend(line for line in text.decode(errors="replace").splitlines() if line.strip())

    def _request(self, what: str, *arguments: Any, timeout: float | None = None) -> Any:
        """Send a request and wait for its result; SimulationError after `timeout` [s], or if the process has died."""
        if self.crash_text:
            raise SimulationError(self.crash_text)
        self._count += 1
        with suppress(OSError):
            self._messages.send_bytes(marshal.dumps((self._count, what, arguments)))
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(self._native["tell"])(self._memory)
        count = 0
        while count != self._count:  # Ctrl-C may have left the answer to an earlier request.
            try:
                answer = self._answers.get(timeout=timeout)
            except Empty:
                raise SimulationError(f"{self.name}: did not return from {self._phase} within {timeout:g} s.") from None
            if answer is None:
                raise SimulationError(self._exit_text(self._phase))
            count, failure, value = answer
        if failure:
            raise getattr(errors, failure, SimulationError)(value)
        return value

    def _exit_text(self, function: str, when: str = "") -> str:
        """Reap the child and return a one-line description of its exit."""
        code = self._reap(EXIT_TIMEOUT)
        how = CrashReport(signal=max(-code, 0), exit=code if code >= 0 else None).how
        lines = [*self.log, *self._errors][-5:]
        log = f" Last log: {' | '.join(lines)}" if lines else ""
        self.crash_text = f"{self.name}: {how} in {function}{when}.{log}"
        return self.crash_text

    def _reap(self, timeout: float) -> int:
        """Wait for the end of the process, killing it after `timeout` [s]; return its exit code, negative for a signal."""
        try:
            return self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def lost(self, time: clock.Time) -> str:
        """Describe the end of the process in the step from `time` [ns], in one line; empty if it is alive."""
        if not self._channel["is_dead"][0] or self.crash_text:
            return self.crash_text
        while self._answers.get() is not None:
            pass
        at = int(self._channel["at"][0])
        return self._exit_text(self._functions.get(at, self.step_name), f", in the step from t = {clock.text(time)}")

    @classmethod
    @contextmanager
    def together(cls, members: list[Self]) -> Iterator[None]:
        """Bind this thread, and the processes of members, to the current core.

        Not to be used in the first steps of a simulation: threads that members start there would inherit the binding.
        """
        if not members or not HAS_CORES:
            yield
            return
        allowed, core = os.sched_getaffinity(0), ctypes.CDLL(None).sched_getcpu()
        try:
            with suppress(OSError):
                os.sched_setaffinity(0, {core})
                for member in members:
                    member._channel["loop_core"] = core
            yield
        finally:
            with suppress(OSError):
                os.sched_setaffinity(0, allowed)

    # call sequence

    def instantiate(self) -> None:
        """Instantiate the member in its process."""
        self.step_name = self._request("instantiate")
        self._phase = "initialization"

    enter_initialization = in_process("enter_initialization")

    def exit_initialization(self) -> None:
        """Leave InitializationMode for StepMode."""
        self._request("exit_initialization")
        self._phase = "an access"

    def set(self, name: str, value: Any) -> None:
        """Write a variable."""
        self._request("set", name, to_plain(value))

    def get(self, name: str) -> Any:
        """Read a variable."""
        variable = self.variables[name]
        dtype = np.bool_ if variable.type == "Boolean" else variable.dtype
        return np.array(self._request("get", name), dtype).reshape(variable.shape)[()]

    def address(self, name: str) -> int:  # noqa: ARG002
        """Return 0: the variable does not lie in this process."""
        return 0

    def access(self, names: list[str], write: bool) -> Access:
        """Return a call through the shared memory."""
        variables = [self.variables[name] for name in names]
        size = sum(v.size * v.dtype.itemsize for v in variables)
        offset, values = self._take(8 * len(ROW)), self._take(size)
        row = words(self._memory + offset, ROW)
        row["values"], row["bytes"], row["write"] = values, size, write
        count, elements, name = self._request("access", names, write, offset)
        self._functions[offset] = name
        function = self._native["set" if write else "get"]
        return Access(function, row.view(np.int64), count, elements, name)

    def _take(self, size: int) -> int:
        """Allocate shared memory; return its offset."""
        offset, self._used = self._used, self._used + -(-size // 64) * 64
        if self._used > self._size:
            raise CouplingError(f"{self.name}: is read in more ways than an isolated member can be. Do not isolate it.")
        return offset

    finish_reason = in_process("finish_reason")
    failed = in_process("failed")
    last_successful_time = in_process("last_successful_time")
    serialize = in_process("serialize")
    deserialize = in_process("deserialize")

    def save(self) -> None:
        """Save the member's state in its process."""
        self._request("save")

    def restore(self, saved: None) -> None:  # noqa: ARG002
        """Restore the state saved last."""
        self._request("restore")

    def serialization_problem(self) -> str:
        """Return why the member cannot serialize its state."""
        return self._inner.serialization_problem()

    def close(self) -> None:
        """Close the member and end its process. Safe to call twice and in any state."""
        if self not in self.living:
            return
        try:
            self._phase = "termination"
            if not self.crash_text:
                self._request("close", timeout=CLOSE_TIMEOUT)  # All results have arrived already.
        except TwinError as error:
            self.log.append(str(error).removeprefix(f"{self.name}: "))
        finally:
            self.living.remove(self)
            self._process.kill()  # It is idle and waits for requests.
            self._process.wait()
            self._reader.join()
            self._close_ends()
            self._inner.release()
