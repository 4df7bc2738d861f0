"""Compare limits of the hardware file with the drive's own: the narrower one is effective."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.commission.objects import OPEN, learn, upload
from hw_bridge.hardware import format_quantity, motor_data
from hw_bridge.master import SdoError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.dictionary import Entry
    from hw_bridge.master import Node

ABSURD = 10.0  # so many times the drive's own limit is a slip of the pen, not a choice
DECELERATIONS = (0x6084, 0x6085)  # of a stop
NEAR = 1.01  # rounding to the drive's units
CURRENTS = (
    (0x6072, 0), (0x6073, 0), (0x60E0, 0), (0x60E1, 0), (0x6075, 0), (0x2329, 1), (0x3001, 2), (0x2333, 2), (0x6410, 1), (0x6410, 2),
)  # fmt: skip


class Row(NamedTuple):
    """A limit of the file and the drive's own, in SI; `source`: the object that holds it."""

    name: str
    file: float
    own: float
    source: str
    unit: str


def compare(node: Node) -> list[Row]:
    """Return every limit that both have. Only reads."""
    learn(node)
    limits, scale, units = node.own.file, node.keys.scale, node.units
    low, high = limits.position
    length = "rad" if node.rotary else "m"
    plain = (
        ("velocity", limits.velocity, 0x6080, units.velocity, "/s"),
        ("velocity", limits.velocity, 0x607F, units.velocity, "/s"),
        ("following_error", limits.following_error, 0x6065, units.position, ""),
        ("acceleration", limits.acceleration, 0x60C5, units.acceleration, "/s^2"),
    )
    rows = [
        Row(name, file, value * scale * unit, f"{index:04X}h", f"{length}{suffix}")
        for name, file, index, unit, suffix in plain
        if (value := _own(node, index, 0)) is not None and value < OPEN
    ]
    ends = [_own(node, 0x607D, sub) for sub in (1, 2)]
    if ends[0] is not None and ends[1] is not None and 0 < ends[1] - ends[0] < OPEN:
        rows.append(Row("position", high - low, (ends[1] - ends[0]) * scale * units.position, "607Dh", length))
    for index, sub in CURRENTS:
        if (value := _own(node, index, sub)) is not None:
            node.mirror.values[index, sub] = value
    peak = motor_data.drive_force(node.keys, node.mirror)
    return [*rows, Row("force", limits.force, peak, "its peak current", "N*m" if length == "rad" else "N")]


def assert_can_stop(node: Node, entry: Entry, value: int, unit: str) -> None:
    """Raise SimulationError for a deceleration (6084h, 6085h) that needs more than the travel to stop from the greatest velocity.

    Both are those of the hardware file; without one they are the drive's own, if it limits them. `unit`: m or rad.
    """
    low, high = node.own.file.position
    speed, travel = node.own.file.velocity, high - low
    if not node.own.file.model_fields_set:
        own = {row.name: row.own for row in sorted(compare(node), key=lambda row: -row.own)}  # the least of each name
        speed, travel = own.get("velocity", 0.0), own.get("position", math.inf)
    least, rate = speed**2 / (2.0 * travel), value * node.keys.scale * node.units.acceleration
    if rate < least / NEAR:
        distance = f"{format_quantity(speed**2 / (2.0 * rate), unit)} to stop" if rate > 0.0 else "no end"
        raise SimulationError(
            f"{node.name}: {entry.index:04X}h {entry.label}: {format_quantity(rate, f'{unit}/s^2')} takes {distance} from "
            f"{format_quantity(speed, f'{unit}/s')}, but the travel is {format_quantity(travel, unit)}. Nothing was written. "
            f"At least {format_quantity(least, f'{unit}/s^2')} is possible."
        )


def _own(node: Node, index: int, sub: int) -> int | None:
    entry = node.mirror.objects.get(index, {}).get(sub)
    if entry is None:
        return None
    try:
        value = upload(node, entry)
    except SdoError:
        return None
    return value if isinstance(value, int) else None


def defaulted(node: Node) -> Iterator[str]:
    """Yield a line that names the limits which the hardware file does not give, with their values."""
    length, force = ("rad", "N*m") if node.rotary else ("m", "N")
    units = {"position": "", "velocity": "/s", "following_error": "", "acceleration": "/s^2"}
    texts = []
    for name, suffix in (*units.items(), ("force", "")):
        if name not in node.own.file.model_fields_set:
            value, unit = getattr(node.own.file, name), force if name == "force" else f"{length}{suffix}"
            ends = value if isinstance(value, list) else [value]
            texts.append(f"{name}: {' to '.join(format_quantity(end, unit) for end in ends)}")
    if texts:
        yield f"{node.name}: not given under limits, so that defaults apply: {', '.join(texts)}. Are they right for this axis?"


def wider(node: Node, rows: list[Row]) -> Iterator[tuple[str, bool]]:
    """Yield a line for each limit that is wider than the drive's own, and whether it is absurd."""
    for row in rows:
        if row.own <= 0.0 or row.file <= NEAR * row.own:
            continue
        file_limit, drive_limit = format_quantity(row.file, row.unit), format_quantity(row.own, row.unit)
        text = f"{node.name}: limits.{row.name} {file_limit} is above the drive's own {drive_limit} ({row.source})."
        absurd = row.file > ABSURD * row.own
        yield (f"{text} Correct the unit or the number." if absurd else text), absurd
