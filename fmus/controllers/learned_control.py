"""Force control with a learned part: PI, the demand's memory, and the safety that controllers which learn share.

Whatever the controller did, demand and force tell where the gripper should have been asked to be:

    y(t) = q(t - delay) + (setpoint - force) / stiffness,   q: integral of the velocity demand

What repeats in y is learned elsewhere, and fed forward here as far as it is trusted.
"""

from __future__ import annotations

from math import exp, floor
from typing import Any

from fmus.dead_zone import beyond
from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter, terminal

PI_ALONE, FADING, LOCKED, BLIND, DISTURBED = 0, 1, 2, 3, 4
SEARCHING, FOLLOWING, LEAVING = 0, 1, 2
LINE = 32  # periods that the demand is remembered
JUDGED = 2.0  # [s] over which the force error is averaged
FARTHEST = 100.0  # [N]: no force is larger; what is not finite is not smaller either
SPACING = 34e-3  # [s] of what the search looks at, 4.5 s: with 5.1 s it begins later and errs more in the tenth beat, 3.8 s hold no breath
STILL = 20
MARGIN = 0.4
LAG = 3e-3
FORGETTING = 0.02  # [s] in which the last force is forgotten when none comes


class LearnedControl(Component):
    """Variables of a force controller that learns: force in, velocity out, and what it says about itself."""

    period = 5e-3
    buffers = (("delay", LINE - 2),)

    setpoint = input("N", "desired contact force", start=0.2, minimum=0.0, nominal=0.1)
    force = input("N", "measured contact force", nominal=0.1)
    enable = input(
        "", "whether the learned motion may move the gripper; otherwise it fades out", start=True, type=Boolean
    )

    target_velocity = output("m/s", "velocity demand for the drive, positive distal", display_unit="mm/s")
    state = output("", "0 PI alone, 1 fading in or out, 2 locked, 3 no force is seen, 4 the beat is not as learned",
                   type=Int32)  # fmt: skip
    share = output("", "part of the learned motion that is fed forward")
    rate = output("Hz", "heart rate; 0: none yet")
    feedforward = output("m/s", "learned part of the demand", display_unit="mm/s")
    innovation = output("m", "last sample minus what was expected of it", display_unit="mm")

    drive = terminal("what it commands", rule="bus", target_velocity=target_velocity)

    proportional = parameter(1.5, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="chosen: with the wall 17 rad/s; 23 ms of delay leave 12 dB and 68 deg")  # fmt: skip
    proportional_beyond = parameter(1.5, "m/(s*N)", "gain on top, for what is left of an error beyond `error_large` once demands that "
                                    "are not felt yet are counted", display_unit="mm/(s*N)", minimum=0.0,
                                    source="seeds 1 to 16: as much again; twice that leaps and overshoots")  # fmt: skip
    error_large = parameter(0.010, "N", "force error that is no noise", display_unit="mN", minimum=0.0,
                            source="three standard deviations of the sensor")  # fmt: skip
    acceleration_maximum = parameter(10.0, "m/s^2", "limit of the demand's change", minimum=0.1,
                                     source="6.5 N for 0.65 kg, and 6 N for friction, sheath and overshoot, stay below "
                                     "15 N")  # fmt: skip
    velocity_maximum = parameter(0.5, "m/s", "limit of the velocity demand", display_unit="mm/s", minimum=0.0,
                                 source="as the other controllers: ten times what the heart needs")  # fmt: skip
    forward_maximum = parameter(0.25, "m/s", "limit of the learned part", display_unit="mm/s", minimum=0.0,
                                source="chosen: twice what a beat of 2 Hz needs")  # fmt: skip
    stiffness = parameter(11.2, "N/m", "contact force per motion of the tip", display_unit="N/mm", minimum=1.0,
                          source="of the bent end, 3 EI / L^3 of wall; 20 % off costs little")  # fmt: skip
    delay = parameter(20e-3, "s", "from a demand until the force sensor's value shows it", display_unit="ms", minimum=5e-3,
                      maximum=0.1, source="one period each of sensor, controller and holding, 4 ms of the drive")  # fmt: skip
    lead = parameter(10e-3, "s", "by which what was learned is applied ahead", display_unit="ms", minimum=0.0, maximum=0.05,
                     source="seeds 3001 to 3010: of 5, 8, 9, 10, 11 and 14 ms the least largest errors; without it learning is slow and rings")  # fmt: skip
    blend = parameter(1.0, "s", "time in which the learned motion fades in and out", minimum=1e-2,
                      source="as the estimators: a beat")  # fmt: skip
    change_maximum = parameter(0.08, "N", "change of the force from one value to the next that is believed", minimum=0.0,
                               source="estimate: 0.3 m/s of an early beat over stiffness, and ten deviations of noise")  # fmt: skip
    still = parameter(8, "", "equal values in a row that are no longer believed", type=Int64, minimum=2,
                      source="chosen: by noise and resolution once in 2000 values; it costs one value")  # fmt: skip
    hold = parameter(0.5, "s", "time that it goes on without a believable force", minimum=0.0,
                     source="chosen: half a beat; the rate is known to 1 %")  # fmt: skip
    worse = parameter(1.0, "", "part of PI's own mean square error above which the learned motion is given up",
                      minimum=0.0, source="chosen: what is worse than PI alone is not used")  # fmt: skip

    stiffness_seen = output("N/m", "TODO")
    delay_seen = output("s", "TODO")
    trust = local(0.0, "", "part of the learned motion that is fed forward")
    mode = local(SEARCHING, "", "0 searching, 1 following, 2 leaving", type=Int32)
    demand = local(0.0, "m", "integral of the velocity demand", display_unit="mm")
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    corrected = local(0.0, "m", "integral of the demand but for the learned part", display_unit="mm")
    line_corrected = local(0.0, "m", "its last values, the same ring", shape=(LINE,))
    latest = local(0, "", "place of the latest", type=Int64)
    last_force = local(0.0, "N", "last value of the sensor")
    believed = local(0.0, "N", "last value that was believed")
    run = local(0, "", "least number of periods for which the sensor showed one value: its own period", type=Int64)
    elapsed = local(0.0, "s", "time since the last new value")
    equal = local(0, "", "values in a row that were equal", type=Int64)
    unseen = local(0.0, "s", "time without a believable value")
    feedback = local(0.0, "N", "force error that the feedback sees")
    square = local(0.0, "N^2", "mean square of the force error")
    alone = local(0.0, "s", "time since when PI has been alone")
    square_alone = local(0.0, "N^2", "the same when PI was last alone for as long")


def begin_control(self: LearnedControl) -> None:
    """Nothing was asked yet, nothing is known."""
    for i in range(LINE):
        self.line[i] = 0.0
        self.line_corrected[i] = 0.0
    self.demand = 0.0
    self.corrected = 0.0
    self.latest = 0
    self.stiffness_seen = self.stiffness
    self.delay_seen = self.delay
    self.last_force = self.force
    self.believed = self.force
    self.equal = 0
    self.run = STILL
    self.elapsed = 0.0
    self.unseen = 0.0
    self.feedback = 0.0
    self.square = 0.0
    self.square_alone = 0.0
    self.alone = 0.0
    self.trust = 0.0
    self.feedforward = 0.0
    self.target_velocity = 0.0


def sense(self: LearnedControl, h: float) -> bool:
    """Take the force in; whether it is believed."""
    seen = believe(self, h)
    if seen:
        self.feedback = self.setpoint - self.believed
        self.square += h / JUDGED * (self.feedback * self.feedback - self.square)
    else:
        self.feedback *= exp(-h / FORGETTING)
    self.alone = self.alone + h if self.mode == SEARCHING else 0.0
    if self.alone > JUDGED:
        self.square_alone = self.square
    return seen


def believe(self: LearnedControl, h: float) -> bool:
    """Whether the force is a new one and may be true; PI alone believes every number."""
    if self.force == self.last_force:
        self.equal += 1
    else:
        self.run = min(self.run, self.equal + 1)
        self.equal = 0
    self.last_force = self.force
    change = abs(self.force - self.believed)
    likely = change <= self.change_maximum * self.run and self.equal < self.still * self.run
    if likely or (self.mode == SEARCHING and change < FARTHEST):
        self.believed = self.force
        self.unseen = 0.0
        return True
    self.unseen += h
    return False


def place_wanted(self: LearnedControl, h: float) -> float:
    """y: where the gripper should have been asked to be when the force that is seen was felt [m]."""
    return felt(self, self.line, h) + (self.setpoint - self.believed) / self.stiffness_seen


def is_new(self: LearnedControl) -> bool:
    return self.equal % self.run == 0

def margin_gain(self, h):
    late = self.delay_seen + LAG + 0.5 * (self.run - 1) * h
    return min(1.0, MARGIN / (self.proportional * self.stiffness_seen * late))

def felt(self: LearnedControl, line: Any, h: float) -> float:
    """What of a ring is felt now: its value `delay` ago."""
    periods = self.delay_seen / h
    whole = floor(periods)
    part = periods - whole
    k = self.latest - int(whole) + LINE
    return (1.0 - part) * line[k % LINE] + part * line[(k - 1) % LINE]


def bearable(self: LearnedControl) -> bool:
    """Whether the force is seen, and the learned motion no worse than PI alone was."""
    return self.unseen <= self.hold and (self.trust < 1.0 or self.square <= self.worse * self.square_alone)


def command(self: LearnedControl, forward: float, h: float) -> None:
    """Feedback, and the learned motion [m/s] as far as it is trusted."""
    wanted = self.enable and self.mode == FOLLOWING
    step = h / self.blend
    self.trust = min(self.trust + step, 1.0) if wanted else max(self.trust - step, 0.0)
    self.feedforward = self.trust * min(max(forward, -self.forward_maximum), self.forward_maximum)

    # dead time: what was asked for and is not felt yet will take its part of the error
    left = self.feedback - self.stiffness_seen * (self.corrected - felt(self, self.line_corrected, h))
    part = margin_gain(self, h)
    velocity = part * self.proportional * self.feedback + self.feedforward
    velocity += part * self.trust * self.proportional_beyond * beyond(left, self.error_large / self.cautious)
    most = h * self.acceleration_maximum
    velocity = min(max(velocity, self.target_velocity - most), self.target_velocity + most)
    self.target_velocity = min(max(velocity, -self.velocity_maximum), self.velocity_maximum)
    self.demand += h * self.target_velocity
    self.corrected += h * (self.target_velocity - self.feedforward)
    self.latest = (self.latest + 1) % LINE
    self.line[self.latest] = self.demand
    self.line_corrected[self.latest] = self.corrected


def tell(self: LearnedControl, rate: float, disturbed: bool) -> None:
    """What is told about it."""
    self.rate = rate
    self.share = self.trust
    self.state = LOCKED
    if self.trust <= 0.0:
        self.state = PI_ALONE
    elif self.unseen > 0.0:
        self.state = BLIND
    elif disturbed:
        self.state = DISTURBED
    elif self.trust < 1.0:
        self.state = FADING
