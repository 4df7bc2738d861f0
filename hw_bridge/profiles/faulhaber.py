"""Communication objects that FAULHABER's drives share (CiA 301)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import TEXT, U8, U16, U32, NodeId, record, sub, var
from hw_bridge.profiles.rows import SDO_SERVER, joined

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry

VENDOR_ID = 327


def communication(
    name: str, software: str, identity: tuple[int, int], errors: int, groups: tuple[int, int], hardware: str = ""
) -> tuple[Entry, ...]:
    """Return 1000h to 1200h. `identity`: product code and revision; `groups`: numbers of 1010h and 1011h."""
    product, revision = identity
    store, restore = groups
    return joined(
        var(0x1000, "Device type", U32, "const", 0x00420192),
        var(0x1001, "Error register", U8, "ro", pdo=True),
        record(
            0x1003,
            "Pre-defined error field",
            sub(0, "Number of errors", U8, "rw", 0),
            *(sub(n, f"Standard error field {n}", U32, "ro") for n in range(1, errors + 1)),
        ),
        var(0x1005, "COB-ID SYNC", U32, "rw", 0x80),
        var(0x1008, "Manufacturer device name", TEXT, "const", name),
        var(0x1009, "Manufacturer hardware version", TEXT, "const", hardware) if hardware else (),
        var(0x100A, "Manufacturer software version", TEXT, "const", software),
        var(0x100C, "Guard time", U16, "rw"),
        var(0x100D, "Life time factor", U8, "rw"),
        record(0x1010, "Store parameters", *_groups("Save", store)),
        record(0x1011, "Restore default parameters", *_groups("Restore", restore)),
        var(0x1014, "COB-ID EMCY", U32, "rw", NodeId(0x80)),
        record(0x1016, "Consumer heartbeat time", sub(1, "Consumer heartbeat time 1", U32, "rw")),
        var(0x1017, "Producer heartbeat time", U16, "rw"),
        record(
            0x1018,
            "Identity object",
            sub(1, "Vendor ID", U32, "const", VENDOR_ID),
            sub(2, "Product code", U32, "const", product),
            sub(3, "Revision number", U32, "const", revision),
            sub(4, "Serial number", U32, "const", 1),
        ),
        record(0x1029, "Error behavior", sub(1, "Communication error", U8, "rw", 0, 0, 2)),
        SDO_SERVER,
    )


def _groups(verb: str, count: int) -> list[Entry]:
    return [sub(n, f"{verb} group {n}", U32, "rw", 1) for n in range(1, count + 1)]
