"""Command of the rotation experiment."""

from math import pi, sqrt

from twin.component import Component, Int32, output, parameter


class RotationCommand(Component):
    """Turns forth and back with rests between, trapezoidal in speed, for a drive in csp.

    Al-Ahmad et al. (RACS), section III.D: two turns each way, four times. A function of time alone, without memory.
    """

    target_position = output("rad", "angle to follow", display_unit="deg")
    target_velocity = output("rad/s", "its speed", display_unit="deg/s")
    cycle = output("", "number of the cycle, from 1; 0 before the first and after the last", type=Int32)

    rotation = parameter(4.0 * pi, "rad", "angle turned each way", display_unit="deg", minimum=1e-3,
                         source="paper, section III.D: two turns")
    speed = parameter(1.2566, "rad/s", "largest speed", display_unit="deg/s", minimum=1e-3,
                      source="paper, section III.D: 14.4 to 72 deg/s")
    acceleration = parameter(5.0, "rad/s^2", "acceleration", display_unit="deg/s^2", minimum=1e-3,
                             source="estimate: full speed in a quarter of a second")
    rest = parameter(1.0, "s", "rest before the first motion and after each one", minimum=0.0,
                     source="estimate: longer than the average of 400 ms")
    cycles = parameter(4, "", "how often forth and back", type=Int32, minimum=1)

    def initialize(self) -> None:
        command(self, 0.0)

    def step(self, t: float, h: float) -> None:
        command(self, t + h)


def command(self: RotationCommand, t: float) -> None:
    """Position and speed at a time [s]."""
    peak = min(self.speed, sqrt(self.rotation * self.acceleration))
    ramp = peak / self.acceleration
    moving = self.rotation / peak + ramp
    half = moving + self.rest

    number = int((t - self.rest) // half)
    time = t - self.rest - number * half
    self.cycle = 0
    if t >= self.rest and number < 2 * self.cycles:
        self.cycle = number // 2 + 1
    else:
        time = 0.0
    position = speed = 0.0
    if time < ramp:
        speed = self.acceleration * time
        position = 0.5 * speed * time
    elif time < moving - ramp:
        speed = peak
        position = peak * (time - 0.5 * ramp)
    elif time < moving:
        speed = self.acceleration * (moving - time)
        position = self.rotation - 0.5 * speed * (moving - time)
    else:
        position = self.rotation
    if number % 2 == 1 and self.cycle > 0:
        position = self.rotation - position
        speed = -speed
    self.target_position = position
    self.target_velocity = speed
