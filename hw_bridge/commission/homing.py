"""Homing by a person: the method in words, refused where it contradicts the limits, stopped where it goes too far."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import words
from hw_bridge.dictionary import Until, cia402
from hw_bridge.profiles import profile
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.commission.hand import Hand
    from hw_bridge.hardware import NodeKeys

ENDS = (Until.NEGATIVE, Until.POSITIVE, Until.BLOCK)  # of a rail
ROOM = 1.1  # of the way between the limits: a search that goes farther has passed one


def explained(keys: NodeKeys) -> list[str]:
    """What the drive will do, move by move."""
    assert keys.homing is not None
    return words.homing(profile(keys.profile).homing[keys.homing.method])


def refused(name: str, keys: NodeKeys, told: Callable[[float], str]) -> str:
    """Why homing would pass a limit, or nothing."""
    homing, limits = keys.homing, keys.limits
    if homing is None:
        return f"{name}: has no `homing` in the hardware file. Add it, such as homing: {{method: -3, at: -40 mm, speed: 20 mm/s}}."
    if homing.speed > limits.velocity:
        return (
            f"{name}: homing.speed {told(homing.speed)}/s is above limits.velocity {told(limits.velocity)}/s. Lower it."
        )
    searched = [one for one in profile(keys.profile).homing[homing.method] if one.until in ENDS]
    if not searched:
        return ""
    way = searched[0].direction * (-1 if keys.inverted else 1)  # of the member
    low, high = limits.position
    if (homing.at - 0.5 * (low + high)) * way < 0.0:
        ends = ("positive", "negative")
        return (
            f"{name}: method {homing.method} goes to the {ends[way < 0]} end, but `at` {told(homing.at)} is at the "
            f"{ends[way > 0]} end of {told(low)} to {told(high)}: it would run through the limits. Correct method, `at` or "
            f"`inverted`."
        )
    return ""


def watch(hand: Hand) -> Callable[[], None]:
    """Looks at every cycle of the search: SimulationError once it has gone farther than the limits are apart."""
    node = hand.node
    low, high = node.keys.limits.position
    begin: list[float] = []

    def look() -> None:
        if not node.homing or node.word & cia402.BIT_12:  # afterwards the drive counts anew
            return
        begin[:] = begin or [node.position]
        if abs(node.position - begin[0]) > ROOM * (high - low):
            raise SimulationError(
                f"{node.name}: homing went {node.way(abs(node.position - begin[0]))} and found nothing; the limits are "
                f"{node.way(high - low)} apart. Check switches, method and direction."
            )

    return look
