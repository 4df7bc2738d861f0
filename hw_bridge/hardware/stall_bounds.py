"""Bounds on the effect of a late cycle, and of a program that dies: time, displacement and force."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING

from hw_bridge.hardware import motor_data

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.hardware.keys import HardwareKeys, NodeKeys


def at_most(keys: HardwareKeys) -> int:
    """Largest tolerated lateness of a cycle [ns]: from the file, or until the first drive stops by itself."""
    silence = min(station.heartbeat.lost_after for _, _, station in keys.stations())
    return silence if keys.late_cycle.at_most is None else keys.late_cycle.at_most


def tolerated_lateness(keys: HardwareKeys) -> int:
    """Lateness of a cycle that does not end the run [ns]."""
    return keys.cycle if keys.late_cycle.policy == "stop" else max(at_most(keys), keys.cycle)


def max_displacement(keys: HardwareKeys, node: NodeKeys) -> tuple[float, float]:
    """Largest displacement of a drive [m or rad] without this program: in a late cycle; until it stands by itself.

    At its limit of velocity, in csv, the mode that continues. In csp it stands after the cycle of its last target.
    """
    limits, holds = node.limits, node.follow.mode == "csp"
    stalled = keys.cycle if holds else tolerated_lateness(keys)
    alone = keys.cycle if holds else node.heartbeat.lost_after
    return limits.velocity * stalled / 1e9, limits.velocity * (
        alone / 1e9 + 0.5 * limits.velocity / limits.acceleration
    )


def bounds(keys: HardwareKeys, rotary: Mapping[str, bool]) -> list[str]:
    """Format a line for each drive. `rotary`: which members turn."""
    return [_line(keys, name, node, rotary[name]) for name, node in keys.nodes.items()]


def _line(keys: HardwareKeys, name: str, node: NodeKeys, rotary: bool) -> str:
    stalled, alone = max_displacement(keys, node)
    newton, stiffness, pressed, peak = "N m" if rotary else "N", keys.late_cycle.stiffness, "", motor_data.peak(node)
    if stiffness is not None and not rotary:
        more, most = (min(displacement * stiffness, peak) for displacement in (stalled, alone))
        pressed = f", {more:.3g} N and {most:.3g} N more against {stiffness:g} N/m"
    return (
        f"{name}: late_cycle {keys.late_cycle.policy}, up to {tolerated_lateness(keys) / 1e6:g} ms: at "
        f"{_format_length(node.limits.velocity, rotary)}/s at most {_format_length(stalled, rotary)}; a program that dies: "
        f"{_format_length(alone, rotary)} until it misses the heartbeat and stands{pressed}. Above "
        f"{node.limits.force:g} {newton} "
        f"this program stops it; without it the drive's current limit does, {peak:.3g} {newton} as its profile has it."
    )


def _format_length(value: float, rotary: bool) -> str:
    """Format a displacement."""
    return f"{degrees(value):.4g} deg" if rotary else f"{1e3 * value:.4g} mm"
