"""The process of an isolated member: what it shares with that of the loop (isolated.c), and what it does."""

from __future__ import annotations

import ctypes
import marshal
import os
import sys
import threading
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from twin import clock, compiler
from twin.coupling.member import Access, Member
from twin.errors import SimulationError, TwinError, described
from twin.process import Lines

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

SOURCE = Path(__file__).with_name("isolated.c")
FUNCTIONS = ("set", "get", "step", "tell", "serve", "gather", "scatter")

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
HEAD = 4096  # byte, with the channel in it


@lru_cache(maxsize=4)
def native(build: Path) -> dict[str, int]:
    """Addresses of the functions of isolated.c."""
    made = compiler.Sources("isolated", "", SOURCE.read_text(encoding="utf-8"))
    return dict(
        zip(FUNCTIONS, compiler.load_symbols(made, build, tuple(f"isolated_{f}" for f in FUNCTIONS)), strict=True)
    )


def words(address: int, names: tuple[str, ...]) -> np.ndarray[Any, Any]:
    """A struct of words as a numpy record."""
    raw = (ctypes.c_int64 * len(names)).from_address(address)
    return np.ctypeslib.as_array(raw).view([(name, np.int64) for name in names])


def plain(value: Any) -> Any:
    """A value as a message can hold it; no bit of it is lost: numpy would drop zeros at the end of bytes."""
    if isinstance(value, str | bytes):
        return value
    return [plain(one) for one in value] if isinstance(value, list) else np.asarray(value).tolist()


def to_words(time: clock.Time | None) -> Any:
    """An exact time as a message can hold it."""
    return [time.numerator, time.denominator] if isinstance(time, Fraction) else time


def from_words(word: Any) -> Any:
    """What `to_words` was given; all else as it is."""
    return Fraction(*word) if isinstance(word, list) else word


def flush() -> None:
    """Have everything printed: a process that was forked holds copies of what was not."""
    for file in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            file.flush()
    ctypes.CDLL(None).fflush(None)


class Served:
    """The other side, in the child: does what is asked for, and never returns."""

    def __init__(
        self, inner: Member, addresses: dict[str, int], memory: int, called: int, messages: Connection
    ) -> None:
        self.inner, self.native, self.messages, self.called = inner, addresses, messages, called
        self.memory, self.channel = memory, words(memory, CHANNEL)
        self.kept: list[Access] = []  # what rows point into
        self.last: np.ndarray[Any, Any] | None = None  # row
        self.saved: Any = None
        self.objects: dict[str, Any] = {}  # slots of a member with clocks whose values are no numbers

    def live(self) -> NoReturn:
        """Serve until nobody is there any more."""
        try:
            import faulthandler

            faulthandler.disable()
            threading.Thread(target=self.outlive, daemon=True).start()
            self.inner.log = Lines(self.inner.log, self.tell)
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

    def outlive(self) -> NoReturn:
        """End with who asks, whatever goes on here; in a thread."""
        import select

        ends = select.poll()
        ends.register(self.called, 0)
        ends.poll()
        os._exit(0)

    def tell(self, line: str) -> None:
        """Pass on a log line."""
        self.messages.send_bytes(marshal.dumps((0, "", line)))

    def answer(self, what: str, arguments: tuple[Any, ...]) -> tuple[str, Any]:
        """Do what a message says: the name of an error and its text, or no name and a result."""
        own = getattr(self, what, None)
        try:
            return "", (own or getattr(self.inner, what))(*arguments)
        except TwinError as error:
            return type(error).__name__, str(error)
        except BaseException as error:
            return SimulationError.__name__, f"{self.inner.name}: {what} failed: {described(error)}"

    def instantiate(self) -> str:
        """Instantiate the member; the name of what steps it."""
        self.inner.instantiate()
        self.channel["step"], self.channel["instance"] = self.inner.step_function, self.inner.instance
        self.channel["signature"] = self.inner.step_signature
        return self.inner.step_name

    def get(self, name: str) -> Any:
        """A value as plain data."""
        return plain(self.inner.get(name))

    def slot(self, name: str) -> int:
        """Where a variable of a member with clocks lies, in memory of both; of what is no number: that it is asked for."""
        found = self.inner.slot(name)  # type: ignore[attr-defined]
        if found.variable.connectable:
            return int(found.values.ctypes.data)
        self.objects[name] = found
        return 0

    def event(self, what: str, arguments: list[Any], given: dict[str, list[Any]]) -> tuple[Any, ...]:
        """A call of `events.Clocked`: its answer, what the member is like then, and its values that are no numbers."""
        for name, values in given.items():
            self.objects[name].values[:] = values
        inner: Any = self.inner
        answer = getattr(inner, what)(*(from_words(one) for one in arguments))
        times = [to_words(one) for one in (inner.due, inner.event_time)]
        outputs = {name: one.values.tolist() for name, one in self.objects.items() if not one.is_input}
        return answer, *times, inner.ended, inner.has_jumped, outputs

    def access(self, names: list[str], write: bool, place: int) -> tuple[int, int, str]:
        """Fill a row; count, size and name of its call."""
        if not all(self.inner.address(name) for name in names):
            made = self.inner.access(names, write)
        else:
            variables = [self.inner.variables[name] for name in names]
            pieces = np.array([(self.inner.address(v.name), v.size * v.dtype.itemsize) for v in variables], np.int64)
            function = self.native["scatter" if write else "gather"]
            made = Access(function, pieces, len(pieces), sum(v.size for v in variables))
        self.kept.append(made)
        row = words(place, ROW)
        row["function"], row["instance"], row["references"] = (
            made.function,
            self.inner.instance,
            made.references.ctypes.data,
        )
        row["count"], row["size"] = made.count, made.size_argument
        if self.last is None:
            self.channel["rows"] = place
        else:
            self.last["next"] = place
        self.last = row
        return made.count, made.size, made.name

    def save(self) -> None:
        """Keep all that the member holds."""
        self.saved = self.inner.save()

    def restore(self) -> None:
        """Go back to it."""
        self.inner.restore(self.saved)

    def close(self) -> None:
        """Close the member; this process is killed next."""
        self.inner.close()
        flush()
