"""Planned writes of a run with names and units, for users."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from hw_bridge.commission.objects import SOFTWARE_LIMIT, format_value
from hw_bridge.dictionary import U32, Entry
from hw_bridge.hardware import format_quantity
from hw_bridge.master import Node, PlannedWrite

if TYPE_CHECKING:
    from hw_bridge.master import Station, WritePlan

QUICK_STOP = 0x6085  # its deceleration


class PlannedRow(NamedTuple):
    """One object: its name, current value, new value, and reason."""

    object: str
    name: str
    before: str
    after: str
    reason: str


def planned_rows(plan: WritePlan) -> list[PlannedRow]:
    """Return a row for each object that a run changes, in the order of its first write; quantities with their units.

    Objects whose value does not change are left out. A scale that is written as well counts for values after it.
    """
    last: dict[tuple[int, int], PlannedWrite] = {}
    for write in plan.writes:
        last[write.index, write.sub] = write
    changed = [write for address, write in last.items() if plan.stored_value(*address) != write.value]
    after = {
        (write.index, write.sub): _meant(plan.node, write.index, write.sub, write.value, True) for write in changed
    }
    with_units_before(plan)
    before = {
        (write.index, write.sub): _meant(plan.node, write.index, write.sub, plan.stored_value(write.index, write.sub))
        for write in changed
    }
    with_units_after(plan)
    return [
        PlannedRow(
            f"{write.index:04X}h.{write.sub}",
            _name(plan.node, write.index, write.sub),
            before[address],
            after[address],
            write.reason,
        )
        for write in changed
        if (address := (write.index, write.sub))
    ]


def write_heading(plan: WritePlan, rows: list[PlannedRow]) -> str:
    """Return the line above the rows: how many objects a run writes, also those that differ only during the mapping."""
    total = len({(write.index, write.sub) for write in plan.writes})
    passing = f", {total - len(rows)} of them only while it maps process data" if total > len(rows) else ""
    rest = f" {len(rows)} have another value during the run:" if passing else ""
    return f"{plan.node.name}: a run writes {total} objects{passing}, and restores them at its end{rest and '.'}{rest or ':'}"


def limit_note(plan: WritePlan, rows: list[PlannedRow]) -> list[tuple[str, list[Any]]]:
    """Line below the rows on the drive's own position limits, which are wider than those of the hardware file; else none."""
    if not isinstance(plan.node, Node) or not any(row.object.startswith("607Dh") for row in rows):
        return []
    low, high = (format_quantity(end, _unit(plan.node)) for end in plan.node.own.file.position)
    homing = " from where homing sets it to 0, and is written then" if plan.node.keys.homing is not None else ""
    text = (
        f"{plan.node.name}: 607Dh counts in the drive{homing}. It is a tenth of the range wider than limits.position, {low} to "
        f"{high}, which this program keeps to."
    )
    return [(text, [])]


def _unit(node: Node) -> str:
    return "rad" if node.rotary else "m"


def softer_stop(plan: WritePlan) -> list[str]:
    """Note where a run lowers the quick stop's deceleration (6085h) below the drive's own: it brakes over a longer way."""
    own = plan.stored_value(QUICK_STOP) if QUICK_STOP in plan.node.mirror else None
    value = next((write.value for write in reversed(plan.writes) if write.index == QUICK_STOP), None)
    if own is None or value is None or value >= own:
        return []
    text = [_meant(plan.node, QUICK_STOP, 0, number).partition(" (")[0] for number in (value, own)]
    note = (
        f"{plan.node.name}: during a run the quick stop brakes with {text[0]} (limits.acceleration), softer than the drive's "
        f"own {text[1]} (6085h). If the machine bears more, raise limits.acceleration."
    )
    return [note]


def with_units_before(plan: WritePlan) -> None:
    """Set the node's units to those of its current values."""
    _scale(plan, {address: plan.stored_value(*address) for address in _scales(plan)})


def with_units_after(plan: WritePlan) -> None:
    """Set the node's units to those of the planned values."""
    _scale(plan, {address: scale.value for address, scale in _scales(plan).items()})


def _scales(plan: WritePlan) -> dict[tuple[int, int], PlannedWrite]:
    """Writes that change units."""
    scaling = getattr(plan.node.profile, "scaling", ())
    return {(write.index, write.sub): write for write in plan.writes if (write.index, write.sub) in scaling}


def _scale(plan: WritePlan, values: dict[tuple[int, int], int | None]) -> None:
    node = plan.node
    if isinstance(node, Node) and values:
        node.mirror.values.update({address: value for address, value in values.items() if value is not None})
        node.use_units()


def _entry(node: Station, index: int, sub: int) -> Entry | None:
    return node.mirror.objects.get(index, {}).get(sub)


def _name(node: Station, index: int, sub: int) -> str:
    entry = _entry(node, index, sub)
    if entry is None:
        return "not in the profile"
    own = entry.label
    kind, _, rest = entry.title.partition(" PDO ")
    return f"{kind[0]}PDO {rest.split()[0]}: {own}" if kind in ("Receive", "Transmit") else own


def _meant(node: Station, index: int, sub: int, value: int | None, is_planned: bool = False) -> str:
    if value is None:
        return "not told"
    entry = _entry(node, index, sub) or Entry(index, sub, "", U32, "rw")
    if 0x1400 <= index < 0x1C00 and (sub or not index & 0x200):
        return f"{value:X}h" if sub == 1 or index & 0x200 else str(value)
    text = format_value(node, entry, value)
    if is_planned and index == SOFTWARE_LIMIT and isinstance(node, Node) and node.keys.homing is not None:
        homed = node.sign * value * node.units.position + node.keys.homing.at
        text = text.replace(" (", f" in the drive, {format_quantity(round(homed, 5), _unit(node))} from home (", 1)
    return text
