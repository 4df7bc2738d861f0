"""Quantity of each object, and the unit in which a drive counts it: the one table for commissioning and traces."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry
    from hw_bridge.profiles.description import Units

FACTOR = re.compile(r"([0-9.]*)\s*(.*)")  # of a unit, such as 10 mV
SUFFIXES = {"position": "", "velocity": "/s", "acceleration": "/s^2"}  # to the unit of the axis, m or rad
# what CiA 402 gives in the drive's own units, by kind
KINDS = {
    "position": (0x6062, 0x6064, 0x6065, 0x6067, 0x607A, 0x607C, 0x607D, 0x60B0, 0x60F4),
    "velocity": (0x606B, 0x606C, 0x607F, 0x6080, 0x6081, 0x6099, 0x60B1, 0x60FF),
    "acceleration": (0x6083, 0x6084, 0x6085, 0x609A, 0x60C5, 0x60C6),
    "torque": (0x6071, 0x6072, 0x6074, 0x6077, 0x60B2, 0x60E0, 0x60E1),
}
KIND_OF_OBJECT = {index: kind for kind, indices in KINDS.items() for index in indices}
# objects from which the size of a unit, or a current, follows
SCALING = (
    0x2210,
    0x2329,
    0x2350,
    0x3000,
    0x3001,
    0x3010,
    0x6075,
    *range(0x6089, 0x608F),
    0x608F,
    0x6091,
    0x6092,
    0x6096,
    0x60A8,
    0x60A9,
    0x60AA,
)
MILLI = re.compile("m(A|V|s|m|m/s)")
MILLISECONDS = (0x1017, 0x6066, 0x6068, 0x606E, 0x6070)  # of CiA 301 and 402


class Measure(NamedTuple):
    """Unit of a drive's number: `factor` times `unit`."""

    factor: float
    unit: str

    def in_si(self) -> Measure:
        """The same unit without the prefix milli."""
        return Measure(1e-3 * self.factor, self.unit[1:]) if MILLI.fullmatch(self.unit) else self


def symbol(kind: str, axis: str) -> str:
    """Symbol of the SI unit of a kind. `axis`: m or rad."""
    return "A" if kind == "torque" else f"{axis}{SUFFIXES[kind]}"


def measure(entry: Entry, units: Units | None, axis: str) -> Measure | None:
    """Unit of an entry: from its name in the profile, or as CiA 402 counts in this drive; None for plain numbers.

    `units`: of the drive, None where they are not known. `axis`: unit of its motor, m or rad.
    """
    if entry.unit and "units" not in entry.unit and (parts := FACTOR.fullmatch(entry.unit)):
        return Measure(float(parts[1] or 1), parts[2])
    if entry.index in MILLISECONDS:
        return Measure(1.0, "ms")
    kind = KIND_OF_OBJECT.get(entry.index)
    if kind is None or units is None or (entry.sub == 0 and entry.title):
        return None
    factor = getattr(units, kind)
    return Measure(factor, symbol(kind, axis)) if factor else None
