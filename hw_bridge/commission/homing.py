"""Description of a hardware file's homing method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import object_texts
from hw_bridge.hardware import format_quantity, motor_data
from hw_bridge.master import HOMING_FORCE_SHARE, Reference

if TYPE_CHECKING:
    from hw_bridge.commission.axes import Axis
    from hw_bridge.hardware import HardwareKeys

NO_HOMING = (
    "has no `homing` in the hardware file. Add it, such as homing: {method: -3, at: POSITION, speed: 20 mm/s}, with the position "
    "of its mechanical stop."
)


def explained(axis: Axis, hardware: HardwareKeys) -> tuple[list[str], str]:
    """Describe the homing sequence step by step, with the motion after it; then its limits, in a sentence."""
    keys, to_text = axis.keys, axis.format_quantity
    own = keys.homing
    assert own is not None
    steps = object_texts.homing(keys.drive.homing[own.method])
    end = Reference(hardware, axis.name, axis.rotary).resting_position()
    if end != own.at:
        steps.append(f"by {to_text(end - own.at)} to {to_text(end)} from reference, at {to_text(own.speed, '/s')}")
    force, newton = HOMING_FORCE_SHARE * keys.limits.force, "N*m" if axis.rotary else "N"
    current = force / motor_data.force_constant_of(keys)
    bound = (
        f"torque limit {format_quantity(force, newton)} ({current:.2f} A), {100 * HOMING_FORCE_SHARE:.0f} % of limits.force"
        if keys.drive.homing_force
        else "the drive has no torque limit for it: this program stops it above limits.force"
    )
    return steps, (
        f"Fast is {to_text(own.speed, '/s')}, slowly {to_text(own.speed / 2, '/s')}; {bound}; "
        f"timeout {own.timeout / 1e9:g} s."
    )
