"""Travel command."""

from math import sqrt

from twin.component import Component, output, parameter


class TravelCommand(Component):
    """Commanded speed of the instrument: a distance out, a pause, and the same distance back.

    Al-Ahmad et al. (RACS), section III.C. A distance too short for the speed is travelled at a lower one.
    """

    target_velocity = output("m/s", "commanded speed, positive distal", display_unit="mm/s")
    reference_position = output("m", "its integral", display_unit="mm")

    distance = parameter(0.5, "m", "travel out; negative begins proximally", display_unit="mm",
                         source="paper, section III.C")
    speed = parameter(0.04, "m/s", "speed of travel", display_unit="mm/s", minimum=1e-6,
                      source="paper, section III.C: 5 to 40 mm/s")
    acceleration = parameter(0.5, "m/s^2", "at both ends of a travel", minimum=1e-6,
                             source="paper, section IV.B: heart motion needs 0.51 m/s^2")
    begin = parameter(0.0, "s", "time of the start", minimum=0.0, source="chosen")
    dwell = parameter(1.0, "s", "pause between out and back", minimum=0.0, source="chosen")

    def derivatives(self, t: float) -> None:
        length = abs(self.distance)
        sign = 1.0 if self.distance >= 0.0 else -1.0
        peak = min(self.speed, sqrt(length * self.acceleration))
        ramp = peak / self.acceleration
        total = length / peak + ramp if peak > 0.0 else 0.0

        out = t - self.begin
        back = out - total - self.dwell
        self.target_velocity = sign * (travel_speed(out, peak, ramp, total) - travel_speed(back, peak, ramp, total))
        self.reference_position = sign * (travelled(out, peak, ramp, total) - travelled(back, peak, ramp, total))


def travel_speed(t: float, peak: float, ramp: float, total: float) -> float:
    """Trapezoid of speed [m/s] that begins at t = 0."""
    if t <= 0.0 or t >= total:
        return 0.0
    return peak * min(1.0, t / ramp, (total - t) / ramp)


def travelled(t: float, peak: float, ramp: float, total: float) -> float:
    """Its integral [m]."""
    t = min(max(t, 0.0), total)
    if ramp <= 0.0:
        return 0.0
    first = min(t, ramp)
    last = max(t - (total - ramp), 0.0)
    return 0.5 * peak * (first * first) / ramp + peak * (t - first - last) + peak * last * (1.0 - 0.5 * last / ramp)
