"""Compensation of the rotation hysteresis."""

from math import copysign

from twin.component import Component, input, local, output, parameter


class RotationCompensator(Component):
    """From the wanted angle of the tip to the angle of the frame that should lead there: the inverse of a play.

    An instrument that turns in a sheath with dry friction is a play between its ends: after a reversal the tip stands
    until the twist has reversed, then follows. `identify.py` finds the play. The inverse would jump over it at a
    reversal; here it goes at `speed`, so the tip is late by play / speed there and nowhere else.
    """

    period = 1e-3

    angle = input("rad", "wanted angle of the tip", display_unit="deg", nominal=0.5)
    compensated_angle = output("rad", "target angle for the frame", display_unit="deg")
    lead = output("rad", "what the frame is ahead of the tip", display_unit="deg")

    play = parameter(0.87, "rad", "width of the loop of tip over frame", display_unit="deg", minimum=0.0,
                     source="identified from: scenarios/rotation.yaml")
    threshold = parameter(5e-3, "rad", "motion back that counts as a reversal", display_unit="deg", minimum=0.0,
                          source="chosen: above the jitter of a hand or of a tracker")
    speed = parameter(6.0, "rad/s", "speed over the play", display_unit="deg/s", minimum=1e-3,
                      source="chosen: five times the paper's largest speed, within the drive's 10 rad/s")

    direction = local(0.0, "", "direction of the last motion: -1, 0 (none yet), 1")
    extreme = local(0.0, "rad", "farthest angle in that direction", display_unit="deg")
    offset = local(0.0, "rad", "lead so far", display_unit="deg")

    def initialize(self) -> None:
        self.direction = 0.0
        self.extreme = self.angle
        self.offset = 0.0
        self.lead = 0.0
        self.compensated_angle = self.angle

    def step(self, t: float, h: float) -> None:
        back = self.angle - self.extreme
        if back * self.direction > 0.0:
            self.extreme = self.angle
        elif abs(back) > self.threshold:
            self.direction = copysign(1.0, back)
            self.extreme = self.angle
        missing = 0.5 * self.direction * self.play - self.offset
        self.offset += min(max(missing, -self.speed * h), self.speed * h)
        self.lead = self.offset
        self.compensated_angle = self.angle + self.offset
