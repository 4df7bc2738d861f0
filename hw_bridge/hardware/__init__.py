"""The hardware file: its keys, and every problem of it as a line."""

from hw_bridge.hardware import late, plausible
from hw_bridge.hardware.events import planned
from hw_bridge.hardware.file import load, overloaded
from hw_bridge.hardware.keys import (
    ContactKeys,
    FaultKeys,
    FollowKeys,
    HardwareKeys,
    LateKeys,
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
    "LateKeys",
    "LimitKeys",
    "ModuleKeys",
    "NodeKeys",
    "ShadowKeys",
    "UnitKeys",
    "late",
    "load",
    "overloaded",
    "planned",
    "plausible",
    "without_unit",
]
