"""Inspection of objects that decide how a drive homes, limits its current and stops: read, and compared with the hardware file.

None of them is written unless the hardware file names it under `objects`.
"""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.commission.objects import format_value
from hw_bridge.dictionary import U8, U16, U32, Entry, cia301, cia402
from hw_bridge.hardware import format_quantity, motor_data
from hw_bridge.master import SdoError, setup
from hw_bridge.profiles import symbol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.master import Node

Address = tuple[int, int]
GROUPS: dict[str, tuple[Address, ...]] = {
    "homing": (
        (0x6098, 0), (0x607C, 0), (0x30B0, 0), (0x30B1, 0), (0x30B2, 0), (0x2080, 0), (0x2081, 0), (0x2324, 2), (0x2350, 0), (0x2351, 0),
    ),
    "current": (
        (0x6072, 0), (0x60E0, 0), (0x60E1, 0), (0x6075, 0), (0x3001, 1), (0x3001, 2), (0x2333, 1), (0x2333, 2), (0x6410, 1), (0x6410, 2),
        (0x2329, 1), (0x2329, 2), (0x2329, 3),
    ),
    "stop": (
        (0x605A, 0), (0x605B, 0), (0x605C, 0), (0x605D, 0), (0x605E, 0), (0x6007, 0), (0x1029, 1), (0x6065, 0), (0x6066, 0),
        (0x60C2, 1),
    ),
    "SYNC": ((0x1019, 0),),
    "inputs, outputs, brake": (
        (0x60FD, 0), (0x60FE, 1), (0x60FE, 2), (0x3202, 1), (0x2310, 1), (0x2310, 2), (0x2310, 3),
        *((0x3142, sub) for sub in range(1, 9)), *((0x3151, sub) for sub in range(1, 4)),
        (0x3158, 1), (0x3158, 2), (0x3158, 3),
    ),
}  # fmt: skip
# objects that profiles have not but drives may have: name and type, used where the drive answers
MORE: dict[Address, Entry] = {
    (entry.index, entry.sub): entry
    for entry in (
        Entry(0x2324, 2, "Block detection time", U16, "ro"),
        Entry(0x2350, 0, "Homing torque limit [0.001 of the rated torque]", U16, "ro"),
        Entry(0x2351, 0, "Homing torque limit [0.001 of the rated torque]", U16, "ro"),
        Entry(0x2329, 1, "Motor data 1", U32, "ro"),
        Entry(0x2329, 2, "Motor data 2", U32, "ro"),
        Entry(0x2329, 3, "Motor data 3", U32, "ro"),
        Entry(0x2310, 1, "Negative limit switches", U8, "ro"),
        Entry(0x2310, 2, "Positive limit switches", U8, "ro"),
        Entry(0x2310, 3, "Homing switches", U8, "ro"),
        Entry(0x605D, 0, "Halt option code", U16, "ro"),
        Entry(0x1019, 0, "Synchronous counter overflow value", U8, "ro"),
        Entry(0x1029, 1, "Communication error", U8, "ro"),
    )
}
COASTS = 0  # of 605Ah: the power stage goes off at once
MORE_SDO_SERVERS = range(0x1201, 0x1280)  # CiA 301; 1200h is the default one, whose requests a run monitors
STAYS_OPERATIONAL = 1  # of 1029h.1
BLOCK_METHODS = range(-4, 0)  # against an end stop


class Inspection(NamedTuple):
    """Rows (object, name, value) by group, and conflicts with the hardware file."""

    groups: dict[str, list[tuple[str, str, str]]]
    notes: list[str]


def inspect(node: Node) -> Inspection:
    """Read all inspected objects that the drive has, and compare them with the hardware file."""
    values: dict[Address, int] = {}
    groups: dict[str, list[tuple[str, str, str]]] = {"scale": _scale(node)}
    for group, addresses in GROUPS.items():
        rows = groups[group] = []
        for address in addresses:
            if (entry := _entry(node, address)) is None:
                continue
            try:
                data = setup.upload(node, *address)
            except SdoError:
                continue
            value = values[address] = int.from_bytes(data, "little", signed=entry.type.signed)
            if address[1] in node.mirror.objects.get(address[0], {}):
                node.mirror.values[address] = value
            rows.append((f"{address[0]:04X}h.{address[1]}", entry.label, format_value(node, entry, value)))
    return Inspection(
        {group: rows for group, rows in groups.items() if rows}, [*_notes(node, values), *_sdo_servers(node)]
    )


def _sdo_servers(node: Node) -> Iterator[str]:
    """Yield enabled SDO servers other than the default one: a run does not monitor their requests."""
    for index in MORE_SDO_SERVERS:
        try:
            identifier = node.sdo.number(index, 1)
        except SdoError:
            return
        if not identifier & cia301.INVALID:
            yield (
                f"{node.name}: {index:04X}h is a second SDO server, at {identifier & 0x1FFFFFFF:X}h: what another program writes "
                f"there is not noticed during a run. Set bit 31 of {index:04X}h.1 if nothing needs it."
            )


def _scale(node: Node) -> list[tuple[str, str, str]]:
    """Return rows of the size of each device unit and of the objects that it follows from, as `learn_scaling` read them."""
    assumed = ", ASSUMED" if node.own.assumed else ""
    rows = []
    for kind, unit in node.units._asdict().items():
        if unit:
            rows.append(
                ("", f"one unit of {kind}", f"{format_quantity(unit, symbol(kind, node.profile.motor.unit))}{assumed}")
            )
    for address in node.profile.scaling:
        if (entry := _entry(node, address)) is not None:
            value = node.mirror.get(*address)
            text = f"{value} ({value:X}h)" if value > 0xFFFF else str(value)
            rows.append((f"{address[0]:04X}h.{address[1]}", entry.label, text))
    return rows


def _entry(node: Node, address: Address) -> Entry | None:
    """The entry of the profile, else that of `MORE` if the profile has no other object of this index."""
    subs = node.mirror.objects.get(address[0], {})
    if (own := subs.get(address[1])) is not None:
        return None if own.title and not own.sub else own  # how many a record has
    return None if subs else MORE.get(address)


def _notes(node: Node, values: dict[Address, int]) -> Iterator[str]:
    """Yield conflicts with the hardware file, and limitations."""
    name, homing = node.name, node.keys.homing
    limit, constant = node.own.file.force, motor_data.force_constant_of(node.keys)
    rated = (values.get((0x6075, 0)) or values.get((0x2329, 1), 0)) / 1e3
    currents = [values[address] / 1e3 for address in ((0x30B2, 0), (0x2080, 0)) if address in values]
    currents += [values[address] * rated / 1e3 for address in ((0x2350, 0), (0x2351, 0)) if address in values and rated]
    newton = "N*m" if node.rotary else "N"
    if homing is not None and homing.method in BLOCK_METHODS:
        if not currents:
            yield f"{name}: homing pushes against an end stop, and no object tells with which current."
        elif max(currents) * constant > limit:
            yield (
                f"{name}: homing pushes against the end stop with {format_quantity(max(currents) * constant, newton)}, above "
                f"limits.force {format_quantity(limit, newton)}. Lower it under `objects` (30B2h or 2080h, or 2350h and 2351h)."
            )
    peak = motor_data.drive_force(node.keys, node.mirror)
    if not isfinite(peak):
        yield f"{name}: no object tells the drive's own limit of the current. limits.force is watched by this program alone."
    elif peak > limit:
        yield (
            f"{name}: the drive's own currents allow {format_quantity(peak, newton)}, limits.force is "
            f"{format_quantity(limit, newton)}: only this program "
            f"watches it. Lower them under `objects` or in the drive, so that the drive holds it too."
        )
    if counter := values.get((0x1019, 0)):
        yield (
            f"{name}: 1019h is {counter}: it takes SYNC with a counter only, and this program sends none. Set it to 0: "
            f"twin hil set {node.number} 1019h 0."
        )
    if closed := cia402.closed_limit_switches(values.get((cia402.INPUTS, 0), 0)):
        yield f"{name}: {closed} closed (60FDh): it may not move, or away from there only. Check place and polarity."
    options = {(row.index, row.sub): row.value for row in node.profile.setup} | node.keys.objects
    if options.get((0x605A, 0), values.get((0x605A, 0))) == COASTS:
        yield f"{name}: 605Ah is 0: at a quick stop it coasts. Set a ramp: twin hil set {node.number} 605Ah 2."
    if options.get((0x1029, 1), values.get((0x1029, 1))) == STAYS_OPERATIONAL:
        yield f"{name}: 1029h.1 is 1: it stays Operational when it misses this program's heartbeat. 6007h stops it alone."
    if node.profile.rpdo_timeout and values.get((0x60C2, 1)) is not None:
        yield f"{name}: 8250h (RPDO time-out) follows from 60C2h, which a run sets to its cycle; see late_cycle.rpdo_timeout."
