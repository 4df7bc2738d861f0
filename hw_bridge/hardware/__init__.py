"""The hardware file: its keys, and a line for every problem."""

from hw_bridge.hardware import plausible, stall_bounds
from hw_bridge.hardware.events import planned
from hw_bridge.hardware.file import load, overloaded
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
from hw_bridge.hardware.quantities import without_unit

__all__ = [
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
    "load",
    "overloaded",
    "planned",
    "plausible",
    "stall_bounds",
    "without_unit",
]
