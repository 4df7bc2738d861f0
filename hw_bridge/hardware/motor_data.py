"""Plausibility of limits: a limit far beyond what the motor can reach is an error in the file."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Dictionary
from hw_bridge.profiles import EFFORT, motor_parameters
from twin.component import catalog

if TYPE_CHECKING:
    from hw_bridge.hardware.keys import NodeKeys
    from hw_bridge.profiles import MotorModel

ABSURD = 10.0  # so many times what the motor reaches: loads, supplies and gears differ, but not by that
USED = ("velocity_maximum", "supply_voltage", "current_maximum", *(name for _, name in EFFORT.values()))


def check(node: NodeKeys) -> list[tuple[tuple[str, ...], str]]:
    """Return every absurd limit of a file, with both numbers. The member's own motor is not known here."""
    if node.motor == "member":
        return []
    model = motor_parameters(node.drive, node.motor).model
    unit = "rad" if model.unit == "rad" else "m"
    newton = "N*m" if unit == "rad" else "N"
    limits = node.limits
    low, high = limits.position
    pairs = [
        ("velocity", limits.velocity, reached(model)["velocity"] * node.scale, f"{unit}/s", "the motor reaches"),
        ("force", limits.force, peak(node), newton, "the motor's peak current gives"),
    ]
    problems: list[tuple[tuple[str, ...], str]] = [
        (
            ("limits", name),
            f"{value:g} {symbol} is no limit: {what} {own:.3g} {symbol}. Correct the unit or the number.",
        )
        for name, value, own, symbol, what in pairs
        if name in limits.model_fields_set and own > 0.0 and value > ABSURD * own
    ]
    if "following_error" in limits.model_fields_set and limits.following_error >= high - low > 0.0:
        text = (
            f"{limits.following_error:g} {unit} is no limit: the whole way is {high - low:g} {unit}. Make it smaller."
        )
        problems.append((("limits", "following_error"), text))
    return problems


def peak(node: NodeKeys) -> float:
    """Force [N] or torque [N m] of the peak current of its motor, at the member; its drive may be set to less."""
    return reached(motor_parameters(node.drive, node.motor).model)["current"] * force_constant_of(node)


def drive_force(node: NodeKeys, objects: Dictionary | None = None) -> float:
    """Largest force [N] or torque [N m] at the member by the drive's own current limits; infinite where no object states one.

    `objects`: those read from the drive; None: those of a new drive of its profile. `objects` of the hardware file, which a
    run writes, replace them.
    """
    dictionary = Dictionary(node.drive.objects, node.node) if objects is None else copy(objects)
    dictionary.values = {**dictionary.values, **node.objects}
    return node.drive.currents(dictionary).peak * force_constant_of(node)


def force_constant_of(node: NodeKeys) -> float:
    """Force [N] or torque [N*m] at the member per ampere: from the hardware file, else from the motor's parameters."""
    return node.force_constant or motor_parameters(node.drive, node.motor).model.force_constant / node.scale


def reached(model: MotorModel) -> dict[str, float]:
    """Speed without a load [m/s or rad/s] and peak current [A] of a motor, at its own side of the gear.

    Where its data name no speed, that at which the back-EMF meets the supply.
    """
    component = catalog.component(model.component)
    values = {
        variable.name: float(str(variable.start)) for variable in component.variables if variable.name in USED
    } | dict(model.parameters)
    if "velocity_maximum" in values:
        speed = values["velocity_maximum"] * model.ratio
    else:
        speed = values["supply_voltage"] / values[EFFORT[model.load][1]]
    return {"velocity": speed, "current": values["current_maximum"]}
