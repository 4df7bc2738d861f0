"""The library of an FMU, loaded through FMPy: its functions by name and by address, its log lines in a list.

FMPy's helper for FMI 2.0 log messages knows one logger in the whole process, the last one made. So there is one here,
which finds the instance a message belongs to by the environment pointer, or by its name.
"""

from __future__ import annotations

import ctypes
import inspect
import itertools
import os
from functools import cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import fmpy
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy

from twin.errors import FMUError, SimulationError
from twin.fmi import elf
from twin.fmi.markup import one_line

if TYPE_CHECKING:
    from twin.fmi.archive import Unpacked

STATUS = ("OK", "WARNING", "DISCARD", "ERROR", "FATAL", "PENDING")
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
LINES = 20  # log lines kept per instance


class MissingFunctionError(Exception):
    """The library lacks a function."""

    def __init__(self, function: str) -> None:
        super().__init__(f"its library lacks the function {function}. Export the FMU once more.")


class Symbols:
    """A loaded library as FMPy asks it for functions: one that is missing fails when called, not when loaded."""

    def __init__(self, dll: Any) -> None:
        self._dll = dll
        self._handle = dll._handle

    def __getattr__(self, function: str) -> Any:
        try:
            return getattr(self._dll, function)
        except AttributeError:

            def missing(*_: Any) -> int:
                raise MissingFunctionError(function)

            return missing

    def address(self, function: str) -> int:
        """Address of a function."""
        if not hasattr(self._dll, function):
            raise MissingFunctionError(function)
        return ctypes.cast(getattr(self._dll, function), ctypes.c_void_p).value or 0


class Functions(dict[str, Any]):
    """FMPy's table of functions with their types, each made when it is called first: there are a hundred."""

    def __init__(self, kind: type, dll: Symbols) -> None:
        super().__init__()
        self.kind, self.dll = kind, dll

    def __missing__(self, name: str) -> Any:
        function = getattr(self.dll, name)
        function.argnames, function.argtypes, function.restype = types(self.kind, name)
        self[name] = function
        return function


@cache
def types(kind: type, name: str) -> tuple[list[str], list[Any], Any]:
    """Names and types of a C function's arguments, and its result's, from the method that FMPy calls it by."""
    signature = inspect.signature(getattr(kind, name))
    given = list(signature.parameters.values())[1:]
    kinds = [get_args(one.annotation)[0] if isinstance(one.annotation, UnionType) else one.annotation for one in given]
    result = {bytes: ctypes.c_char_p, int: ctypes.c_int}.get(signature.return_annotation, signature.return_annotation)
    return [one.name for one in given], kinds, result


class FMU2(FMU2Slave):  # type: ignore[misc]
    """FMPy's FMI 2.0 slave which bears missing functions."""

    dll: Any

    def _loadFunctions(self) -> None:  # noqa: N802 - FMPy's name
        self.dll = Symbols(self.dll)
        self._functions = Functions(type(self), self.dll)


class FMU3(FMU3Slave):  # type: ignore[misc]
    """FMPy's FMI 3.0 slave which bears missing functions, such as those of Model Exchange."""

    dll: Any

    def _loadFunctions(self) -> None:  # noqa: N802 - FMPy's name
        self.dll = Symbols(self.dll)
        self._functions = Functions(type(self), self.dll)


def load(unpacked: Unpacked, name: str) -> FMU2 | FMU3:
    """Load the library of an unpacked FMU."""
    description = unpacked.description
    kind = FMU2 if unpacked.fmi == "2.0" else FMU3
    folder = Path.cwd()
    if wrong := elf.problem(unpacked.binary):
        raise FMUError(f"{unpacked.path}: {unpacked.binary.relative_to(unpacked.folder)} {wrong}")
    try:
        return kind(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=str(unpacked.folder),
            instanceName=name,
        )
    except Exception as error:  # FMPy raises plain Exception around what the system's loader says
        reason = one_line(error).replace(f"{unpacked.folder}{os.sep}", "")
        raise FMUError(f"{unpacked.path}: {reason} Install what is missing, or export it for this machine.") from None
    finally:
        os.chdir(folder)  # FMPy leaves the process in the library's folder when loading fails


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
        """Keep a message; called from inside the FMU, so nothing may be raised."""
        word = STATUS[status] if 0 <= status < len(STATUS) else str(status)
        text = " ".join((message or b"").decode(errors="replace").split())
        self.lines.append(f"{word}: {text}")
        del self.lines[:-LINES]

    def close(self) -> None:
        """Forget the entry; the lines stay."""
        self.table.pop(self.key, None)


def _dispatch(environment: int | None, name: bytes | None, status: int, _: bytes, message: bytes) -> None:
    log = Log.table.get(environment or 0)
    if log is None:
        wanted = (name or b"").decode(errors="replace")
        log = next((log for log in Log.table.values() if log.name == wanted), None)
    if log is not None:
        log.add(status, message)


LOGGER = fmi2CallbackLoggerTYPE(_dispatch)


def callbacks(log: Log) -> fmi2CallbackFunctions:
    """FMI 2.0 callbacks: memory straight from the C library, messages to `log`."""
    made = fmi2CallbackFunctions()
    made.logger = LOGGER
    made.allocateMemory = ctypes.cast(fmpy.calloc, fmi2CallbackAllocateMemoryTYPE)
    made.freeMemory = ctypes.cast(fmpy.free, fmi2CallbackFreeMemoryTYPE)
    made.componentEnvironment = log.key
    addLoggerProxy(ctypes.byref(made))
    return made


def instantiate(fmu: FMU2 | FMU3, log: Log, visible: bool, logging: bool) -> int:
    """Make the instance and return its address; FMPy's own exception on failure is left to the caller."""
    if isinstance(fmu, FMU2):
        fmu.instantiate(visible=visible, callbacks=callbacks(log), loggingOn=logging)
    else:
        fmu.instantiate(
            visible=visible,
            loggingOn=logging,
            logMessage=lambda _environment, status, _category, message: log.add(status, message),
        )
    return int(fmu.component)


def last_words(lines: list[str]) -> str:
    """The end of the log for an error message."""
    return f" It logged: {' | '.join(lines[-3:])}" if lines else ""


def failed(name: str, function: str, status: int, lines: list[str], hint: str = "") -> SimulationError:
    """A failed call as this project's error."""
    word = STATUS[status] if 0 <= status < len(STATUS) else f"the unknown status {status}"
    return SimulationError(f"{name}: {function} returned {word}.{hint}{last_words(lines)}")
