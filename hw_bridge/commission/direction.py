"""Check that the encoder counts in the motor's direction: a push with little current, both ways, a few micrometers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import Mode
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.commission.sdo_session import SdoSession
    from hw_bridge.commission.single_axis_session import SingleAxisSession
    from hw_bridge.master import Node
    from hw_bridge.profiles import Profile

STEPS = 8  # increments of the sensor that are a motion and no noise
GROWTH = 1_000 * MILLISECOND  # in which the push grows to its limit [ns]
REST = 300 * MILLISECOND  # without a push, until it stands [ns]
FASTEST = 0.25  # of limits.velocity: faster is running away


@dataclass(frozen=True)
class Push:
    """A push in one direction: the force at which it moved [N or N*m], how far until the push ended, and in all [m or rad]."""

    direction: int
    force: float
    moved: float
    farthest: float = 0.0

    @property
    def agrees(self) -> bool:
        """Whether the counted motion has the direction of the push."""
        return self.moved * self.direction > 0.0


def pushes(session: SingleAxisSession, force: float) -> list[Push]:
    """Push to positive, then to negative positions until each moved a little; without motion `moved` is 0."""
    node = session.node
    enough = STEPS * node.profile.motor.resolution * node.keys.scale
    results = []
    for direction in (1, -1):
        begin, start, applied = node.position, session.network.now, 0.0
        while abs(node.position - begin) < enough and applied < force:
            applied = force * min((session.network.now - start) / GROWTH, 1.0)
            session.push(direction * applied)
            if abs(node.velocity) > FASTEST * node.keys.limits.velocity:
                raise SimulationError(
                    f"{node.name}: runs away at {node.format_length(node.velocity)}/s from a push. It stops."
                )
        moved = farthest = node.position - begin
        end = session.network.now + REST
        while session.network.now < end:
            session.push(0.0)
            farthest = max(farthest, node.position - begin, key=abs)
        results.append(Push(direction, applied, moved if abs(moved) >= enough else 0.0, farthest))
    return results


def measure_manual_motion(sdo_session: SdoSession, node: Node, enough: float, timeout: int) -> float:
    """Wait for manual motion with the power off; return it as the member counts [m or rad], 0 after `timeout` [ns]."""
    begin, end = _position(node), sdo_session.network.now + timeout
    while sdo_session.network.now < end:
        sdo_session.wait(50 * MILLISECOND)
        if abs(moved := _position(node) - begin) > enough:
            return moved
    return 0.0


def _position(node: Node) -> float:
    counted = int.from_bytes(node.sdo.read(0x6064), "little", signed=True)
    return node.sign * node.units.position * counted


def can_push(profile: Profile) -> bool:
    """Whether the drive has cst, so that pushing needs no closed loop of the right sign."""
    return Mode.CST in profile.modes
