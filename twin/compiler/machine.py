"""Words of the machine that plain Python lacks: memory at an address, a call of an address.

Here they are written with ctypes, so that the co-simulation loop also runs interpreted; `compiler` puts one
line of C in the place of each.
"""

from __future__ import annotations

import ctypes

ACCESS = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t
)
STEP = ctypes.CFUNCTYPE(
    ctypes.c_int32,
    *(ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int64),
    *(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p),
)


def read64(address: int) -> int:
    """The 64-bit word at an address."""
    return ctypes.c_int64.from_address(int(address)).value


def write64(address: int, value: int) -> None:
    """Store a 64-bit word."""
    ctypes.c_int64.from_address(int(address)).value = int(value)


def read32(address: int) -> int:
    """The 32-bit word at an address."""
    return ctypes.c_int32.from_address(int(address)).value


def write32(address: int, value: int) -> None:
    """Store a 32-bit word."""
    ctypes.c_int32.from_address(int(address)).value = int(value)


def read16(address: int) -> int:
    """The 16-bit word at an address."""
    return ctypes.c_int16.from_address(int(address)).value


def write16(address: int, value: int) -> None:
    """Store a 16-bit word."""
    ctypes.c_int16.from_address(int(address)).value = int(value)


def read8(address: int) -> int:
    """The byte at an address."""
    return ctypes.c_int8.from_address(int(address)).value


def write8(address: int, value: int) -> None:
    """Store a byte."""
    ctypes.c_int8.from_address(int(address)).value = int(value)


def read_float(address: int) -> float:
    """The Float64 at an address."""
    return ctypes.c_double.from_address(int(address)).value


def write_float(address: int, value: float) -> None:
    """Store a Float64."""
    ctypes.c_double.from_address(int(address)).value = float(value)


def read_float32(address: int) -> float:
    """The Float32 at an address."""
    return ctypes.c_float.from_address(int(address)).value


def write_float32(address: int, value: float) -> None:
    """Store a Float32, rounded to nearest."""
    ctypes.c_float.from_address(int(address)).value = float(value)


def call_access(function: int, instance: int, references: int, count: int, values: int, size: int) -> int:
    """`fmiNGetXXX` or `fmiNSetXXX`. FMI 2.0 functions have no fifth argument; every 64-bit ABI lets them ignore it."""
    return int(ACCESS(int(function))(int(instance), int(references), int(count), int(values), int(size)))


def call_step(function: int, instance: int, t: float, h: float, flags: int) -> int:
    """`fmiNDoStep`, or any `int32 (*)(void *instance, double t, double h)`: arguments it lacks it ignores.

    `flags`: address of four words for FMI 3.0: event handling needed, terminate, early return, last successful time.
    """
    flags = int(flags)
    return int(STEP(int(function))(int(instance), float(t), float(h), 1, flags, flags + 8, flags + 16, flags + 24))


def call_trial(function: int, instance: int, t: float, h: float, flags: int) -> int:
    """The same for a step that may be taken back: FMI is told so (`noSetFMUStatePriorToCurrentPoint` is false)."""
    flags = int(flags)
    return int(STEP(int(function))(int(instance), float(t), float(h), 0, flags, flags + 8, flags + 16, flags + 24))
