"""Detect drives that are enabled or moving, before anything is written to them.

A run refuses them. A set-up begins by writing 6040h = 0, which removes the current: a moving axis coasts, a vertical
one falls. Braking first needs parameters that are not this program's: `twin hil disable` does it on the operator's command.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import State, state_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hw_bridge.master.node import Node
    from hw_bridge.master.station import Waiting

ACTIVE = (State.ENABLED, State.QUICK_STOP, State.REACTION)  # states with current that holds or brakes
INTERVAL = 50 * MILLISECOND  # between two looks at a position [ns]
NOISE = 4  # increments of the sensor in this time that are no motion


def active_drives(nodes: Iterable[Node], wait: Waiting) -> list[str]:
    """Return a line for each drive that is enabled, brakes or moves. Only reads."""
    before = [(node, state_of(node.sdo.number(0x6041) & 0xFFFF), _position(node)) for node in nodes]
    wait(INTERVAL)
    return [text for node, state, position in before if (text := _activity(node, state, position))]


def _position(node: Node) -> int:
    return int.from_bytes(node.sdo.read(0x6064), "little", signed=True)


def _activity(node: Node, state: State, before: int) -> str:
    distance = abs(node.sign * node.units.position * (_position(node) - before))
    moves = distance > NOISE * node.profile.motor.resolution * node.keys.scale
    speed = f"{node.format_length(distance * 1e9 / INTERVAL)}/s"
    if state in ACTIVE:
        motion = f" and moves at {speed}" if moves else ""
        return (
            f"{node.name}: is in {state}{motion}: another program drives it, or left it so. Nothing was written. "
            f"End that program; `twin hil disable {node.number}` brings it to rest with its ramp."
        )
    if moves:
        return (
            f"{node.name}: moves at {speed} although it has no power ({state}). Nothing was written. "
            f"Does its axis fall, or does somebody push it? Secure it: brake, counterweight."
        )
    return ""
