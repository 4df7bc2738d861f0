"""Variables and laws that force controllers share."""

from __future__ import annotations

from math import floor
from typing import Any

from twin.component import Component, input, local, output, parameter, terminal


class VelocityControl(Component):
    """Force controller that commands a velocity."""

    period = 5e-3

    setpoint = input("N", "desired contact force", start=0.2, minimum=0.0, nominal=0.1)
    force = input("N", "measured contact force", nominal=0.1)

    target_velocity = output("m/s", "velocity demand for the drive, positive distal", display_unit="mm/s")

    drive = terminal("what it commands", rule="bus", target_velocity=target_velocity)

    velocity_maximum = parameter(
        0.5,
        "m/s",
        "limit of the velocity demand",
        display_unit="mm/s",
        minimum=0.0,
        source="chosen: ten times what the heart needs",
    )


class NominalPlant(Component):
    """Plant of a velocity demand: an integrator with dead time, and the contact's stiffness."""

    acceleration_maximum = parameter(
        10.0,
        "m/s^2",
        "limit of the demand's change",
        minimum=0.1,
        source="as phase_locked_control: keeps the motor below 15 N",
    )
    stiffness = parameter(
        11.2,
        "N/m",
        "contact force per motion of the tip",
        display_unit="N/mm",
        minimum=1.0,
        source="as phase_locked_control: 3 EI / L^3 of wall",
    )
    delay = parameter(
        20e-3,
        "s",
        "from a demand until the force sensor's value shows it",
        display_unit="ms",
        minimum=5e-3,
        maximum=0.1,
        source="as phase_locked_control: one period each of sensor, controller and holding, 4 ms of the drive",
    )

    velocity = local(0.0, "m/s", "last velocity demand", display_unit="mm/s")
    demand = local(0.0, "m", "integral of the velocity demand", display_unit="mm")


class ForceControl(VelocityControl):
    """Variables of a proportional-integral force controller with an estimate of the wall."""

    heart_position = input("m", "estimated wall position; PI alone ignores it", display_unit="mm", nominal=5e-3)

    proportional = parameter(
        0.150,
        "m/(s*N)",
        "proportional gain",
        display_unit="mm/(s*N)",
        minimum=0.0,
        source="paper, section V.B: 150 mm/(s N)",
    )
    integral = parameter(
        0.0, "m/(s^2*N)", "integral gain", display_unit="mm/(s^2*N)", minimum=0.0, source="paper, section V.B: 0"
    )

    integral_part = local(0.0, "m/s", "integral of the error", display_unit="mm/s")


def delayed_value(ring: Any, latest: int, periods: float, size: int) -> float:
    """Value of a ring buffer so many periods before its `latest`, interpolated."""
    below = floor(periods)
    part = periods - below
    k = latest - int(below) + size
    return (1.0 - part) * ring[k % size] + part * ring[(k - 1) % size]


def limit_velocity(self: Any, velocity: float, h: float) -> None:
    """Limit a velocity [m/s] and its change, publish it, and integrate it."""
    most = h * self.acceleration_maximum
    velocity = min(max(velocity, self.velocity - most), self.velocity + most)
    self.velocity = min(max(velocity, -self.velocity_maximum), self.velocity_maximum)
    self.target_velocity = self.velocity
    self.demand += h * self.velocity


def control_velocity(self: ForceControl, feedforward: float, h: float) -> float:
    """PI law plus feedforward [m/s], limited; at the limit the integral only moves if that leads away from it."""
    error = self.setpoint - self.force
    integral_part = self.integral_part + self.integral * h * error
    demand = self.proportional * error + integral_part + feedforward
    limited = min(max(demand, -self.velocity_maximum), self.velocity_maximum)
    if (demand - limited) * error <= 0.0:
        self.integral_part = integral_part
    return limited
