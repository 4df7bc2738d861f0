"""Status report of a drive, in words and units; only read."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hw_bridge.commission import object_texts
from hw_bridge.commission.objects import format_value, learn, upload
from hw_bridge.commission.single_axis_session import IN_DRIVE
from hw_bridge.dictionary import State, state_of
from hw_bridge.master import Node, SdoError

if TYPE_CHECKING:
    from hw_bridge.master import Reference, Station

Row = tuple[str, str]
GROUPS: dict[str, tuple[tuple[int, int], ...]] = {
    "power": ((0x6041, 0), (0x6040, 0), (0x6061, 0)),
    "motion": ((0x6064, 0), (0x606C, 0), (0x6062, 0), (0x60F4, 0), (0x6077, 0), (0x6078, 0), (0x30D1, 2)),
    "limits": (
        (0x607D, 1), (0x607D, 2), (0x6080, 0), (0x607F, 0), (0x6065, 0), (0x6083, 0), (0x6085, 0), (0x60C5, 0),
        (0x6075, 0), (0x3001, 1), (0x3001, 2), (0x2333, 1), (0x2333, 2), (0x6072, 0),
    ),
    "health": ((0x2200, 1), (0x2325, 7), (0x2326, 1), (0x2326, 2), (0x2326, 3), (0x3200, 1), (0x3200, 2), (0x3202, 1)),
    "inputs and outputs": ((0x60FD, 0), (0x60FE, 1)),
    "if this program is lost": (*((0x1016, sub) for sub in range(1, 9)), (0x1017, 0), (0x6007, 0), (0x60C2, 1)),
}  # fmt: skip
MODE, POSITION = 0x6061, 0x6064
VAGUE = ("Actual [mA]",)  # names that say nothing without their record's
MONITORED = ((0x6041, 0), (0x6061, 0), (0x6064, 0), (0x606C, 0), (0x6077, 0), (0x6078, 0), (0x603F, 0))


@dataclass
class Status:
    """Status report of a node: rows by group, and its errors with remedies."""

    groups: dict[str, list[Row]] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)


def status(node: Station, reference: Reference | None = None) -> Status:
    """Read all objects of the groups that the profile has; missing ones are left out. `reference`: as in `rows`."""
    learn(node)
    report = Status({group: rows(node, addresses, reference) for group, addresses in GROUPS.items()})
    if isinstance(node, Node):
        if reference is not None and (problem := reference.problem(node)):
            report.groups["motion"].append(("not homed", problem))
        report.errors = object_texts.errors_and_history(node.sdo, node.profile.faults)
    return report


def rows(node: Station, addresses: tuple[tuple[int, int], ...], reference: Reference | None = None) -> list[Row]:
    """Name and value of the objects at these addresses that the node has; of a drive's `reference` also its position."""
    values = []
    for index, sub in addresses:
        entry = node.mirror.objects.get(index, {}).get(sub)
        if entry is None:
            continue
        with suppress(SdoError):
            values.append((entry, upload(node, entry)))
            if index == MODE:  # bits of the statusword, which is read before, depend on it
                node.mirror.values[index, sub] = values[-1][1]
    lines = []
    for entry, value in values:
        index, sub = entry.index, entry.sub
        title = entry.title if entry.name in VAGUE else entry.name
        text = format_value(node, entry, value)
        if index == POSITION and reference is not None and isinstance(node, Node):
            text = position_text(node, reference, text)
        lines.append((f"{index:04X}h{f'.{sub}' if sub else ''} {title.partition(' [')[0]}", text))
    return lines


def position_text(node: Node, reference: Reference, text: str) -> str:
    """Position from the reference, with 6064h as `text`; while a command moves the drive its reference is open."""
    own = text.partition(" (")[0]
    if state_of(node.sdo.number(0x6041) & 0xFFFF) is State.ENABLED:
        return f"{own} {IN_DRIVE}, moved by a program"
    if reference.problem(node):
        return f"{own} {IN_DRIVE}, not homed"
    return f"{node.format_length(reference.position(node))} from reference ({own} {IN_DRIVE}), homed"


def monitored_rows(
    node: Station, more: tuple[tuple[int, int], ...] = (), reference: Reference | None = None
) -> list[Row]:
    """Values that change during operation, and those of `more`: for `monitor`."""
    return rows(node, (*MONITORED, *more), reference)
