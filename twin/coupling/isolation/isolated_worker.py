"""Worker process of an isolated member, and the memory that it shares with the loop's process (isolated.c).

It is a new Python process, which gets the member, not yet instantiated, as a pickle. A fork would copy locks held by threads
that do not exist in the copy; acquiring one of them would block for ever.
"""

from __future__ import annotations

import ctypes
import marshal
import mmap
import os
import pickle
import signal
import sys
import threading
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from twin import clock, compiler
from twin.compiler import machine
from twin.coupling.component_member import RecordMember
from twin.coupling.member import Access, Member
from twin.errors import SimulationError, TwinError, described
from twin.process import SIGNALS, LogLines

if TYPE_CHECKING:
    from collections.abc import Iterable
    from multiprocessing.connection import Connection

SOURCE = Path(__file__).with_name("isolated.c")
FUNCTIONS = ("set", "get", "step", "begin", "end", "tell", "serve", "gather", "scatter")

# the structs of isolated.c, in words
CHANNEL = (
    "call",
    "called",
    "back",
    "returned",
    "is_dead",
    "status",
    "wanted",
    "at",
    "rows",
    "t",
    "h",
    "event",
    "terminate",
    "early",
    "last",
    "step",
    "signature",
    "instance",
    "read",
    "write",
    "own_read",
    "own_write",
    "sched_setaffinity",
    "loop_core",
    "own_core",
    "is_final",
)
ROW = (
    "function",
    "instance",
    "references",
    "count",
    "values",
    "size",
    "next",
    "bytes",
    "write",
    "pending",
    "fresh",
    "status",
)
READY = -1  # replaces the number of a request: the process has started
HEAD = 4096  # size of the head with the channel [byte]
HAS_CORES = hasattr(os, "sched_setaffinity")  # whether the system can bind processes to cores


@lru_cache(maxsize=4)
def native(build: Path) -> dict[str, int]:
    """Compile isolated.c; return the addresses of its functions."""
    sources = compiler.Sources("isolated", "", SOURCE.read_text(encoding="utf-8"))
    return dict(
        zip(FUNCTIONS, compiler.load_symbols(sources, build, tuple(f"isolated_{f}" for f in FUNCTIONS)), strict=True)
    )


def words(address: int, names: tuple[str, ...]) -> np.ndarray[Any, Any]:
    """Return a numpy record view of a struct of words."""
    raw = (ctypes.c_int64 * len(names)).from_address(address)
    return np.ctypeslib.as_array(raw).view([(name, np.int64) for name in names])


def to_plain(value: Any) -> Any:
    """Convert a value to plain data for a message, without loss: a numpy bytes array would drop trailing zeros."""
    if isinstance(value, str | bytes):
        return value
    return [to_plain(element) for element in value] if isinstance(value, list) else np.asarray(value).tolist()


def to_words(time: clock.Time | None) -> Any:
    """Convert an exact time to plain data for a message."""
    return [time.numerator, time.denominator] if isinstance(time, Fraction) else time


def from_words(word: Any) -> Any:
    """Invert `to_words`; other values are returned unchanged."""
    return Fraction(*word) if isinstance(word, list) else word


def flush() -> None:
    """Flush all output: this process is killed next."""
    for file in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            file.flush()
    ctypes.CDLL(None).fflush(None)


def main(called: int, back: int, shared: int, messages: int) -> NoReturn:
    """Run the worker process: arguments are ends of pipes, the file of the shared memory, and a message connection."""
    from multiprocessing.connection import Connection

    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)  # The loop's process decides when this one ends.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    connection = Connection(messages)
    try:
        inner, build, room = pickle.loads(connection.recv_bytes())  # noqa: S301 - from our own parent
        if isinstance(inner, RecordMember):
            inner.load(build)
    except (EOFError, OSError):
        os._exit(0)  # The loop's process has died.
    except BaseException as error:
        os.write(2, f"{described(error)}\n".encode())
        os._exit(70)
    memory = map_memory(shared, os.fstat(shared).st_size)
    connection.send_bytes(marshal.dumps((READY, "", None)))
    Worker(inner, native(build), memory, called, back, connection, room).serve()


class Room:
    """Allocator of the bytes from `first` to `end`."""

    def __init__(self, first: int, end: int) -> None:
        self.next, self.end = first, end

    def take(self, size: int) -> np.ndarray[Any, Any]:
        """Allocate zeroed bytes."""
        address, self.next = self.next, self.next + size
        assert self.next <= self.end
        return np.ctypeslib.as_array((ctypes.c_uint8 * size).from_address(address))


def map_memory(shared: int, size: int) -> int:
    """Map the shared memory; return its address. Python's mmap would keep the file open."""
    function = ctypes.CDLL(None, use_errno=True).mmap
    kinds = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_ssize_t
    function.argtypes, function.restype = kinds, ctypes.c_void_p
    address = function(None, size, mmap.PROT_READ | mmap.PROT_WRITE, mmap.MAP_SHARED, shared, 0)
    if address is None or address == ctypes.c_void_p(-1).value:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return int(address)


def unmap_memory(address: int, size: int) -> None:
    """Unmap the shared memory."""
    ctypes.CDLL(None).munmap(ctypes.c_void_p(address), ctypes.c_size_t(size))


def system_calls(names: Iterable[str]) -> dict[str, int]:
    """Return the addresses of functions of the C library."""
    library = ctypes.CDLL(None)
    return {name: machine.address_of(getattr(library, name)) for name in names}


class Worker:
    """Server of the worker process. `room`: offsets between which the values of a member with clocks lie."""

    def __init__(
        self,
        inner: Member,
        addresses: dict[str, int],
        memory: int,
        called: int,
        back: int,
        messages: Connection,
        room: tuple[int, int] | None,
    ) -> None:
        self.inner, self.native, self.messages, self.called = inner, addresses, messages, called
        self.accesses: list[Access] = []  # memory that rows point to
        self.memory = memory
        self.channel = words(self.memory, CHANNEL)
        self.channel["called"], self.channel["back"] = called, back
        for name, address in system_calls(["read", "write"]).items():
            self.channel[f"own_{name}"] = address
        if HAS_CORES:
            (self.channel["sched_setaffinity"],) = system_calls(["sched_setaffinity"]).values()
        if room:
            inner.room = Room(self.memory + room[0], self.memory + room[1]).take  # type: ignore[attr-defined]
        self.last: np.ndarray[Any, Any] | None = None  # row
        self.saved: Any = None
        self.objects: dict[str, Any] = {}  # slots of strings and binaries of a member with clocks

    def serve(self) -> NoReturn:
        """Process requests until the loop's process ends; never returns."""
        try:
            import faulthandler

            faulthandler.disable()
            threading.Thread(target=self.exit_with_parent, daemon=True).start()
            self.inner.log = LogLines(self.inner.log, self.send_log_line)
            serve = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(self.native["serve"])
            while serve(self.memory):
                count, what, arguments = marshal.loads(self.messages.recv_bytes())  # noqa: S302 - from our own parent
                self.messages.send_bytes(marshal.dumps((count, *self.answer(what, arguments))))
        except (EOFError, OSError):
            pass
        except BaseException as error:
            os.write(2, f"{described(error)}\n".encode())
            os._exit(70)
        os._exit(0)

    def exit_with_parent(self) -> NoReturn:
        """Exit when the loop's process ends; runs in a thread."""
        import select

        ends = select.poll()
        ends.register(self.called, 0)
        ends.poll()
        os._exit(0)

    def send_log_line(self, line: str) -> None:
        """Send a log line."""
        self.messages.send_bytes(marshal.dumps((0, "", line)))

    def answer(self, what: str, arguments: tuple[Any, ...]) -> tuple[str, Any]:
        """Process a request; return the name and text of an error, or an empty name and the result."""
        handler = getattr(self, what, None)
        try:
            return "", (handler or getattr(self.inner, what))(*arguments)
        except TwinError as error:
            return type(error).__name__, str(error)
        except BaseException as error:
            return SimulationError.__name__, f"{self.inner.name}: {what} failed: {described(error)}"

    def instantiate(self) -> str:
        """Instantiate the member; return the name of its step function."""
        self.inner.instantiate()
        self.channel["step"], self.channel["instance"] = self.inner.step_function, self.inner.instance
        self.channel["signature"] = self.inner.step_signature
        return self.inner.step_name

    def get(self, name: str) -> Any:
        """Return a value as plain data."""
        return to_plain(self.inner.get(name))

    def slot(self, name: str) -> int:
        """Return the offset of a clocked member's variable in the shared memory; 0 for strings and binaries, then registered."""
        slot = self.inner.slot(name)  # type: ignore[attr-defined]
        if slot.variable.connectable:
            return int(slot.values.ctypes.data) - self.memory
        self.objects[name] = slot
        return 0

    def event(self, what: str, arguments: list[Any], inputs: dict[str, list[Any]]) -> tuple[Any, ...]:
        """Call a method of `events.Clocked`; return its result, the member's event state, and its strings and binaries."""
        for name, values in inputs.items():
            self.objects[name].values[:] = values
        inner: Any = self.inner
        answer = getattr(inner, what)(*(from_words(argument) for argument in arguments))
        times = [to_words(time) for time in (inner.due, inner.event_time)]
        outputs = {name: slot.values.tolist() for name, slot in self.objects.items() if not slot.is_input}
        return answer, *times, inner.ended, inner.has_jumped, outputs

    def access(self, names: list[str], write: bool, offset: int) -> tuple[int, int, str]:
        """Fill the row at an offset; return count, size and name of its call."""
        if not all(self.inner.address(name) for name in names):
            access = self.inner.access(names, write)
        else:
            variables = [self.inner.variables[name] for name in names]
            pieces = np.array([(self.inner.address(v.name), v.size * v.dtype.itemsize) for v in variables], np.int64)
            function = self.native["scatter" if write else "gather"]
            access = Access(function, pieces, len(pieces), sum(v.size for v in variables))
        self.accesses.append(access)
        row = words(self.memory + offset, ROW)
        row["function"], row["instance"], row["references"] = (
            access.function,
            self.inner.instance,
            access.references.ctypes.data,
        )
        row["count"], row["size"] = access.count, access.size_argument
        if self.last is None:
            self.channel["rows"] = offset
        else:
            self.last["next"] = offset
        self.last = row
        return access.count, access.size, access.name

    def save(self) -> None:
        """Save the member's state."""
        self.saved = self.inner.save()

    def restore(self) -> None:
        """Restore the saved state."""
        self.inner.restore(self.saved)

    def close(self) -> None:
        """Close the member; this process is killed next."""
        self.inner.close()
        flush()
