"""Force control law that the three controllers share: a base class with their variables, and the law."""

from __future__ import annotations

from twin.component import Component, input, local, output, parameter, terminal


class ForceControl(Component):
    """Variables of a force controller that commands a velocity; all three have the same connectors."""

    period = 5e-3

    setpoint = input("N", "desired contact force", start=0.2, minimum=0.0, nominal=0.1)
    force = input("N", "measured contact force", nominal=0.1)
    heart_position = input("m", "estimated wall position; PI alone ignores it", display_unit="mm", nominal=5e-3)

    target_velocity = output("m/s", "velocity demand for the drive, positive distal", display_unit="mm/s")

    drive = terminal("what it commands", rule="bus", target_velocity=target_velocity)

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
    velocity_maximum = parameter(
        0.5,
        "m/s",
        "limit of the velocity demand",
        display_unit="mm/s",
        minimum=0.0,
        source="chosen: ten times what the heart needs",
    )

    integral_part = local(0.0, "m/s", "integral of the error", display_unit="mm/s")


def control_velocity(self: ForceControl, feedforward: float, h: float) -> float:
    """PI law plus feedforward [m/s], limited; at the limit the integral only moves if that leads away from it."""
    error = self.setpoint - self.force
    integral_part = self.integral_part + self.integral * h * error
    demand = self.proportional * error + integral_part + feedforward
    limited = min(max(demand, -self.velocity_maximum), self.velocity_maximum)
    if (demand - limited) * error <= 0.0:
        self.integral_part = integral_part
    return limited
