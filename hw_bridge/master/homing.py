"""Homing for a run and for `twin hil home`: refused where it contradicts the limits, stopped where it violates one.

The drive searches by itself (mode 6, CiA 402). Until it ends no position is known: force, velocity, direction, distance and
time are monitored. Before it begins, the drive's own force limit is lowered where it has one.
"""

from __future__ import annotations

from math import copysign
from typing import TYPE_CHECKING

from hw_bridge.dictionary import HomingEvent, Mode, State, cia402
from hw_bridge.hardware import homing_conflict, search_direction
from hw_bridge.master import setup
from hw_bridge.master.limits import HOMING_FORCE_REASON, LoweredLimit, lowered_for_homing
from hw_bridge.master.node import AT_REST
from hw_bridge.master.reference import Reference
from hw_bridge.master.sdo import SdoError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.master.master import Master
    from hw_bridge.master.node import Node

ROOM = 1.1  # of the way between the limits: a search that goes farther has passed one
SETTLE = 200_000_000  # after an approach [ns]
RAMP_UP = 2_000_000_000  # longest time to Operation enabled, and back [ns]


def problem(node: Node, start: float) -> str:
    """Return why a drive cannot be homed or moved to its start position [m or rad] afterwards, or an empty string."""
    if node.keys.homing is None:
        return ""
    low, high = node.keys.limits.position
    if not low <= start <= high:
        return (
            f"{node.name}: begins at {node.format_length(start)}, outside of limits.position, "
            f"{node.format_length(low)} to {node.format_length(high)}."
        )
    conflict = homing_conflict(node.keys, node.format_length)
    return conflict and f"{node.name}: homing: {conflict}"


def find_reference(master: Master, node: Node) -> None:
    """Restore the drive's reference where it is proven valid, else home the drive."""
    if keep_reference(master, node):
        master.references.append(f"{node.name}: counts from the reference found before: not homed again.")
    else:
        Homing(master, node).carry_out()
    node.has_reference = True


def keep_reference(master: Master, node: Node) -> bool:
    """Use the reference that an earlier run or `twin hil home` determined, where it is proven; False: home the drive.

    A drive that stands outside its limits of position is homed too: its own software limits would pull it in with a jump.
    """
    homing = node.keys.homing
    assert homing is not None
    reference = Reference(master.keys, node.name, node.rotary)
    position = node.position + node.origin + homing.at
    low, high = node.keys.limits.position
    if reference.problem(node) or not low <= position <= high:
        return False
    reference.forget()
    node.origin = -homing.at
    node.entered_from = node.position
    return True


def approach(master: Master, node: Node, position: float) -> None:
    """Move from the reference to the start position [m or rad] at the homing speed."""
    assert node.keys.homing is not None
    step = node.keys.homing.speed * master.cycle / 1e9
    node.mode = Mode.CSP
    while (left := position - node.target_position) != 0.0:
        node.target_position = position if abs(left) <= step else node.target_position + copysign(step, left)
        master.run_cycle()
        if text := master.check():
            raise SimulationError(text)
    for _ in range(SETTLE // master.cycle):
        master.run_cycle()
    node.entered_from = None


class Homing:
    """The search of one drive: `carry_out` once, with process data both ways."""

    def __init__(self, master: Master, node: Node) -> None:
        assert node.keys.homing is not None
        self.master, self.node, self.keys = master, node, node.keys.homing
        keys = self.keys
        self.title = f"{node.name}: homing by method {keys.method}"
        self.direction = search_direction(node.keys)
        # so far it may go the other way first: to the next index, or as play and ringing
        moves = node.profile.homing.get(keys.method, ())
        indexed = any(move.until is HomingEvent.INDEX for move in moves)
        self.max_backward = node.keys.limits.following_error + (
            node.profile.motor.index * node.keys.scale if indexed else 0.0
        )
        # one that may meet its switch at once has to leave it the other way
        self.strict = all(move.until in (HomingEvent.BLOCK, HomingEvent.INDEX) for move in moves)
        self.begin: float | None = None

    def carry_out(self) -> None:
        """Search, then assign `at` to the reference position; the drive is disabled afterwards."""
        node, keys, until = self.node, self.keys, self.master.run_until
        Reference(self.master.keys, node.name).forget()
        lowered = self._lower_force()
        setup.write(node, 0x6098, 0, keys.method)
        speed = round(keys.speed / (node.keys.scale * node.units.velocity))
        setup.write_if_present(node, 0x6099, 1, max(speed, 1))
        setup.write_if_present(node, 0x6099, 2, max(speed // 2, 1))
        node.homing, node.goal = True, State.ENABLED
        until(lambda: node.state is State.ENABLED, RAMP_UP, lambda: f"{self.title}: {node.state}", self.watch)
        cycles = iter(range(4))
        until(lambda: next(cycles, None) is None, RAMP_UP, lambda: self.title, self.watch)
        until(self._done, keys.timeout, lambda: f"{self.title} did not end", self.watch)
        node.homing, node.goal = False, State.DISABLED
        until(lambda: node.state in AT_REST, RAMP_UP, lambda: node.name)
        for limit in lowered:
            setup.write(node, limit.index, limit.sub, limit.before)
        node.origin = -keys.at
        node.entered_from = keys.at

    def _lower_force(self) -> list[LoweredLimit]:
        """Bound the drive's own force by the limit, where it may be larger."""
        lowered = list(lowered_for_homing(self.node, self._read))
        for limit in lowered:
            setup.write(self.node, limit.index, limit.sub, limit.value, HOMING_FORCE_REASON)
        return lowered

    def _read(self, index: int, sub: int) -> int | None:
        try:
            return setup.read(self.node, index, sub)
        except SdoError:
            return None

    def _done(self) -> bool:
        node, attained = self.node, cia402.BIT_12 | cia402.TARGET_REACHED
        if node.state is not State.ENABLED:
            raise SimulationError(f"{self.title} was left: {node.state}.{self.master.emergencies()}")
        if node.word & cia402.BIT_13:
            raise SimulationError(f"{self.title} ended with an error.{self.master.emergencies()}")
        return node.word & attained == attained

    def watch(self) -> None:
        """Raise SimulationError where the search violates the hardware file. Called every cycle."""
        node, limits = self.node, self.node.keys.limits
        newton = "N m" if node.rotary else "N"
        if abs(node.force) > limits.force:
            raise SimulationError(
                f"{self.title}: force {node.force:.2f} {newton} is above {limits.force:g} {newton}. Is it blocked? "
                f"Lower the drive's own torque limit for homing, or check limits.force."
            )
        if abs(node.velocity) > limits.velocity:
            raise SimulationError(
                f"{self.title}: velocity {node.format_length(node.velocity)}/s is above {node.format_length(limits.velocity)}/s."
            )
        if node.state is not State.ENABLED or node.word & cia402.BIT_12:  # afterwards the drive counts anew
            return
        if self.begin is None:
            self.begin = node.position
        gone, room = node.position - self.begin, limits.position[1] - limits.position[0]
        if self.strict and self.direction and -gone * self.direction > self.max_backward:
            ends = ("positive", "negative")
            raise SimulationError(
                f"{self.title} goes to the {ends[self.direction > 0]} end instead of the {ends[self.direction < 0]} "
                "one. It is not taken "
                f"for {node.format_length(self.keys.at)}. Correct method, `at` or `inverted`."
            )
        if abs(gone) > ROOM * room:
            raise SimulationError(
                f"{node.name}: homing went {node.format_length(abs(gone))} and found nothing; the limits are "
                f"{node.format_length(room)} apart. If the stroke is longer than the limits, move it away from the far end "
                f"first (twin hil jog {node.name}). Else check switches, method and direction."
            )
