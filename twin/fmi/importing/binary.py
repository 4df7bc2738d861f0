"""The library of an FMU and its instances: loading, instantiation, and log messages.

FMPy's helper for FMI 2.0 log messages knows one logger in the whole process, the last one made. So there is one here,
which finds the instance a message belongs to by the environment pointer, or by its name.
"""

from __future__ import annotations

import ctypes
import importlib.util
import itertools
import os
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from twin import compiler
from twin.errors import FMUError, SimulationError
from twin.fmi.fmi_version import FMI2
from twin.fmi.importing import elf
from twin.fmi.importing.c_functions import (
    Callbacks,
    ClockUpdate,
    Intermediate,
    Library,
    Logger2,
    Logger3,
    Preemption,
    memory,
)
from twin.fmi.importing.unpacked import suffix
from twin.fmi.xml_checks import error_line
from twin.process import memory_is_limited

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.fmi.importing.unpacked import Unpacked

STATUS = ("OK", "WARNING", "DISCARD", "ERROR", "FATAL", "PENDING")
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
EXCHANGE_2, CO_SIMULATION_2 = 0, 1  # fmi2Type
LINES = 20  # log lines kept per instance
MEMORY_ADVICE = "There is not enough memory: raise the limit (ulimit -v), or end other programs."


def load(unpacked: Unpacked) -> Library:
    """Load the library of an unpacked FMU."""
    if wrong := elf.problem(unpacked.binary):
        raise FMUError(f"{unpacked.path}: {unpacked.binary.relative_to(unpacked.folder)} {wrong}")
    try:
        return Library(unpacked.binary)
    except OSError as error:
        reason = error_line(error).replace(f"{unpacked.folder}{os.sep}", "")
        if lacks_memory(reason):
            raise FMUError(f"{unpacked.path}: {reason}. {MEMORY_ADVICE}") from None
        raise FMUError(
            f"{unpacked.path}: Failed to load shared library: {reason}. Install what is missing, or export it for this machine."
        ) from None


def lacks_memory(reason: str) -> bool:
    """Whether the message of the dynamic loader says that there was no memory for a library."""
    return "Cannot allocate memory" in reason or ("failed to map segment" in reason and memory_is_limited())


class Log:
    """The last lines an instance logged, and its entry in the table by which FMI 2.0 messages find it."""

    table: ClassVar[dict[int, Log]] = {}
    keys: ClassVar[Any] = itertools.count(1)

    def __init__(self, name: str, lines: list[str]) -> None:
        self.name = name
        self.lines = lines
        self.key = next(self.keys)
        self.table[self.key] = self

    def add(self, status: int, message: bytes | None) -> None:
        """Append a message. Called from inside the FMU, so it must not raise."""
        word = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        text = " ".join((message or b"").decode(errors="replace").split())
        self.lines.append(f"{word}: {text}")
        del self.lines[:-LINES]

    def close(self) -> None:
        """Remove the table entry; the lines stay."""
        self.table.pop(self.key, None)


def _dispatch(environment: int | None, name: bytes | None, status: int, _: bytes, message: bytes) -> None:
    log = Log.table.get(environment or 0)
    if log is None:
        wanted = (name or b"").decode(errors="replace")
        log = next((log for log in Log.table.values() if log.name == wanted), None)
    if log is not None:
        log.add(status, message)


LOGGER = Logger2(_dispatch)


@cache
def add_proxy() -> Callable[[Any], object]:
    """FMPy's native helper that fills the arguments of FMI 2.0 messages in; without it they come as they are written.

    Found without importing FMPy, which takes longer than all that a run does before its first step.
    """
    spec = importlib.util.find_spec("fmpy")
    system = {"linux": "linux64", "darwin": "darwin64", "win32": "win64"}.get(sys.platform, "")
    folders = spec.submodule_search_locations if spec is not None else None
    helper_path = Path((folders or [""])[0], "logging", system, f"logging{suffix(compiler.host())}")
    try:
        helper = ctypes.CDLL(str(helper_path)).addLoggerProxy
    except (OSError, AttributeError):  # another processor
        return lambda _: None
    helper.argtypes, helper.restype = [ctypes.c_void_p], None
    return helper


def callbacks(log: Log) -> Callbacks:
    """FMI 2.0 callbacks: memory straight from the C library, messages to `log`."""
    made = Callbacks()
    made.logger = LOGGER
    made.allocateMemory, made.freeMemory = memory()
    made.componentEnvironment = log.key
    add_proxy()(ctypes.byref(made))
    return made


@dataclass(frozen=True, slots=True)
class Instance:
    """Address of an instance, with the objects that must outlive it."""

    address: int
    keep_alive: tuple[Any, ...]


def instantiate(
    library: Library,
    unpacked: Unpacked,
    log: Log,
    visible: bool,
    logging: bool,
    *,
    events: bool = False,
    early: bool = False,
    update_clocks: Callable[[], None] | None = None,
) -> Instance:
    """Instantiate the FMU for the selected interface; the address is 0 if the FMU refuses.

    `events`: whether Event Mode is used, `early`: whether steps may end early; `update_clocks`: called from within a model
    partition of Scheduled Execution.
    """
    name, token = log.name.encode(), unpacked.description.token.encode()
    resources = unpacked.folder / "resources"
    if unpacked.fmi == FMI2:
        own = callbacks(log)
        resource_location = resources.as_uri().encode()
        kind = EXCHANGE_2 if unpacked.interface == "ModelExchange" else CO_SIMULATION_2
        address = library.make(
            "fmi2Instantiate", name, kind, token, resource_location, ctypes.byref(own), visible, logging
        )
        return Instance(address, (own,))
    options: tuple[Any, ...] = ()
    called: tuple[Any, ...] = (Logger3(lambda _environment, status, _category, message: log.add(status, message)),)
    if unpacked.interface == "ScheduledExecution":
        assert update_clocks is not None
        called += (ClockUpdate(lambda _environment, call=update_clocks: call()),)  # type: ignore[misc]
        called += Preemption(do_nothing), Preemption(do_nothing)  # partitions run one after the other
    elif unpacked.interface == "CoSimulation":
        options, called = (events, early, (ctypes.c_uint * 0)(), 0), (*called, Intermediate())
    arguments = name, token, f"{resources}{os.sep}".encode(), visible, logging, *options, None, *called
    return Instance(library.make(f"fmi3Instantiate{unpacked.interface}", *arguments), called)


def do_nothing() -> None:
    """No-op callback: no partition is preempted."""


def last_words(lines: list[str]) -> str:
    """Format the last three log lines for an error message."""
    return f" It logged: {' | '.join(lines[-3:])}" if lines else ""


def failed(name: str, function: str, status: int, lines: list[str], hint: str = "") -> SimulationError:
    """Convert a failed call to a `SimulationError`."""
    word = STATUS[status] if 0 <= status < len(STATUS) else f"the unknown status {status}"
    return SimulationError(f"{name}: {function} returned {word}.{hint}{last_words(lines)}")
