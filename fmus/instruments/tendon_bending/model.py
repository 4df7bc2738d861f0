"""Bending of a tendon-driven continuum robot with friction spread along its tendon."""

from math import exp, sqrt

from twin.component import Component, input, local, output, parameter

ELEMENTS = 5
CHOSEN = "chosen: an example of 10 deg/mm; measured robots have their own in validation/"


class TendonBending(Component):
    """From the displacement of one tendon to the bending angle and the tip: lag, slack, stick and slip, tip path.

    Friction along the tendon as elements that stick and slip at different loads in parallel with elastic ones (Iwan,
    J. Appl. Mech. 33(4), 1966, recalled), seen from the displacement: plays (Kuhnen, Eur. J. Control 9(4), 2003, recalled).
    Starts at rest after a release that reversed `conditioning`: the first pull bends less than all later ones.
    """

    tendon_displacement = input("m", "pull of the tendon at the motor, positive: pulled", display_unit="mm", nominal=3e-3)

    bending_angle = output("rad", "orientation of the tip in the plane of bending", display_unit="deg")
    tip_x = output("m", "tip in the frame of the measurement: x", display_unit="mm")
    tip_y = output("m", "tip in the frame of the measurement: y", display_unit="mm")
    tip_z = output("m", "tip in the frame of the measurement: z", display_unit="mm")

    lag = parameter(0.03, "s", "time constant between displacement and tip", minimum=0.0, source=CHOSEN)
    slack = parameter(0.0, "m", "pull that takes up the slack", display_unit="mm", source=CHOSEN)
    slack_width = parameter(0.0, "m", "pull over which a slack tendon becomes taut", display_unit="mm", minimum=0.0,
                            source=CHOSEN)
    half_width = parameter((0.2e-3, 0.5e-3, 1e-3, 1.75e-3, 2.5e-3), "m", "half width of each play",
                           display_unit="mm", minimum=0.0, source=CHOSEN)
    gain = parameter((130.0, 20.0, 10.0, 5.0, 10.0), "rad/m", "angle per pull of each play", display_unit="deg/mm",
                     minimum=0.0, source=CHOSEN)
    conditioning = parameter(1e-3, "m", "half of the last reversal before the start: plays up to this half width engage at once",
                             display_unit="mm", minimum=0.0, source=CHOSEN)
    angle_2 = parameter(0.0, "1/rad", "second-order coefficient of the angle over the sum of plays", source="chosen: linear")
    angle_3 = parameter(0.0, "1/rad^2", "third-order coefficient of the angle over the sum of plays", source="chosen: linear")
    rest_angle = parameter(0.0, "rad", "angle at rest", display_unit="deg", source=CHOSEN)

    start_position = parameter((0.0, 0.0, 0.15), "m", "tip at the start, as measured in this run: x, y, z", display_unit="mm",
                              source=CHOSEN)
    usual_position = parameter((0.0, 0.0, 0.15), "m", "tip at rest in the runs of the fit; a start that is closer to "
                               "its opposite has a frame that is turned by half a turn about z", display_unit="mm", source=CHOSEN)
    tangent = parameter((0.08, 0.0, 0.0), "m/rad", "path of the tip over the angle from the usual rest: slope",
                        display_unit="mm/rad", source=CHOSEN)
    bend = parameter((0.0, 0.0, -0.04), "m/rad^2", "path of the tip: second-order coefficients", display_unit="mm/rad^2",
                     source=CHOSEN)
    twist = parameter((0.0, 0.0, 0.0), "m/rad^3", "path of the tip: third-order coefficients", display_unit="mm/rad^3",
                      source=CHOSEN)

    delayed = local(0.0, "m", "displacement behind the lag", display_unit="mm")
    play = local(0.0, "m", "position of each play", shape=(ELEMENTS,), display_unit="mm")
    begin = local(0.0, "rad", "sum of plays at the start", display_unit="deg")
    side = local(1.0, "", "1: frame as in the fit, -1: turned by half a turn about z")
    start_angle = local(0.0, "rad", "angle from rest at the start", display_unit="deg")
    tilt = local(0.0, "rad", "rest of this run from the usual rest", display_unit="deg")

    def initialize(self) -> None:
        self.delayed = self.tendon_displacement
        pull = taut(self)
        self.begin = 0.0
        for i in range(ELEMENTS):
            engaged = min(self.half_width[i], self.conditioning)
            self.begin -= self.gain[i] * engaged
            # a run that begins pulled has come there from rest
            self.play[i] = max(-engaged, pull - self.half_width[i])
        orient(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        share = 1.0 - exp(-h / self.lag) if self.lag > 0.0 else 1.0
        self.delayed += share * (self.tendon_displacement - self.delayed)
        pull = taut(self)
        for i in range(ELEMENTS):
            self.play[i] = min(max(self.play[i], pull - self.half_width[i]), pull + self.half_width[i])
        publish(self)


def taut(self: TendonBending) -> float:
    """Pull beyond the slack [m]; 0 at a displacement of 0."""
    beyond = self.delayed - self.slack
    width = self.slack_width * self.slack_width
    return 0.5 * (beyond + sqrt(beyond * beyond + width) + self.slack - sqrt(self.slack * self.slack + width))


def orient(self: TendonBending) -> None:
    """Side of the frame, and the rest of this run: how far the start lies along the path from where it usually would."""
    self.start_angle = bent(self)
    straight = 0.0
    turned = 0.0
    for i in range(3):
        usual = self.usual_position[i] + path(self, i, 0.0, self.start_angle)
        opposite = usual if i == 2 else -usual
        straight += (self.start_position[i] - usual) * (self.start_position[i] - usual)
        turned += (self.start_position[i] - opposite) * (self.start_position[i] - opposite)
    self.side = -1.0 if turned < straight else 1.0
    along = 0.0
    size = 0.0
    for i in range(3):
        position = self.start_position[i] if i == 2 else self.side * self.start_position[i]
        slope = self.tangent[i] + self.start_angle * (2.0 * self.bend[i] + 3.0 * self.start_angle * self.twist[i])
        along += (position - self.usual_position[i] - path(self, i, 0.0, self.start_angle)) * slope
        size += slope * slope
    self.tilt = along / size if size > 0.0 else 0.0


def bent(self: TendonBending) -> float:
    """Angle from rest [rad], from the plays."""
    total = -self.begin
    for i in range(ELEMENTS):
        total += self.gain[i] * self.play[i]
    return total + self.angle_2 * total * total + self.angle_3 * total * total * total


def publish(self: TendonBending) -> None:
    """Angle from the plays, tip from the angle."""
    angle = bent(self)
    before = self.tilt + self.start_angle
    after = self.tilt + angle
    self.bending_angle = self.rest_angle + angle
    self.tip_x = self.start_position[0] + self.side * path(self, 0, before, after)
    self.tip_y = self.start_position[1] + self.side * path(self, 1, before, after)
    self.tip_z = self.start_position[2] + path(self, 2, before, after)


def path(self: TendonBending, axis: int, before: float, after: float) -> float:
    """Distance that the tip moves between two angles from the usual rest [m]."""
    distance = self.tangent[axis] * (after - before) + self.bend[axis] * (after * after - before * before)
    return distance + self.twist[axis] * (after * after * after - before * before * before)
