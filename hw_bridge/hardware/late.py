"""What a late cycle, and a program that never comes back, can do at most: in time, way and force."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING

from hw_bridge.hardware import motor_data

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.hardware.keys import HardwareKeys, NodeKeys


def at_most(keys: HardwareKeys) -> int:
    """The latest cycle that is ridden through [ns]: as the file has it, or until the first drive stops by itself."""
    silence = min(station.heartbeat.lost_after for _, _, station in keys.stations())
    return silence if keys.late_cycle.at_most is None else keys.late_cycle.at_most


def ridden(keys: HardwareKeys) -> int:
    """How late a cycle may be without an end of the run [ns]."""
    return keys.cycle if keys.late_cycle.policy == "stop" else max(at_most(keys), keys.cycle)


def way(keys: HardwareKeys, node: NodeKeys) -> tuple[float, float]:
    """How far a drive goes at most [m or rad] without this program: in a late cycle; until it stands by itself.

    At its limit of velocity, in the mode that goes on: csv. In csp it stands after the cycle that it was told last.
    """
    limits, holds = node.limits, node.follow.mode == "csp"
    late = keys.cycle if holds else ridden(keys)
    alone = keys.cycle if holds else node.heartbeat.lost_after
    return limits.velocity * late / 1e9, limits.velocity * (alone / 1e9 + 0.5 * limits.velocity / limits.acceleration)


def bounds(keys: HardwareKeys, rotary: Mapping[str, bool]) -> list[str]:
    """A line for each drive. `rotary`: which members turn."""
    return [_line(keys, name, node, rotary[name]) for name, node in keys.nodes.items()]


def _line(keys: HardwareKeys, name: str, node: NodeKeys, rotary: bool) -> str:
    late, alone = way(keys, node)
    newton, stiffness, pressed, peak = "N m" if rotary else "N", keys.late_cycle.stiffness, "", motor_data.peak(node)
    if stiffness is not None and not rotary:
        more, most = (min(one * stiffness, peak) for one in (late, alone))
        pressed = f", {more:.3g} N and {most:.3g} N more against {stiffness:g} N/m"
    return (
        f"{name}: late_cycle {keys.late_cycle.policy}, up to {ridden(keys) / 1e6:g} ms: at "
        f"{_told(node.limits.velocity, rotary)}/s at most {_told(late, rotary)}; a program that dies: "
        f"{_told(alone, rotary)} until it misses the heartbeat and stands{pressed}. Above {node.limits.force:g} {newton} "
        f"this program stops it; without it the drive's current limit does, {peak:.3g} {newton} as its profile has it."
    )


def _told(value: float, rotary: bool) -> str:
    """A way for people."""
    return f"{degrees(value):.4g} deg" if rotary else f"{1e3 * value:.4g} mm"
