"""Does the encoder count the way the motor goes: a push of little current, both ways, a few micrometers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import Mode
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.commission.hand import Hand
    from hw_bridge.commission.line import Line
    from hw_bridge.master import Node
    from hw_bridge.profiles import Profile

STEPS = 8  # increments of the sensor that are a motion and no noise
GROWTH = 1_000 * MILLISECOND  # in which the push grows to its limit [ns]
REST = 300 * MILLISECOND  # without a push, until it stands [ns]
FASTEST = 0.25  # of limits.velocity: faster is running away


@dataclass(frozen=True)
class Push:
    """A push one way: the force at which it moved [N or N*m], and how far [m or rad]."""

    way: int
    force: float
    moved: float

    @property
    def agrees(self) -> bool:
        """Whether it is counted the way that it was pushed."""
        return self.moved * self.way > 0.0


def pushes(hand: Hand, force: float) -> list[Push]:
    """Push to positive, then to negative positions until each moved a little; without a motion the force is told."""
    node = hand.node
    enough = STEPS * node.profile.motor.resolution * node.keys.scale
    found = []
    for way in (1, -1):
        begin, start, asked = node.position, hand.network.now, 0.0
        while abs(node.position - begin) < enough and asked < force:
            asked = force * min((hand.network.now - start) / GROWTH, 1.0)
            hand.push(way * asked)
            if abs(node.velocity) > FASTEST * node.keys.limits.velocity:
                raise SimulationError(
                    f"{node.name}: runs away at {node.format_length(node.velocity)}/s from a push. It stops."
                )
        moved = node.position - begin
        end = hand.network.now + REST
        while hand.network.now < end:
            hand.push(0.0)
        found.append(Push(way, asked, moved if abs(moved) >= enough else 0.0))
    return found


def by_hand(line: Line, node: Node, enough: float, patience: int) -> float:
    """How far somebody moved it with the power off, as the member counts [m or rad]; 0 if not within `patience` [ns]."""
    begin, end = _place(node), line.network.now + patience
    while line.network.now < end:
        line.wait(50 * MILLISECOND)
        if abs(moved := _place(node) - begin) > enough:
            return moved
    return 0.0


def _place(node: Node) -> float:
    counted = int.from_bytes(node.sdo.read(0x6064), "little", signed=True)
    return node.sign * node.units.position * counted


def can_push(profile: Profile) -> bool:
    """Whether the drive follows a force (cst), so that its loops need no right sign."""
    return Mode.CST in profile.modes
