"""Targets of members for their drives, and checks whether a drive can follow them."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode
from hw_bridge.hardware import TARGET_SHARE, gain_problem
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


def unknown_mode(wanted: int, profile: Profile, member: Collection[str]) -> str:
    """Return why a mode of operation cannot be followed, or an empty string. `member`: names of the member's variables."""
    if wanted not in CYCLIC:
        return f"mode_of_operation {wanted}: no cyclic mode. Use 8 (csp), 9 (csv) or 10 (cst)."
    if CYCLIC[wanted] is not Mode.CST:
        return ""
    if FORCE not in member and TORQUE not in member:
        return f"mode_of_operation 10: cst needs a member with {FORCE} or {TORQUE}. Use 8 (csp) or 9 (csv)."
    if Mode.CST not in profile.modes:
        return f"mode_of_operation 10: {profile.title} has no cst. Use 8 (csp) or 9 (csv), or a drive that has it."
    return ""


def tracking_problem(node: NodeKeys, member: type[Component], initial_mode: object, cycle: int) -> str:
    """Return which key of `follow` has no effect or is unstable at a cycle [ns], or an empty string. `initial_mode`: of the member in the scenario."""
    mode = initial_mode
    if not isinstance(mode, int):
        mode = next((variable.start for variable in member.variables if variable.name == "mode_of_operation"), Mode.CSV)
    if node.follow.mode is not None and mode == Mode.CST:
        return "the member is told forces, which cst follows. Leave it out."
    if node.follow.mode != "csp" and node.follow.feedforward and mode == Mode.CSV:
        return "feedforward: the member is told speeds, which csv has no offset for. Add `mode: csp`, or leave it out."
    if node.follow.mode == "csv" and mode == Mode.CSP and (problem := gain_problem(node.follow.gain, cycle)):
        return f"gain: {problem}"
    return ""


def receives_target_force(name: str, case: Case, connected: Collection[str]) -> bool:
    """Whether a case sets a target force of a member at any time: then its process data include one.

    `connected`: the inputs that the case connects.
    """
    targets = {f"{name}.{FORCE}", f"{name}.{TORQUE}"}
    return (
        not {FORCE, TORQUE}.isdisjoint(case.members[name].parameters)
        or not targets.isdisjoint(connected)
        or any(event.variable in targets for event in case.actions)
    )


def position(node: Node, axis: Component) -> float:
    """Target position of a member [m or rad]; a jump ends the run."""
    target = finite_target(node.name, axis, "target_position")
    if (jump := abs(target - node.position)) > node.keys.limits.following_error:
        raise SimulationError(
            f"{node.name}: target_position {node.format_length(target)} is {node.format_length(jump)} from where the "
            "drive is, a jump. "
            f"All drives stop."
        )
    return target


def velocity(name: str, axis: Component, limits: LimitKeys) -> float:
    """Target velocity of a member, within its limit [m/s or rad/s]."""
    return clamp_target(finite_target(name, axis, "target_velocity"), limits.velocity)


def force(name: str, axis: Component, limits: LimitKeys, scale: float) -> float:
    """Target force of a member, within its limit [N or N*m]. `scale`: the member's displacement for one of the motor."""
    wanted = finite_target(name, axis, FORCE) if FORCE in axis.views else finite_target(name, axis, TORQUE) / scale
    return clamp_target(wanted, limits.force)


def finite_target(name: str, axis: Component, target: str) -> float:
    """Target of a member; an infinite one is an error, not a request for the limit."""
    value = float(axis.views[target])
    if not isfinite(value):
        raise SimulationError(f"{name}: {target} is {value}, no number that a drive can follow. All drives stop.")
    return value


def clamp_target(value: float, limit: float) -> float:
    """Clamp a target to a share of the limit, so that the drive has room to overshoot."""
    return min(max(value, -TARGET_SHARE * limit), TARGET_SHARE * limit)
