"""Command of a catheter and a guidewire that move together."""

from math import sqrt

from fmus.travel_command.model import travel_speed, travelled

from fmus.dead_zone import dead_zone
from twin.component import Component, Int32, input, local, output, parameter

# phases:  wire, catheter: share of `increment` or, in the last two, of `distance`
LEAD = (1.0, 0.0)  # the wire goes ahead
FOLLOW = (0.0, 1.0)  # the catheter goes over the wire, which is held
TOGETHER = (1.0, 1.0)
BACK = (-1.0, -1.0)


class CoaxialCommand(Component):
    """The wire leads, the catheter follows over the held wire, some times; then both go on together, and back.

    It does not wait for the rigs. With a gain the wire makes up for what the measured tips are apart too much or too
    little, beyond a tolerance within which it would only follow noise.
    """

    former_names = (("apart_first", "initial_separation"),)

    wire_position = input("m", "measured depth of the wire's tip", display_unit="mm", nominal=0.3)
    catheter_position = input("m", "measured depth of the catheter's tip", display_unit="mm", nominal=0.3)

    wire_velocity = output("m/s", "wanted speed of the guidewire, positive distal", display_unit="mm/s")
    catheter_velocity = output("m/s", "wanted speed of the catheter, positive distal", display_unit="mm/s")
    wire_reference = output("m", "integral of the wire's", display_unit="mm")
    catheter_reference = output("m", "integral of the catheter's", display_unit="mm")
    relative_error = output("m", "wire minus catheter, less what it should be", display_unit="mm")
    phase = output("", "0 rest, 1 the wire leads, 2 the catheter follows, 3 together, 4 back", type=Int32)

    cycles = parameter(2, "", "how often the wire leads", type=Int32, minimum=0)
    increment = parameter(0.08, "m", "by which the wire leads", display_unit="mm", minimum=0.0,
                          source="chosen: twice what a gripper carries, so that both regrip")
    distance = parameter(0.12, "m", "travel together", display_unit="mm", minimum=0.0, source="chosen")
    speed = parameter(0.02, "m/s", "speed of travel", display_unit="mm/s", minimum=1e-6,
                      source="paper, section III.C: 5 to 40 mm/s")
    acceleration = parameter(0.1, "m/s^2", "at both ends of a travel", minimum=1e-6, source="chosen: gentle")
    begin = parameter(1.0, "s", "time of the start", minimum=0.0, source="chosen: both grip before")
    pause = parameter(0.5, "s", "between two travels", minimum=0.0, source="chosen")
    gain = parameter(0.0, "1/s", "of the correction; 0: none", minimum=0.0, source="chosen: none")
    tolerance = parameter(0.8e-3, "m", "error that is left alone", display_unit="mm", minimum=0.0,
                          source="chosen: three standard deviations of two trackers' noise")
    correction_maximum = parameter(5e-3, "m/s", "largest correction of the wire's speed", display_unit="mm/s",
                                   minimum=0.0, source="chosen: a quarter of the speed")

    initial_separation = local(0.0, "m", "wire minus catheter at the start", display_unit="mm")

    def initialize(self) -> None:
        self.initial_separation = self.wire_position - self.catheter_position
        command(self, 0.0)

    def step(self, t: float, h: float) -> None:
        command(self, t + h)
        correct(self)


def command(self: CoaxialCommand, t: float) -> None:
    """Speeds and references of a time [s]."""
    self.wire_velocity = self.catheter_velocity = 0.0
    self.wire_reference = self.catheter_reference = 0.0
    self.relative_error = 0.0
    self.phase = 0
    time = t - self.begin
    for _ in range(self.cycles):
        time = travel(self, time, self.increment, LEAD, 1)
        time = travel(self, time, self.increment, FOLLOW, 2)
    time = travel(self, time, self.distance, TOGETHER, 3)
    travel(self, time, self.distance, BACK, 4)


def travel(self: CoaxialCommand, time: float, length: float, shares: tuple[float, float], number: int) -> float:
    """Add one travel that begins at time 0; returns the time since the end of the pause that follows [s]."""
    peak = min(self.speed, sqrt(length * self.acceleration))
    ramp = peak / self.acceleration
    total = length / peak + ramp if peak > 0.0 else 0.0
    speed = travel_speed(time, peak, ramp, total)
    traveled = travelled(time, peak, ramp, total)
    self.wire_velocity += shares[0] * speed
    self.catheter_velocity += shares[1] * speed
    self.wire_reference += shares[0] * traveled
    self.catheter_reference += shares[1] * traveled
    if 0.0 < time < total:
        self.phase = number
    return time - total - self.pause


def correct(self: CoaxialCommand) -> None:
    """Speed of the wire that brings the tips to where they should be."""
    wanted = self.wire_reference - self.catheter_reference
    self.relative_error = self.wire_position - self.catheter_position - self.initial_separation - wanted
    most = self.correction_maximum
    self.wire_velocity -= min(max(self.gain * dead_zone(self.relative_error, self.tolerance), -most), most)
