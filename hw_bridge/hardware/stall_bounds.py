"""Bounds on the effect of a late cycle, and of a program that dies: time, displacement and force."""

from __future__ import annotations

from math import degrees, isfinite
from typing import TYPE_CHECKING

from hw_bridge.hardware import motor_data
from hw_bridge.hardware.quantities import format_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.dictionary import Dictionary
    from hw_bridge.hardware.keys import HardwareKeys, NodeKeys

SILENT_CYCLES = 5  # so many cycles without process data are the end of a drive
# cycles that actual values may be old when the next targets follow from them; one is the least, and 5 without any end a run
MAX_AGE_CYCLES = 4.25


def at_most(keys: HardwareKeys) -> int:
    """Largest tolerated lateness of a cycle [ns]: from the file, or until the first drive stops by itself."""
    silence = min(station.heartbeat.lost_after for _, _, station in keys.stations())
    return silence if keys.late_cycle.at_most is None else keys.late_cycle.at_most


def tolerated_lateness(keys: HardwareKeys) -> int:
    """Lateness of a cycle that does not end the run [ns]."""
    return keys.cycle if keys.late_cycle.policy == "stop" else max(at_most(keys), keys.cycle)


def missed_cycles(keys: HardwareKeys) -> int:
    """Cycles without process data that end a run: a drive, or its transmission path, may be as late as this program."""
    return max(SILENT_CYCLES, (keys.late_cycle.at_most or 0) // keys.cycle)


def value_age(keys: HardwareKeys) -> int:
    """Largest age of actual values at SYNC [ns] where the file gives none; this program's own lateness is not counted."""
    return max(round(MAX_AGE_CYCLES * keys.cycle), keys.late_cycle.at_most or 0)


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


def bounds(
    keys: HardwareKeys, rotary: Mapping[str, bool], objects: Mapping[str, Dictionary] | None = None
) -> list[str]:
    """Format a line for each drive. `rotary`: which members turn. `objects`: those read from each drive, if any were."""
    read = objects or {}
    return [bound(keys, name, node, rotary[name], read.get(name)) for name, node in keys.nodes.items()]


def bound(keys: HardwareKeys, name: str, node: NodeKeys, rotary: bool, objects: Dictionary | None) -> str:
    """Format the line of one drive."""
    stalled, alone = max_displacement(keys, node)
    newton, stiffness, pressed = "N m" if rotary else "N", keys.late_cycle.stiffness, ""
    peak, lateness = motor_data.drive_force(node, objects), tolerated_lateness(keys)
    age, source = (
        node.limits.actual_value_age or value_age(keys),
        "its profile has it" if objects is None else "it is set",
    )
    if stiffness is not None and not rotary:
        more, most = (min(displacement * stiffness, peak) for displacement in (stalled, alone))
        pressed = f", {more:.3g} N and {most:.3g} N more against {stiffness:g} N/m"
    return (
        f"{name}: late_cycle {keys.late_cycle.policy}, up to {lateness / 1e6:g} ms: at "
        f"{_format_length(node.limits.velocity, rotary)}/s at most {_format_length(stalled, rotary)}; a program that dies: "
        f"{_format_length(alone, rotary)} until it misses the heartbeat and stands{pressed}. Above "
        f"{node.limits.force:g} {newton} "
        + (
            f"this program stops it; without it the drive's current limit does, {format_quantity(peak, newton)} as {source}."
            if isfinite(peak)
            else "this program stops it, and no object of the drive states a limit of the current."
        )
        + (
            f" Apart from that, actual values that are more than {age / 1e6:.4g} ms old at SYNC end the run "
            "(limits.actual_value_age)."
            if age < lateness
            else ""
        )
    )


def _format_length(value: float, rotary: bool) -> str:
    """Format a displacement."""
    return f"{degrees(value):.4g} deg" if rotary else f"{1e3 * value:.4g} mm"
