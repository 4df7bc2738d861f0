"""The C functions of FMI that a run calls: how their arguments are passed, and a library that has them.

From the headers of FMI 2.0.4 and 3.0.1, fmi2FunctionTypes.h and fmi3FunctionTypes.h; the tests compare with FMPy's.
"""

from __future__ import annotations

import ctypes
import os
from ctypes import CFUNCTYPE, POINTER, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_uint64, c_void_p
from pathlib import Path
from typing import Any

from twin.compiler import machine
from twin.fmi.fmi_version import FMI2, FMI3

WORST = 1  # the largest status that is no failure: OK, Warning

Logger2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Allocate = CFUNCTYPE(c_void_p, c_size_t, c_size_t)
Free = CFUNCTYPE(None, c_void_p)
StepFinished = CFUNCTYPE(None, c_void_p, c_int)
Logger3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
Intermediate = CFUNCTYPE(None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double))
ClockUpdate = CFUNCTYPE(None, c_void_p)
Preemption = CFUNCTYPE(None)


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", Logger2),
        ("allocateMemory", Allocate),
        ("freeMemory", Free),
        ("stepFinished", StepFinished),
        ("componentEnvironment", c_void_p),
    )


class EventInfo(ctypes.Structure):
    """fmi2EventInfo: result of fmi2NewDiscreteStates."""

    _fields_ = (
        ("newDiscreteStatesNeeded", c_int),
        ("terminateSimulation", c_int),
        ("nominalsOfContinuousStatesChanged", c_int),
        ("valuesOfContinuousStatesChanged", c_int),
        ("nextEventTimeDefined", c_int),
        ("nextEventTime", c_double),
    )


REFERENCES = (POINTER(c_uint), c_size_t)
VECTOR = (POINTER(c_double), c_size_t)
STATE = POINTER(c_void_p)
FLAG = POINTER(c_bool)

# fmi2 and fmi3: function -> types of its arguments after the instance
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "fmi2SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "fmi2EnterInitializationMode": (),
    "fmi2GetRealStatus": (c_int, POINTER(c_double)),
    "fmi2GetBooleanStatus": (c_int, POINTER(c_int)),
    "fmi2DoStep": (c_double, c_double, c_int),
    "fmi2NewDiscreteStates": (POINTER(EventInfo),),
    "fmi2GetDirectionalDerivative": (*REFERENCES, *REFERENCES, POINTER(c_double), POINTER(c_double)),
    "fmi3EnterConfigurationMode": (),
    "fmi3ExitConfigurationMode": (),
    "fmi3EnterInitializationMode": (c_bool, c_double, c_double, c_bool, c_double),
    "fmi3DoStep": (c_double, c_double, c_bool, FLAG, FLAG, FLAG, POINTER(c_double)),
    "fmi3GetBinary": (*REFERENCES, POINTER(c_size_t), POINTER(POINTER(ctypes.c_uint8)), c_size_t),
    "fmi3UpdateDiscreteStates": (FLAG, FLAG, FLAG, FLAG, FLAG, POINTER(c_double)),
    "fmi3GetNumberOfContinuousStates": (POINTER(c_size_t),),
    "fmi3GetNumberOfEventIndicators": (POINTER(c_size_t),),
    "fmi3GetDirectionalDerivative": (*REFERENCES, *REFERENCES, *VECTOR, *VECTOR),
    # clocks
    "fmi3EnterStepMode": (),
    "fmi3GetClock": (*REFERENCES, FLAG),
    "fmi3SetClock": (*REFERENCES, FLAG),
    "fmi3GetIntervalDecimal": (*REFERENCES, POINTER(c_double), POINTER(c_int)),
    "fmi3GetIntervalFraction": (*REFERENCES, POINTER(c_uint64), POINTER(c_uint64), POINTER(c_int)),
    "fmi3GetShiftDecimal": (*REFERENCES, POINTER(c_double)),
    "fmi3GetShiftFraction": (*REFERENCES, POINTER(c_uint64), POINTER(c_uint64)),
    "fmi3SetIntervalDecimal": (*REFERENCES, POINTER(c_double)),
    "fmi3ActivateModelPartition": (c_uint, c_double),
}
FUNCTIONS["fmi3SetBinary"] = FUNCTIONS["fmi3GetBinary"]
MODES = ("FreeInstance", "ExitInitializationMode", "Reset", "Terminate", "EnterEventMode", "EnterContinuousTimeMode")
VECTORS = (
    *("SetContinuousStates", "GetContinuousStates", "GetContinuousStateDerivatives"),
    *("GetEventIndicators", "GetNominalsOfContinuousStates"),
)
for fmi, boolean, byte in ((FMI2, c_int, ctypes.c_char), (FMI3, c_bool, ctypes.c_ubyte)):
    for name, arguments in {
        **dict.fromkeys(MODES, ()),
        **dict.fromkeys(VECTORS, VECTOR),
        "GetFMUState": (STATE,),
        "SetFMUState": (c_void_p,),
        "FreeFMUState": (STATE,),
        "SerializedFMUStateSize": (c_void_p, POINTER(c_size_t)),
        "SerializeFMUState": (c_void_p, POINTER(byte), c_size_t),
        "DeserializeFMUState": (POINTER(byte), c_size_t, STATE),
        "CompletedIntegratorStep": (boolean, POINTER(boolean), POINTER(boolean)),
        "SetTime": (c_double,),
    }.items():
        FUNCTIONS[fmi.function(name)] = arguments

VALUES = {
    "fmi2": {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p},
    "fmi3": {
        **{f"Float{size}": kind for size, kind in ((32, ctypes.c_float), (64, c_double))},
        **{f"Int{size}": getattr(ctypes, f"c_int{size}") for size in (8, 16, 32, 64)},
        **{f"UInt{size}": getattr(ctypes, f"c_uint{size}") for size in (8, 16, 32, 64)},
        "Boolean": c_bool,
        "String": c_char_p,
    },
}
for version, kinds in VALUES.items():
    size = () if version == "fmi2" else (c_size_t,)
    for word, kind in kinds.items():
        FUNCTIONS[f"{version}Get{word}"] = FUNCTIONS[f"{version}Set{word}"] = (*REFERENCES, POINTER(kind), *size)

# these make an instance, so that none is passed
MAKERS: dict[str, tuple[Any, ...]] = {
    "fmi2Instantiate": (c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int),
    "fmi3InstantiateModelExchange": (c_char_p, c_char_p, c_char_p, c_bool, c_bool, c_void_p, Logger3),
    "fmi3InstantiateCoSimulation": (
        c_char_p,
        c_char_p,
        c_char_p,
        c_bool,
        c_bool,
        c_bool,
        c_bool,
        *REFERENCES,
        c_void_p,
        Logger3,
        Intermediate,
    ),
    "fmi3InstantiateScheduledExecution": (
        c_char_p,
        c_char_p,
        c_char_p,
        c_bool,
        c_bool,
        c_void_p,
        Logger3,
        ClockUpdate,
        Preemption,
        Preemption,
    ),
}


class MissingFunctionError(Exception):
    """The library lacks a function."""

    def __init__(self, function: str) -> None:
        super().__init__(f"its library lacks the function {function}. Export the FMU once more.")


class CallError(Exception):
    """A function returned more than a warning."""

    def __init__(self, function: str, status: int) -> None:
        super().__init__(f"{function} returned {status}")
        self.function, self.status = function, status


class Library:
    """A loaded library. One that lacks a function fails when that is called, not when it is loaded."""

    def __init__(self, path: Path) -> None:
        before = Path.cwd()
        os.chdir(path.parent)  # where libraries look for others that they bring
        try:
            self._dll = ctypes.CDLL(str(path))
        finally:
            os.chdir(before)

    def _get_function(self, function: str) -> Any:
        try:
            return getattr(self._dll, function)
        except AttributeError:
            raise MissingFunctionError(function) from None

    def address(self, function: str) -> int:
        """Address of a function."""
        return machine.address_of(self._get_function(function))

    def make(self, function: str, *arguments: Any) -> int:
        """Call an instantiation function and return the instance's address, 0 if there is none."""
        called = self._get_function(function)
        called.argtypes, called.restype = MAKERS[function], c_void_p
        return called(*arguments) or 0

    def call(self, function: str, instance: int, *arguments: Any) -> None:
        """Call a function; CallError if its status says that it failed."""
        called = self._get_function(function)
        if called.argtypes is None:
            called.argtypes = (c_void_p, *FUNCTIONS[function])
            called.restype = None if function.endswith("FreeInstance") else c_int
        status = called(instance, *arguments)
        if status is not None and status > WORST:
            raise CallError(function, status)

    def settle(self) -> None:
        """Let PythonFMU's library drop what it shares between instances; those that live keep it.

        It stays loaded until the process ends, and then would drop it once more after the C library has: in memory that is
        somebody else's by then.
        """
        if (drop := getattr(self._dll, "finalizePythonInterpreter", None)) is not None:
            drop()

    def close(self) -> None:
        """Let go of the library: no function may be called any more."""
        self.settle()
        unload(self._dll._handle)


def unload(handle: int) -> None:
    """Release a library that `ctypes.CDLL` has loaded; it stays in memory while others use it."""
    if os.name == "nt":
        ctypes.windll.kernel32.FreeLibrary(ctypes.c_void_p(handle))  # type: ignore[attr-defined,unused-ignore]
    else:
        ctypes.CDLL(None).dlclose(ctypes.c_void_p(handle))


def memory() -> tuple[Any, Any]:
    """The C library's calloc and free, which FMUs share with this process."""
    library = ctypes.cdll.msvcrt if os.name == "nt" else ctypes.CDLL(None)
    return ctypes.cast(library.calloc, Allocate), ctypes.cast(library.free, Free)
