"""What members tell their drives, and what a drive can follow."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Collection

    from hw_bridge.hardware import LimitKeys, NodeKeys
    from hw_bridge.master import Node
    from hw_bridge.profiles import Profile
    from twin.component import Component
    from twin.scenario import Case

CYCLIC = {8: Mode.CSP, 9: Mode.CSV, 10: Mode.CST}
FORCE, TORQUE = "target_force", "target_torque"  # of a rod; of a motor, before its gear
SHARE = 0.8  # of the limits of velocity and force that a target may ask for: the drive overshoots


def unknown_mode(wanted: int, profile: Profile, member: Collection[str]) -> str:
    """Why a mode of operation cannot be followed, or nothing. `member`: names of the member's variables."""
    if wanted not in CYCLIC:
        return f"mode_of_operation {wanted}: no cyclic mode. Use 8 (csp), 9 (csv) or 10 (cst)."
    if CYCLIC[wanted] is not Mode.CST:
        return ""
    if FORCE not in member and TORQUE not in member:
        return f"mode_of_operation 10: cst needs a member with {FORCE} or {TORQUE}. Use 8 (csp) or 9 (csv)."
    if Mode.CST not in profile.modes:
        return f"mode_of_operation 10: {profile.title} has no cst. Use 8 (csp) or 9 (csv), or a drive that has it."
    return ""


def unfollowed(node: NodeKeys, member: type[Component], told: object) -> str:
    """What of `follow` has nothing to follow, or nothing. `told`: the mode in which the scenario lets the member begin."""
    mode = told
    if not isinstance(mode, int):
        mode = next((variable.start for variable in member.variables if variable.name == "mode_of_operation"), Mode.CSV)
    if node.follow.mode is not None and mode == Mode.CST:
        return "the member is told forces, which cst follows. Leave it out."
    if node.follow.mode != "csp" and node.follow.feedforward and mode == Mode.CSV:
        return "feedforward: the member is told speeds, which csv has no offset for. Add `mode: csp`, or leave it out."
    return ""


def told_force(name: str, case: Case, connected: Collection[str]) -> bool:
    """Whether a case tells a member a force, at whatever time: then its process data have room for one.

    `connected`: the inputs that the case connects.
    """
    targets = {f"{name}.{FORCE}", f"{name}.{TORQUE}"}
    return (
        not {FORCE, TORQUE}.isdisjoint(case.members[name].parameters)
        or not targets.isdisjoint(connected)
        or any(event.variable in targets for event in case.events)
    )


def position(node: Node, axis: Component) -> float:
    """Target position of a member [m or rad]; one that the drive could only jump to ends the run."""
    target = finite(node.name, axis, "target_position")
    if (jump := abs(target - node.position)) > node.keys.limits.following_error:
        raise SimulationError(
            f"{node.name}: target_position {node.format_length(target)} is {node.format_length(jump)} from where the drive is, a jump. "
            f"All drives stop."
        )
    return target


def velocity(name: str, axis: Component, limits: LimitKeys) -> float:
    """Target velocity of a member, within its limit [m/s or rad/s]."""
    return within(finite(name, axis, "target_velocity"), limits.velocity)


def force(name: str, axis: Component, limits: LimitKeys, scale: float) -> float:
    """Target force of a member, within its limit [N or N*m]. `scale`: way of the member for one of the motor."""
    wanted = finite(name, axis, FORCE) if FORCE in axis.views else finite(name, axis, TORQUE) / scale
    return within(wanted, limits.force)


def finite(name: str, axis: Component, target: str) -> float:
    """A target of a member as it is; an infinite one is a mistake of whoever gives it, not a wish for the limit."""
    value = float(axis.views[target])
    if not isfinite(value):
        raise SimulationError(f"{name}: {target} is {value}, no number that a drive can follow. All drives stop.")
    return value


def within(value: float, limit: float) -> float:
    """A target that leaves the drive room to overshoot."""
    return min(max(value, -SHARE * limit), SHARE * limit)
