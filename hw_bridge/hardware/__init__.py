"""The hardware file: its keys, and a line for every problem."""

from hw_bridge.hardware import motor_data, plausible, stall_bounds
from hw_bridge.hardware.contradictions import gain_problem
from hw_bridge.hardware.events import planned
from hw_bridge.hardware.file import load, overloaded, resolve_bench
from hw_bridge.hardware.homing_checks import homing_conflict, search_direction
from hw_bridge.hardware.keys import (
    ContactKeys,
    FaultKeys,
    FollowKeys,
    HardwareKeys,
    LateCycleKeys,
    LimitKeys,
    ModuleKeys,
    NodeKeys,
    ShadowKeys,
    UnitKeys,
)
from hw_bridge.hardware.quantities import TARGET_SHARE, format_quantity, without_unit

__all__ = [
    "TARGET_SHARE",
    "ContactKeys",
    "FaultKeys",
    "FollowKeys",
    "HardwareKeys",
    "LateCycleKeys",
    "LimitKeys",
    "ModuleKeys",
    "NodeKeys",
    "ShadowKeys",
    "UnitKeys",
    "format_quantity",
    "gain_problem",
    "homing_conflict",
    "load",
    "motor_data",
    "overloaded",
    "planned",
    "plausible",
    "resolve_bench",
    "search_direction",
    "stall_bounds",
    "without_unit",
]
