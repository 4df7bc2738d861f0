"""Tip of a steerable catheter, from the displacement of its tendon."""

from math import cos, exp, sin

from twin.component import Component, input, local, output, parameter

STRAIGHT = 1e-6  # bending angle [rad] below which the series of the arc are exact
ITERATIONS = 8  # of Newton's method for the bending angle; six are enough to 1.5 rad


class SteerableTip(Component):
    """Cubic static map, Dahl friction of the tendon and a first-order lag; the tip lies on an arc of constant curvature.

    Dahl, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1, 1968; Webster and Jones, Int. J. Robotics
    Research 29(13), 2010. The friction at the start follows from the measured start of the tip.
    """

    tendon_displacement = input("m", "displacement of the tendon; negative: of the opposite tendon", display_unit="mm",
                                nominal=5e-3)
    tip_x = output("m", "tip across the catheter", display_unit="mm")
    tip_z = output("m", "tip along the catheter", display_unit="mm")

    offset = parameter(-0.5e-3, "m", "tip across at zero displacement, without friction", display_unit="mm",
                       source="assumed; fitted by twin validate")
    gain = parameter(-6.6, "", "tip travel per tendon displacement", source="assumed; fitted by twin validate")
    quadratic = parameter(-40.0, "1/m", "second-order coefficient of the static map", source="assumed; fitted by twin validate")
    cubic = parameter(3.0e4, "1/m^2", "third-order coefficient of the static map", source="assumed; fitted by twin validate")
    friction = parameter(0.5e-3, "m", "offset of the tip by friction after a long travel", display_unit="mm", minimum=0.0,
                         source="assumed; fitted by twin validate")
    friction_travel = parameter(0.2e-3, "m", "tendon travel over which the friction reverses", display_unit="mm", minimum=1e-6,
                                source="assumed; fitted by twin validate")
    lag = parameter(0.01, "s", "time constant of the tip behind the static map", display_unit="ms", minimum=1e-4,
                    source="assumed; fitted by twin validate")
    lag_deviation = parameter(0.0, "s", "standard deviation of lag and delay between runs: weight of the start",
                              display_unit="ms", minimum=0.0, source="assumed; fitted by twin validate")
    offset_deviation = parameter(0.6e-3, "m", "standard deviation of the friction offset, weighed against lag_deviation",
                                 display_unit="mm", minimum=1e-6, source="assumed")
    length = parameter(58e-3, "m", "length of the bending part", display_unit="mm", minimum=1e-3,
                       source="assumed; fitted by twin validate")
    base = parameter(-4e-3, "m", "begin of the bending part along the catheter", display_unit="mm",
                     source="assumed; fitted by twin validate")
    center = parameter(0.0, "m", "tip across at zero bending angle", display_unit="mm", source="assumed; fitted by twin validate")
    start_x = parameter(0.0, "m", "tip across at the start", display_unit="mm", source="measured at the start of a run")
    start_velocity = parameter(0.0, "m/s", "velocity of the tip across at the start", display_unit="mm/s",
                               source="measured at the start of a run")

    x = local(0.0, "m", "tip across", display_unit="mm")
    held = local(0.0, "m", "offset of the tip by friction", display_unit="mm")
    delayed = local(0.0, "m", "offset of the tip at the start by a delay beyond the lag", display_unit="mm")
    delay = local(0.01, "s", "lag of this run", display_unit="ms")
    last_displacement = local(0.0, "m", "tendon displacement in the step before", display_unit="mm")
    last_target = local(0.0, "m", "static position in the step before", display_unit="mm")

    def initialize(self) -> None:
        error = self.start_x + self.lag * self.start_velocity - static_position(self, self.tendon_displacement)

        # linear estimate of lag and offset from one sample: the faster the tip, the more of its error is lag, and delay
        # beyond half of the lag
        ratio = self.lag_deviation / self.offset_deviation
        weight = ratio * ratio * self.start_velocity
        change = -error * weight / (1.0 + weight * self.start_velocity)
        change = min(max(change, -0.5 * self.lag), 0.5 * self.lag)
        self.delay = self.lag + change
        self.held = error / (1.0 + weight * self.start_velocity)
        self.delayed = error + change * self.start_velocity - self.held
        self.x = self.start_x
        self.last_displacement = self.tendon_displacement
        self.last_target = static_position(self, self.tendon_displacement) + self.held + self.delayed
        publish(self)

    def step(self, t: float, h: float) -> None:
        travel = self.tendon_displacement - self.last_displacement
        self.last_displacement = self.tendon_displacement

        # the friction opposes the motion of the tip, which has the sign of gain times travel
        limit = self.friction if travel * self.gain < 0.0 else -self.friction
        self.held = limit + (self.held - limit) * exp(-abs(travel) / self.friction_travel)

        # a delayed tip is off in proportion to its velocity, at most by as much as at the start
        travel_at_start = self.start_velocity * h
        share = min(max(self.gain * travel / travel_at_start, -1.0), 1.0) if travel_at_start != 0.0 else 0.0
        target = static_position(self, self.tendon_displacement) + self.held + share * self.delayed
        mean = 0.5 * (target + self.last_target)
        self.last_target = target
        self.x = mean + (self.x - mean) * exp(-h / self.delay)
        publish(self)


def static_position(self: SteerableTip, q: float) -> float:
    """Position across [m] without friction."""
    return self.offset + q * (self.gain + q * (self.quadratic + q * self.cubic))


def publish(self: SteerableTip) -> None:
    """Tip on the arc whose lateral extent is x: Newton's method for the bending angle."""
    wanted = min(max((self.x - self.center) / self.length, -0.7), 0.7)
    angle = 2.0 * wanted
    for _ in range(ITERATIONS):
        if abs(angle) > STRAIGHT:
            across = (1.0 - cos(angle)) / angle
            slope = (sin(angle) - across) / angle
            angle -= (across - wanted) / slope
    self.tip_x = self.x
    self.tip_z = self.base + self.length * (sin(angle) / angle if abs(angle) > STRAIGHT else 1.0)
