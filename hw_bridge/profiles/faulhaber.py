"""Objects that FAULHABER's drives share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import TEXT, U32, record, sub, var
from hw_bridge.profiles.rows import HEARTBEATS, adapted, error_field, joined, parameter_groups, standard

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry

VENDOR_ID = 327
HOMING_SPEEDS = record(
    0x6099, "Homing speed", sub(1, "Switch seek velocity", U32, "rw", 40), sub(2, "Zero seek velocity", U32, "rw", 20)
)


def communication(
    name: str, software: str, identity: tuple[int, int], errors: int, groups: tuple[int, int], hardware: str = ""
) -> tuple[Entry, ...]:
    """Return 1000h to 1200h. `identity`: product code and revision; `groups`: numbers of 1010h and 1011h."""
    return joined(
        adapted(0x1000, 0x00420192),
        standard(0x1001),
        error_field(errors),
        standard(0x1005),
        adapted(0x1008, name),
        var(0x1009, "Manufacturer hardware version", TEXT, "const", hardware) if hardware else (),
        var(0x100A, "Manufacturer software version", TEXT, "const", software),
        standard(0x100C, 0x100D),
        parameter_groups(*groups),
        HEARTBEATS,
        adapted(0x1018, (VENDOR_ID, *identity, 1)),
        standard(0x1029, 0x1200),
    )
