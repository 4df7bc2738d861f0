"""The planned writes of a set-up, before any of them is made: previous value, new value, and reason of each."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import cia301, cia402
from hw_bridge.master.limits import (
    FOLLOWING_ERROR,
    HOMING_FORCE_REASON,
    LIMITS,
    POSITION_LIMITS,
    SPEED_LIMITS,
    lowered_for_homing,
    narrow,
)
from hw_bridge.master.pdo_mapping import PDOS, takes_set_points
from hw_bridge.master.presence import learn_objects
from hw_bridge.master.scaling import learn_scaling, unknown_scale, wrong_motor
from hw_bridge.master.sdo import SdoError
from hw_bridge.master.writes import clamp_to_range, decode_number, encode_number, upload_before_write
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.master.node import Node
    from hw_bridge.master.station import Station

Address = tuple[int, int]
ACCELERATIONS, PROFILE_VELOCITY = (0x6083, 0x6084, 0x6085), 0x6081
MODE = 0x6060
HOMING_OFFSETS = (
    0x607C,
    0x30B0,
    0x30B1,
    0x2081,
)  # home offset; home position of an EPOS4, the way after it; of an EPOS2
ABORT_OPTION, NO_ACTION = 0x6007, 0
CONSUMER = 0x1016  # heartbeats that the node watches
FAULT_MASK = (0x2321, 2)  # of a FAULHABER V2: errors that trip
HEARTBEAT_LOST = 0x8130  # EMCY
EXACT = 1.0 - 1e-12  # a whole number of units is not rounded up because its quotient is off by the last bit
NARROWED = ("velocity", "acceleration", "following_error")  # of the limits, beside positions
OWN = "; the drive's own is narrower and counts"


@dataclass(frozen=True, slots=True)
class PlannedWrite:
    """One write. `later`: not made while process data are set up, but after homing, or by process data."""

    index: int
    sub: int
    value: int
    reason: str
    later: bool = False


class WritePlan:
    """The writes of one node in order. `before`: previous values; `refused`: a line for each object that it does not have."""

    def __init__(self, node: Station) -> None:
        self.node = node
        self.writes: list[PlannedWrite] = []
        self.before: dict[Address, bytes] = dict(node.unrestored)
        self.refused: list[str] = []
        self.problems: list[str] = []  # why it cannot be moved
        self.notes: list[str] = []  # what it has not, and what acts instead
        self._present: dict[Address, int] = {}

    def stored_value(self, index: int, sub: int = 0) -> int | None:
        """Value of an object before the run; None if the node refuses to read it, which is noted once."""
        address = index, sub
        if address not in self.before:
            try:
                self.before[address] = upload_before_write(self.node, index, sub)
            except SdoError as error:
                self.before[address] = b""
                self.refused.append(
                    f"{self.node.name}: {error} A run writes it. Correct the hardware file or the profile."
                )
        data = self.before[address]
        return decode_number(self.node, index, sub, data) if data else None

    def peek(self, index: int, sub: int = 0) -> int | None:
        """The same of an object that the run may not write: a missing one is not noted."""
        try:
            self.before.setdefault((index, sub), upload_before_write(self.node, index, sub))
        except SdoError:
            return None
        return self.stored_value(index, sub)

    def planned_value(self, index: int, sub: int = 0) -> int | None:
        """Value of an object after the writes planned so far; None where the node does not have it."""
        return self._present.get((index, sub), self.peek(index, sub))

    def add(self, index: int, sub: int, value: int, reason: str, later: bool = False) -> None:
        """Plan a write, unless the object holds this value already."""
        before = self.stored_value(index, sub)
        if self._present.get((index, sub), before) == value:
            return
        self._present[index, sub] = value
        self.writes.append(PlannedWrite(index, sub, value, reason, later))

    def add_if_present(self, index: int, value: int, reason: str) -> None:
        """Plan a write where the profile has such an object, clamped to its range."""
        entry = self.node.mirror.find(index)
        if entry is not None and entry.writable:
            self.add(index, 0, clamp_to_range(entry, value), reason)

    def sizes(self) -> list[str]:
        """Numbers whose size differs from the profile's."""
        lines = []
        for (index, sub), data in self.before.items():
            entry = self.node.mirror.find(index, sub)
            if entry is not None and data and len(data) != entry.type.size:
                lines.append(
                    f"{self.node.name}: {index:04X}h.{sub} has {len(data)} bytes, in the profile {entry.type.size}."
                )
        return lines

    def encode(self) -> list[tuple[PlannedWrite, bytes]]:
        """The writes with their bytes; SimulationError where a value does not fit what the node has."""
        return [(write, encode_number(self.node, write.index, write.sub, write.value)) for write in self.writes]

    def raise_problems(self) -> None:
        """Raise SimulationError with everything that prevents a run, before anything is written."""
        if problems := [*self.refused, *self.problems]:
            raise SimulationError(" ".join(problems))


def plan_drive(node: Node, period: int, master: int) -> WritePlan:
    """Plan all writes of a run to a drive. Only reads.

    `period` [ns]: of interpolation; 0: none, and no RPDO time-out where a drive has one.
    """
    plan = WritePlan(node)
    findings = learn_objects(node)
    plan.notes += findings.notes
    plan.problems += findings.problems
    learn_scaling(node)
    plan.notes += [
        f"{node.name}: has no {index:04X}h, by which its profile scales: another object of it tells that."
        for index in dict.fromkeys(index for index, _ in node.profile.scaling)
        if index not in node.mirror
    ]
    _own_limits(plan, node)
    for row in node.profile.setup:
        index, sub, value = row.index, row.sub, row.value
        entry = node.mirror.find(index, sub)
        if entry is None:
            continue
        if clamp_to_range(entry, value) != value or not entry.writable:  # by its EDS file
            plan.notes.append(
                f"{node.name}: {index:04X}h.{sub} {entry.name} stays as it is, it cannot become {value:X}h."
            )
            continue
        plan.add(index, sub, value, row.reason)
        _overlay(node, index, sub, value)
    for (index, sub), value in node.keys.objects.items():
        own = plan.stored_value(index, sub) if (index, sub) in LIMITS else None
        narrowed = value if own is None else min(value, own)
        plan.add(index, sub, narrowed, f"objects of the hardware file{OWN if narrowed != value else ''}")
        _overlay(node, index, sub, narrowed)
    node.use_units()
    plan.problems += filter(None, [wrong_motor(node), unknown_scale(node), *_homing_offsets(plan, node)])
    narrow(node)
    if 0x60C2 in node.mirror and not takes_set_points(node.mirror):
        plan.add(0x60C2, 1, period // MILLISECOND, "period of targets, on which the drive interpolates")
        plan.add(0x60C2, 2, -3, "in milliseconds")
    for index in cia402.OFFSETS:
        if index in node.mirror and plan.peek(index):
            plan.add(index, 0, 0, "would be added to every target")
    _outputs(plan, node)
    _ramps(plan, node)
    _positions(plan, node)
    plan_heartbeat(plan, master)
    plan.problems += _goes_on_alone(plan, node)
    _process_data(plan, node)
    return plan


def _goes_on_alone(plan: WritePlan, node: Node) -> list[str]:
    """Return why a drive may keep its last target velocity when this program's heartbeat is missing.

    With a target position it stands at its last target.
    """
    profile, fault = node.profile, node.profile.faults.get(HEARTBEAT_LOST)
    if profile.masks and fault is not None:
        if (plan.planned_value(*FAULT_MASK) or 0) & fault.vendor:
            return []
        why = f"2321h.2 has not the bit {fault.vendor:X}h, so that a lost heartbeat is only told"
    elif ABORT_OPTION not in node.mirror:
        why = "has no 6007h Abort connection option code"
    elif plan.planned_value(ABORT_OPTION) == NO_ACTION:
        why = "6007h Abort connection option code is 0"
    else:
        return []
    if node.keys.follow.mode == "csp":
        return []
    text = "in csv and pv it may go on when this program dies. Correct it, or add `follow: {mode: csp}`, with which it stands"
    return [f"{node.name}: {why}: {text} at its last target."]


def _own_limits(plan: WritePlan, node: Node) -> None:
    """Store the drive's limits in its units, as read."""
    node.own.values.clear()
    stored = {
        address: value
        for address in (*LIMITS, *POSITION_LIMITS)
        if node.mirror.find(*address) and (value := plan.peek(*address)) is not None
    }
    for address, kind in LIMITS.items():
        if kind and stored.get(address, 0) > 0:
            node.own.values[address] = stored[address] * getattr(node.units, kind)
    low, high = (stored.get(address) for address in POSITION_LIMITS)
    none = low is None or high is None or low >= high
    node.own.positions = None if none else (low, high)  # type: ignore[assignment]


def _homing_offsets(plan: WritePlan, node: Node) -> list[str]:
    """Return why positions after homing would differ from the hardware file's."""
    if node.keys.homing is None:
        return []
    return [
        f"{node.name}: {index:04X}h is {value}, so that the drive does not count 0 at its reference as `homing.at` expects. "
        f"Set it to 0: twin hil set {node.number} {index:04X}h '0 raw'."
        for index in HOMING_OFFSETS
        if index in node.mirror and (index, 0) not in node.keys.objects and (value := plan.peek(index))
    ]


def _overlay(node: Node, index: int, sub: int, value: int) -> None:
    """Make the units follow from the planned value."""
    if node.mirror.find(index, sub):
        node.mirror.values[index, sub] = value


def _outputs(plan: WritePlan, node: Node) -> None:
    """Digital outputs at their safe levels; then the mask enables the bits."""
    if cia402.OUTPUTS not in node.mirror:
        return
    if node.keys.safe_outputs is not None:
        plan.add(cia402.OUTPUTS, cia402.LEVELS, node.keys.safe_outputs, "safe_outputs, also after the run")
    if node.keys.outputs and cia402.MASK in node.mirror.objects[cia402.OUTPUTS]:
        mask = (plan.stored_value(cia402.OUTPUTS, cia402.MASK) or 0) | sum(1 << bit for bit in node.keys.outputs)
        plan.add(cia402.OUTPUTS, cia402.MASK, mask, "outputs that follow signals, also after the run")


def _ramps(plan: WritePlan, node: Node) -> None:
    """Accelerations, the largest speeds and the following error, in the drive's units."""
    given, limits, own, units = node.own.file, node.keys.limits, node.own, node.units
    scale = node.keys.scale

    def counted(value: float, unit: float, address: Address | None = None) -> int:
        """A limit of the member in the drive's units: rounded up, but not beyond the drive's own."""
        rounded = ceil(value / (scale * unit) * EXACT)
        return rounded if address not in own.values else min(rounded, round(own.values[address] / unit))

    countable = {"velocity": units.velocity, "following_error": units.position, "acceleration": units.acceleration}
    plan.problems += [
        f"{node.name}: limits.{key} is {getattr(given, key):.3g}, less than one unit of the drive, {scale * unit:.3g} (SI). Raise it."
        for key, unit in countable.items()
        if getattr(given, key) < scale * unit
    ]
    narrower = {key: OWN if getattr(limits, key) < getattr(given, key) else "" for key in NARROWED}
    for index in ACCELERATIONS:
        value = counted(limits.acceleration, units.acceleration)
        plan.add_if_present(index, value, f"limits.acceleration{narrower['acceleration']}")
    for index in (*SPEED_LIMITS, PROFILE_VELOCITY):
        value = counted(limits.velocity, units.velocity, (index, 0))
        plan.add_if_present(index, value, f"limits.velocity{narrower['velocity']}")
    value = counted(limits.following_error, units.position, (FOLLOWING_ERROR, 0))
    plan.add_if_present(FOLLOWING_ERROR, value, f"limits.following_error{narrower['following_error']}")


def _positions(plan: WritePlan, node: Node) -> None:
    """Objects that are written after homing: methods and speeds of homing, software limits, mode."""
    keys, homing = node.keys, node.keys.homing
    if homing is not None and 0x6098 in node.mirror:
        speed = round(homing.speed / (keys.scale * node.units.velocity))
        if speed < 1:
            plan.problems.append(
                f"{node.name}: homing.speed {node.format_length(homing.speed)}/s is less than the drive can count, "
                f"{node.format_length(keys.scale * node.units.velocity)}/s. Raise it."
            )
        speed = max(speed, 1)
        plan.add(0x6098, 0, homing.method, "homing.method", later=True)
        for sub, value in ((1, speed), (2, max(speed // 2, 1))):
            if node.mirror.find(0x6099, sub):
                plan.add(0x6099, sub, value, "homing.speed", later=True)
        for limit in lowered_for_homing(node, plan.planned_value):
            plan.add(limit.index, limit.sub, limit.value, HOMING_FORCE_REASON, later=True)
    if 0x607D in node.mirror.objects:
        here = plan.peek(0x6064) or 0
        low, high = sorted(bound / (node.sign * node.units.position) for bound in keys.limits.position)
        zero = here if homing is None else homing.at / (-node.sign * node.units.position)
        margin = 0.1 * (high - low)
        ends = [round(low - margin + zero), round(high + margin + zero)]
        own = node.own.positions
        bounded = ends if own is None else [max(ends[0], own[0]), min(ends[1], own[1])]
        begin = "from where the scenario begins" if homing is None else "after homing"
        for sub, value, wide in zip((1, 2), bounded, ends, strict=True):
            plan.add(
                0x607D,
                sub,
                value,
                f"limits.position and a tenth of its range, {begin}{OWN if value != wide else ''}",
                later=True,
            )
    if MODE in node.mirror.objects:
        plan.stored_value(MODE)  # recorded also where it is in this mode: process data may command another one later
        plan.writes.append(PlannedWrite(MODE, 0, int(node.own_mode), "mode of operation, by process data", later=True))


def plan_heartbeat(plan: WritePlan, master: int) -> None:
    """Heartbeat in both directions: the node sends one, and stops when this program's is missing."""
    times = plan.node.keys.heartbeat
    if CONSUMER in plan.node.mirror:
        sub = plan.node.consumer_entry = _consumer_entry(plan, master)
        watch = master << 16 | times.lost_after // MILLISECOND
        if plan.planned_value(CONSUMER, sub) != watch:  # an entry that is in use may not be changed
            plan.add(CONSUMER, sub, 0, "heartbeat.lost_after")
        plan.add(CONSUMER, sub, watch, "heartbeat.lost_after")
    if 0x1017 in plan.node.mirror:
        plan.add(0x1017, 0, times.every // MILLISECOND, "heartbeat.every")


def _consumer_entry(plan: WritePlan, master: int) -> int:
    """Subindex of 1016h for this program: the entry that watches it already, else a free one. None of them is a problem.

    Another node that the drive watches may be a safety controller: its entry is not overwritten.
    """
    node = plan.node
    entries = {sub: plan.peek(CONSUMER, sub) for sub in sorted(node.mirror.objects[CONSUMER]) if sub}
    watched = {
        sub: (value >> 16 & 0xFF, value & 0xFFFF) for sub, value in entries.items() if value is not None
    }  # node-ID and time [ms]
    free = [sub for sub, (number, time) in watched.items() if not time or number not in range(1, 128)]
    own = [sub for sub, (number, _) in watched.items() if number == master]
    if watched and not own + free:
        text = ", ".join(f"1016h.{sub} watches node {number} ({time} ms)" for sub, (number, time) in watched.items())
        plan.problems.append(
            f"{node.name}: 1016h has no free entry for this program's heartbeat (node {master}): {text}. Clear one that "
            f"nothing needs: twin hil set {node.number} 1016h.{min(watched)} 0."
        )
    return (own + free + [min(entries, default=1)])[0]


def _process_data(plan: WritePlan, node: Node) -> None:
    """Remap four PDOs in each direction: one controlword in all, everything at SYNC, the others off."""
    # set-points act when they come, and their acknowledge is told when it changes
    waits = takes_set_points(node.mirror)
    kinds = (1, 1, 255 if waits else 1, 1)
    data = node.process_data
    for number_ in PDOS:
        for start, base, words, kind in (
            (0x1400, 0x200, data.receive[number_], 255 if waits else 1),
            (0x1800, 0x180, data.transmit[number_], kinds[number_]),
        ):
            if start + number_ in node.mirror and start + number_ + 0x200 in node.mirror:
                plan_pdo(plan, start + number_, base + 0x100 * number_ + node.number, words, kind)
    disable_receive_pdos(plan, 0x1400 + len(PDOS))


def disable_receive_pdos(plan: WritePlan, first: int) -> None:
    """Disable the RPDOs from index `first` on, whatever their COB-IDs: another master could command the node by them, unseen.

    The node is asked: it may have more than its profile.
    """
    for index in range(first, 0x1600):
        if (identifier := plan.peek(index, 1)) is None:
            return
        plan.add(index, 1, identifier | cia301.INVALID, "not used by the run: another master could command it")


def plan_pdo(plan: WritePlan, index: int, identifier: int, words: tuple[int, ...], kind: int) -> None:
    """Disable a PDO, remap it, and enable it again if it carries anything."""
    communication = plan.node.mirror.objects[index].get(1)
    if communication is None or not communication.writable:
        return
    reason = "process data of the run" if words else "not used by the run: the controlword comes once"
    flags = (plan.stored_value(index, 1) or 0) & 0x40000000
    plan.add(index, 1, cia301.INVALID | flags | identifier, reason)
    if not words:
        return
    plan.add(index, 2, kind, reason)
    plan.add(index + 0x200, 0, 0, reason)
    for address, word in enumerate(words, 1):
        plan.add(index + 0x200, address, word, reason)
    plan.add(index + 0x200, 0, len(words), reason)
    plan.add(index, 1, flags | identifier, reason)
