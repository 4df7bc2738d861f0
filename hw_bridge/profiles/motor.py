"""The motor of a simulated drive, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from twin.component import catalog

# what a component with this load calls its target in cst, and the force or torque of one ampere
EFFORT = {"load_force": ("target_force", "force_constant"), "load_torque": ("target_torque", "torque_constant")}


def member_load(views: Mapping[str, Any]) -> float | None:
    """Sum of the loads of a member [N or N*m], a piston's recoil among them; None if it has none."""
    loads = [float(views[name]) for name in (*EFFORT, "recoil_force") if name in views]
    return sum(loads) if loads else None


@dataclass(frozen=True)
class MotorModel:
    """A component with its parameters, and what it calls true position and load. `unit`: m or rad.

    `ratio`: turns of the motor for one of what the component's positions count, where a gear is in it.
    """

    component: str
    unit: str
    resolution: float  # one increment of its sensor [unit]
    index: float  # distance between index pulses [unit]
    parameters: Mapping[str, float] = field(default_factory=dict)
    position: str = "position"
    load: str = "load_force"
    ratio: float = 1.0

    @property
    def force_constant(self) -> float:
        """Force [N] or torque [N*m] of one ampere, before the gear."""
        name = EFFORT[self.load][1]
        declared = getattr(catalog.component(self.component), name)
        return float(self.parameters.get(name, declared.start))
