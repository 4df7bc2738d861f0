"""Simulated drive inside a co-simulation: its motor is the member that it replaces, with that member's load."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import State
from hw_bridge.profiles import MotorModel, MotorParameters, member_load, motor_parameters
from twin.component import Float64, Role

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from hw_bridge.dictionary import Value
    from hw_bridge.hardware import NodeKeys
    from twin.component import Component

STANDSTILL = 1e-3  # slower than this is at rest [m/s or rad/s]
OWN = ("current_maximum", "current_continuous")  # parameters of a motor that its drive uses for itself

TRUE = {"velocity", "angular_velocity", "motor_angle", "current", "force", "torque"}


def start_position(axis: Component) -> float:
    """Start position of a member [m or rad]."""
    return float(axis.views["target_position"]) if "target_position" in axis.views else 0.0


def store_motor_parameters(drive: Drive, motor: MotorParameters) -> Drive:
    """Prepare a simulated drive as delivered to a bench: store what the vendor's software writes for this motor."""
    name = drive.profile.name
    entry = drive.dictionary.entry
    values: dict[tuple[int, int], Value] = {
        address: entry(*address).type.saturated(value)
        for address, value in {**motor.scaling.get(name, {}), **motor.settings.get(name, {})}.items()
    }
    drive.storage.saved = values | drive.storage.saved
    drive.dictionary.restore({address: drive.storage.saved[address] for address in values})
    return drive


class Plant:
    """Drive and motor. Positions of the member are those of the motor, except for scale, direction and origin."""

    def __init__(self, axis: Component, keys: NodeKeys, position: float, build: Path) -> None:
        vendor = keys.drive
        self.axis, self.keys = axis, keys
        self.sign = -keys.scale if keys.inverted else keys.scale
        self.parameters: dict[str, float] = {}
        motor = motor_parameters(vendor, keys.motor)
        model = self.model(motor.model)
        self.motor = Motor(model, build=build, position=0.0 if keys.homing else position / self.sign)
        self.drive = store_motor_parameters(Drive(vendor, keys.node, self.motor), motor)
        self.load = self.sign * model.ratio  # of the member's load, what the motor's component takes
        self.origin = 0.0

    def model(self, own: MotorModel) -> MotorModel:
        """The motor of the vendor's profile with the member's parameters; a rotary drive has its own gear."""
        declared = {v.name: v for v in type(self.axis).variables if v.role is Role.parameter and v.type is Float64}
        values = {key: float(self.axis.views[key]) for key in declared if not declared[key].shape}
        name = self.axis.replaced.__module__.split(".")[-2]  # type: ignore[attr-defined]
        given = {key: value for key, value in values.items() if value != declared[key].start}
        if "gear_ratio" in values and own.unit == "rad":
            self.parameters = {key: value for key, value in values.items() if key not in OWN}
            return replace(
                own, component=name, parameters=given, position="angle", load="load_torque", ratio=values["gear_ratio"]
            )
        adopted = self.keys.motor == "member"
        if not adopted and (name != own.component or own.parameters):  # another motor than the member's
            return own
        self.parameters = {key: value for key, value in values.items() if key not in OWN}
        ratio = 1.0 / self.keys.scale if adopted else own.ratio  # the drive counts what it takes for its motor
        return replace(own, component=name, parameters=given, position="position", load="load_force", ratio=ratio)

    def zero(self, position: float) -> None:
        """Align true and measured positions at the measured one [m or rad]."""
        self.origin = self.sign * self.motor.measured_position - position

    def update_load(self) -> None:
        """Apply the load and changed parameters."""
        views = self.axis.views
        if (load := member_load(views)) is not None:
            self.motor.load(load * self.load)
        for key, before in self.parameters.items():
            if (value := float(views[key])) != before:
                self.parameters[key] = value
                self.motor.set(key, value)

    def faults_at_rest(self, speed: float) -> str:
        """Return what is wrong at rest: power, motion of the motor [m/s or rad/s], outputs."""
        drive, keys = self.drive, self.keys
        speed *= keys.scale
        faults = [f"{drive.state}"] if drive.state is State.ENABLED else []
        faults += [f"moves at {speed:.3g} {self.motor.model.unit}/s"] if speed > STANDSTILL else []
        if keys.safe_outputs is not None and drive.outputs != keys.safe_outputs:
            faults.append(f"outputs {drive.outputs}, not {keys.safe_outputs}")
        return f"node {keys.node}: {', '.join(faults)}." if faults else ""

    def shown(self) -> dict[str, Callable[[], float]]:
        """Values that only a simulated motor provides."""
        values: dict[str, Callable[[], float]] = {
            "position": self.position,
            "angle": self.position,
            "overload": lambda: self.drive.axis.level,
        }
        if self.parameters:  # it is the member's own component
            values |= {name: partial(self.true, name) for name in TRUE & set(self.axis.views)}
        return values

    def position(self) -> float:
        """True position of the member [m or rad]."""
        return self.sign * self.motor.position - self.origin

    def true(self, name: str) -> float:
        """A variable of the motor, in the member's direction."""
        value = self.motor.get(name)
        return value if self.sign > 0.0 else -value
