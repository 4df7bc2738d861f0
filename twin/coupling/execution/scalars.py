"""Conversion of scalars in memory, as part of the compiled loop; `loop.KINDS` has the codes of their types."""

from __future__ import annotations

from twin.compiler import (
    read8,
    read16,
    read32,
    read64,
    read_float,
    read_float32,
    write8,
    write16,
    write32,
    write64,
    write_float,
    write_float32,
)

TWO_TO_64 = 2.0**64


def convert_scalar(source: int, source_kind: int, target: int, target_kind: int, factor: float, offset: float) -> None:
    """Convert one scalar to another representation; integers are not converted to float, so none is rounded."""
    if source_kind < 2:
        value = read_float(source) if source_kind == 0 else read_float32(source)
        value = value * factor + offset
        integer = 0
    else:
        if source_kind >= 8 and source_kind < 10:
            integer = read64(source)
        elif source_kind >= 6 and source_kind < 8:
            integer = read32(source)
            if source_kind == 7:
                integer = integer & 0xFFFFFFFF
        elif source_kind >= 4 and source_kind < 6:
            integer = read16(source)
            if source_kind == 5:
                integer = integer & 0xFFFF
        else:
            integer = read8(source)
            if source_kind != 2:
                integer = integer & 0xFF
        number = float(integer)
        if source_kind == 9 and integer < 0:  # the upper half of UInt64
            number += TWO_TO_64
        value = number * factor + offset
    if target_kind == 0:
        write_float(target, value)
    elif target_kind == 1:
        write_float32(target, value)
    elif target_kind >= 8 and target_kind < 10:
        write64(target, integer)
    elif target_kind >= 6 and target_kind < 8:
        write32(target, integer)
    elif target_kind >= 4 and target_kind < 6:
        write16(target, integer)
    else:
        write8(target, integer)


def width(kind: int) -> int:
    """Return the size of a scalar of a kind [byte]."""
    if kind == 0 or kind == 8 or kind == 9:
        return 8
    if kind == 1 or kind == 6 or kind == 7:
        return 4
    return 2 if kind == 4 or kind == 5 else 1
