"""Objects that CiA 301 and CiA 402 define, as most drives have them; a profile lists its own differences."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hw_bridge.dictionary import I8, I16, I32, TEXT, U8, U16, U32, NodeId, Value, record, sub, var

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hw_bridge.dictionary import Entry

STANDARD = {
    rows[0].index: rows
    for rows in (
        var(0x1000, "Device type", U32, "const"),
        var(0x1001, "Error register", U8, "ro", pdo=True),
        var(0x1005, "COB-ID SYNC", U32, "rw", 0x80),
        var(0x1008, "Manufacturer device name", TEXT, "const"),
        var(0x100C, "Guard time", U16, "rw"),
        var(0x100D, "Life time factor", U8, "rw"),
        var(0x1014, "COB-ID EMCY", U32, "rw", NodeId(0x80)),
        var(0x1017, "Producer heartbeat time", U16, "rw"),
        record(0x1018, "Identity object", *(sub(n, name, U32, "const") for n, name in enumerate(
               ("Vendor ID", "Product code", "Revision number", "Serial number"), 1))),
        record(0x1029, "Error behavior", sub(1, "Communication error", U8, "rw", 0, 0, 2)),
        record(0x1200, "SDO server parameter", sub(1, "COB-ID client to server", U32, "ro", NodeId(0x600)),
               sub(2, "COB-ID server to client", U32, "ro", NodeId(0x580))),
        var(0x6007, "Abort connection option code", I16, "rw", 0, 0, 3),
        var(0x603F, "Error code", U16, "ro", pdo=True),
        var(0x6040, "Controlword", U16, "rw", pdo=True),
        var(0x6041, "Statusword", U16, "ro", pdo=True),
        var(0x605A, "Quick stop option code", I16, "rw", 2, 0, 6),
        var(0x605B, "Shutdown option code", I16, "rw", 0, 0, 1),
        var(0x605C, "Disable operation option code", I16, "rw", 1, 0, 1),
        var(0x605E, "Fault reaction option code", I16, "rw", 2, 0, 2),
        var(0x6060, "Modes of operation", I8, "rw", 1, pdo=True),
        var(0x6061, "Modes of operation display", I8, "ro", pdo=True),
        var(0x6062, "Position demand value", I32, "ro", pdo=True),
        var(0x6063, "Position actual internal value", I32, "ro", pdo=True),
        var(0x6064, "Position actual value", I32, "ro", pdo=True),
        var(0x6065, "Following error window", U32, "rw", 2000),
        var(0x6066, "Following error time out", U16, "rw"),
        var(0x6067, "Position window", U32, "rw", 0xFFFFFFFF),
        var(0x6068, "Position window time", U16, "rw"),
        var(0x606B, "Velocity demand value", I32, "ro", pdo=True),
        var(0x606C, "Velocity actual value", I32, "ro", pdo=True),
        var(0x606D, "Velocity window", U16, "rw", pdo=True),
        var(0x606E, "Velocity window time", U16, "rw", pdo=True),
        var(0x606F, "Velocity threshold", U16, "rw", pdo=True),
        var(0x6070, "Velocity threshold time", U16, "rw", pdo=True),
        var(0x6071, "Target torque", I16, "rw", pdo=True),
        var(0x6077, "Torque actual value", I16, "ro", pdo=True),
        var(0x6078, "Current actual value [mA]", I16, "ro", pdo=True),
        var(0x607A, "Target position", I32, "rw", pdo=True),
        var(0x607C, "Homing offset", I32, "rw"),
        record(0x607D, "Software position limit", sub(1, "Min position limit", I32, "rw"),
               sub(2, "Max position limit", I32, "rw")),
        var(0x607E, "Polarity", U8, "rw", 0, 0, 0),  # of position bit 7, of velocity bit 6; not simulated
        var(0x607F, "Max profile velocity", U32, "rw"),
        var(0x6080, "Max motor speed", U32, "rw"),
        var(0x6081, "Profile velocity", U32, "rw", 1000, pdo=True),
        var(0x6083, "Profile acceleration", U32, "rw", 10000, pdo=True),
        var(0x6084, "Profile deceleration", U32, "rw", 10000, pdo=True),
        var(0x6085, "Quick stop deceleration", U32, "rw", 10000, pdo=True),
        var(0x6086, "Motion profile type", I16, "rw", 0, 0, 0),  # 1, sin2, is not simulated
        record(0x6092, "Feed constant", sub(1, "Feed", U32, "rw", 1, 1), sub(2, "Shaft revolutions", U32, "rw", 1, 1)),
        var(0x6098, "Homing method", I8, "rw", 7),
        record(0x6099, "Homing speeds", sub(1, "Speed for switch search", U32, "rw", 100),
               sub(2, "Speed for zero search", U32, "rw", 10)),
        var(0x609A, "Homing acceleration", U32, "rw", 1000),
        var(0x60B0, "Position offset", I32, "rw", pdo=True),
        var(0x60B1, "Velocity offset", I32, "rw", pdo=True),
        var(0x60B2, "Torque offset", I16, "rw", pdo=True),
        var(0x60B8, "Touch probe function", U16, "rw", pdo=True),
        var(0x60B9, "Touch probe status", U16, "ro", pdo=True),
        var(0x60BA, "Touch probe 1 positive edge", I32, "ro", pdo=True),
        var(0x60BB, "Touch probe 1 negative edge", I32, "ro", pdo=True),
        var(0x60BC, "Touch probe 2 positive edge", I32, "ro", pdo=True),
        var(0x60BD, "Touch probe 2 negative edge", I32, "ro", pdo=True),
        var(0x60C5, "Max acceleration", U32, "rw", 0xFFFFFFFF),  # not used in cyclic modes
        var(0x60F4, "Following error actual value", I32, "ro", pdo=True),
        var(0x60FD, "Digital inputs", U32, "ro", pdo=True),
        var(0x60FF, "Target velocity", I32, "rw", pdo=True),
        var(0x6402, "Motor type", U16, "rw", 10),
        var(0x6502, "Supported drive modes", U32, "const"),
    )
}  # fmt: skip


def joined(*rows: Iterable[Entry]) -> tuple[Entry, ...]:
    """Concatenate rows to one table."""
    return tuple(entry for row in rows for entry in row)


def standard(*indices: int) -> tuple[Entry, ...]:
    """Objects as in `STANDARD`."""
    return joined(*(STANDARD[index] for index in indices))


def adapted(
    index: int,
    default: Value | tuple[int, ...] | None = None,
    low: int | None = None,
    high: int | None = None,
    **changes: Any,
) -> tuple[Entry, ...]:
    """An object of `STANDARD` with a drive's own default (of a record: of each subindex), range, and other fields of `Entry`."""
    (*count,) = (entry for entry in STANDARD[index] if entry.title and not entry.sub)
    values = STANDARD[index][len(count) :]
    changes |= {key: bound for key, bound in (("low", low), ("high", high)) if bound is not None}
    defaults = default if isinstance(default, tuple) else (default,) * len(values)
    return (
        *count,
        *(
            replace(entry, default=entry.default if own is None else own, **changes)
            for entry, own in zip(values, defaults, strict=True)
        ),
    )


def numbered(name: str, count: int, access: str = "rw", default: int = 0) -> list[Entry]:
    """Subindices 1 to `count` of 32 bits; `name` has a place for the number."""
    return [sub(n, name.format(n), U32, access, default) for n in range(1, count + 1)]


def error_field(errors: int) -> tuple[Entry, ...]:
    """1003h with room for so many errors."""
    count = sub(0, "Number of errors", U8, "rw")
    return record(0x1003, "Pre-defined error field", count, *numbered("Standard error field {}", errors, "ro"))


def parameter_groups(store: int, restore: int) -> tuple[Entry, ...]:
    """1010h and 1011h with so many groups."""
    return joined(
        record(0x1010, "Store parameters", *numbered("Save group {}", store, default=1)),
        record(0x1011, "Restore default parameters", *numbered("Restore group {}", restore, default=1)),
    )


HEARTBEATS = joined(
    standard(0x1014),
    record(0x1016, "Consumer heartbeat time", *numbered("Consumer heartbeat time {}", 1)),
    standard(0x1017),
)


def pdo(
    number: int,
    base: int,
    mapping: tuple[int, ...],
    *,
    receive: bool,
    objects: int,
    flags: int = 0,
    inhibit: int | None = None,
    event: int | None = None,
) -> tuple[Entry, ...]:
    """Communication and mapping record of PDO `number` from 1; `inhibit` and `event`: defaults where it has them."""
    name = f"{'Receive' if receive else 'Transmit'} PDO {number}"
    subs = [
        sub(1, "COB-ID", U32, "rw", NodeId(flags | base)),
        sub(2, "Transmission type", U8, "rw", 255),
    ]
    if inhibit is not None:
        subs.append(sub(3, "Inhibit time", U16, "rw", inhibit))
    if event is not None:
        subs.append(sub(5, "Event timer", U16, "rw", event, 0, 65000))
    words = [*mapping, *[0] * (objects - len(mapping))]
    start = 0x1400 if receive else 0x1800
    return (
        *record(start + number - 1, f"{name} communication parameter", *subs),
        *record(
            start + 0x200 + number - 1,
            f"{name} mapping parameter",
            sub(0, "Number of mapped objects", U8, "rw", len(mapping)),
            *(
                sub(number_in_map, f"Mapped object {number_in_map}", U32, "rw", word)
                for number_in_map, word in enumerate(words, 1)
            ),
        ),
    )


def process_data(
    objects: int,
    receive: Sequence[tuple[int, ...]],
    transmit: Sequence[tuple[int, ...]],
    receive_flags: Sequence[int] = (0, 0, 0, 0),
    transmit_flags: Sequence[int] = (0, 0, 0, 0),
    **times: int,
) -> tuple[Entry, ...]:
    """PDOs with these mappings, the COB-IDs of CiA 301 and flags of them. `times`: `inhibit` and `event` of TPDOs."""
    kinds: tuple[Any, ...] = ((0x200, receive, receive_flags, {}), (0x180, transmit, transmit_flags, times))
    return joined(
        *(
            pdo(n + 1, base + 0x100 * n, mapping, receive=base == 0x200, objects=objects, flags=flags[n], **more)
            for base, mappings, flags, more in kinds
            for n, mapping in enumerate(mappings)
        )
    )
