"""Words of the machine that plain Python lacks: memory at an address, a call of an address.

Here they are written with ctypes, so that the co-simulation loop also runs interpreted; `compiler` puts one
line of C in the place of each.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, TypeVar

# values of a variable: fmi3GetXXX, fmi3SetXXX and functions of this project; FMI 2.0's have no number of values
ACCESS = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t
)
ACCESS_2 = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
NO_SIZE = -1  # in the place of the number of values: the function is FMI 2.0's

# fmiNGetFMUState and fmiNSetFMUState: instance, and the address of a pointer or that pointer
STATE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)

# a step: fmi3DoStep and functions of this project, fmi2DoStep, and that of a compiled component
STEP = ctypes.CFUNCTYPE(
    ctypes.c_int32,
    *(ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_bool),
    *(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p),
)
STEP_2 = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
STEP_COMPONENT = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)
FMI3, FMI2, COMPONENT = range(3)  # which of these a step function is

T = TypeVar("T")


def address_of(function: Any) -> int:
    """Return the address of a native function or of a callback."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def word_access(kind: Any, convert: Callable[[Any], T]) -> tuple[Callable[[int], T], Callable[[int, T], None]]:
    """Return the functions that read and write a number of a C type at an address."""

    def read(address: int) -> T:
        return convert(kind.from_address(int(address)).value)

    def write(address: int, value: T) -> None:
        kind.from_address(int(address)).value = convert(value)

    return read, write


read64, write64 = word_access(ctypes.c_int64, int)
read32, write32 = word_access(ctypes.c_int32, int)
read16, write16 = word_access(ctypes.c_int16, int)
read8, write8 = word_access(ctypes.c_int8, int)
read_float, write_float = word_access(ctypes.c_double, float)
read_float32, write_float32 = word_access(ctypes.c_float, float)  # rounded to nearest


def call_access(function: int, instance: int, references: int, count: int, values: int, size: int) -> int:
    """Call `fmiNGetXXX` or `fmiNSetXXX` by its address; its status.

    `size`: number of values, or NO_SIZE for a function of FMI 2.0, which has no such argument.
    """
    if size == NO_SIZE:
        return int(ACCESS_2(int(function))(int(instance), int(references), int(count), int(values)))
    return int(ACCESS(int(function))(int(instance), int(references), int(count), int(values), int(size)))


def call_state(function: int, instance: int, state: int) -> int:
    """Call `fmiNGetFMUState` or `fmiNSetFMUState` by its address; its status."""
    return int(STATE(int(function))(int(instance), int(state)))


def stepper(function: int, signature: int) -> Callable[[int, float, float, bool, int], int]:
    """A step function by its address and its signature (FMI3, FMI2, COMPONENT).

    Its arguments: instance, t [s], h [s], whether the step is final, address of four words for the flags of FMI 3.0:
    event handling needed, terminate, early return, last successful time. Flags that it does not have stay as they are.
    """
    if signature == COMPONENT:
        component = STEP_COMPONENT(function)
        return lambda instance, t, h, _final, _flags: int(component(instance, t, h))
    if signature == FMI2:
        fmi2 = STEP_2(function)
        return lambda instance, t, h, final, _flags: int(fmi2(instance, t, h, final))
    fmi3 = STEP(function)
    return lambda instance, t, h, final, flags: int(fmi3(instance, t, h, final, *(flags + 8 * i for i in range(4))))


def call_step(function: int, signature: int, instance: int, t: float, h: float, flags: int) -> int:
    """Step by the address of a function; arguments as for `stepper`."""
    return stepper(int(function), int(signature))(int(instance), float(t), float(h), True, int(flags))


def call_trial(function: int, signature: int, instance: int, t: float, h: float, flags: int) -> int:
    """The same for a step that may be taken back: FMI is told so (`noSetFMUStatePriorToCurrentPoint` is false)."""
    return stepper(int(function), int(signature))(int(instance), float(t), float(h), False, int(flags))
