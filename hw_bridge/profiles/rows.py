"""Rows that profiles share: process data of CiA 301, and default mappings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import I32, U8, U16, U32, NodeId, record, sub, var

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hw_bridge.dictionary import Entry


SDO_SERVER = record(
    0x1200,
    "SDO server parameter",
    sub(1, "COB-ID client to server", U32, "ro", NodeId(0x600)),
    sub(2, "COB-ID server to client", U32, "ro", NodeId(0x580)),
)
TOUCH_PROBES = (
    *var(0x60B8, "Touch probe function", U16, "rw", pdo=True),
    *var(0x60B9, "Touch probe status", U16, "ro", pdo=True),
    *var(0x60BA, "Touch probe 1 positive edge", I32, "ro", pdo=True),
    *var(0x60BB, "Touch probe 1 negative edge", I32, "ro", pdo=True),
    *var(0x60BC, "Touch probe 2 positive edge", I32, "ro", pdo=True),
    *var(0x60BD, "Touch probe 2 negative edge", I32, "ro", pdo=True),
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


def joined(*rows: Iterable[Entry]) -> tuple[Entry, ...]:
    """Concatenate rows to one table."""
    return tuple(entry for row in rows for entry in row)
