"""Force control with a learned part: PI, the demand's memory, and the safety that controllers which learn share.

Whatever the controller did, demand and force tell where the gripper should have been asked to be:

    y(t) = q(t - delay) + (setpoint - force) / stiffness,   q: integral of the velocity demand

What repeats in y is learned elsewhere, and fed forward here as far as it is trusted. What it falls back to is PI, or, where an
estimate of the wall is connected, PI with the wall's motion fed forward through the inverse hysteresis.
"""

from __future__ import annotations

from math import exp
from typing import Any

from fmus.bouc_wen import BoucWenInverse, advance_inverse, initialize_inverse
from fmus.control import VelocityControl, delayed_value

from fmus.dead_zone import dead_zone
from twin.component import Boolean, Int32, Int64, input, local, output, parameter

PI_ALONE, FADING, LOCKED, BLIND, DISTURBED, WALL_ALONE, WORSE = 0, 1, 2, 3, 4, 5, 6
SEARCHING, FOLLOWING, LEAVING = 0, 1, 2
LINE = 32  # periods that the demand is remembered
JUDGED, AVERAGED = 2.0, 10.0  # [s] over which the force error is averaged: to notice what goes wrong, and to compare
TWICE = 4.0  # mean square over that of the wall's feedforward from which 2 s are enough to give up: twice the deviation
RETRY, RETRY_LATEST = (
    5.0,
    300.0,
)  # [s] until what was worse is tried again: the search's memory; doubled each time, at most
PHASE_LOSS = 0.4  # [rad] that dead time may take at the crossover: 12 dB and 67 deg are left
LAG = 3e-3  # [s] of the drive and of holding, beyond `delay`: with 20 ms they are the 23 ms of the gain's source
CAUTION = 0.5  # part of the gain while the plant is not measured: with twice the stiffness and 20 ms more 6 dB and 45 deg are left
SLOWEST = 20  # periods that a sensor may hold a value, 10 Hz
FARTHEST = 100.0  # [N]: no force is larger; what is not finite is not smaller either
SPACING = 34e-3  # [s] of what the search looks at, 4.5 s: with 5.1 s it begins later and errs more in the tenth beat, 3.8 s hold no breath
FORGETTING = 0.02  # [s] in which the last force is forgotten when none comes


class LearnedControl(VelocityControl, BoucWenInverse):
    """Variables shared by the learning force controllers: force input, velocity output and state."""

    buffers = (("delay", LINE - 2),)

    enable = input(
        "", "whether the learned motion may move the gripper; otherwise it fades out", start=True, type=Boolean
    )

    heart_position = input("m", "estimated wall position, for the fallback", display_unit="mm", nominal=5e-3)
    heart_status = input("", "of that estimate: 0 valid, 1 degraded, 2 lost, or none is connected", start=2, type=Int32,
                         minimum=0, maximum=2)  # fmt: skip

    state = output(
        "",
        "0 PI alone, 1 fading in or out, 2 locked, 3 no force is seen, 4 the beat is not as learned, "
        "5 PI with the measured wall, 6 as 0 or 5, since it left less than the learned motion",
        type=Int32,
    )
    share = output("", "part of the learned motion that is fed forward")
    rate = output("Hz", "heart rate; 0: none yet")
    feedforward = output("m/s", "learned part of the demand", display_unit="mm/s")
    stiffness_estimate = output("N/m", "contact force per motion of the tip, as it reckons", display_unit="N/mm")
    delay_estimate = output("s", "from a demand until the force shows it, as it reckons", display_unit="ms")
    innovation = output("m", "last sample minus what was expected of it", display_unit="mm")

    proportional = parameter(1.5, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="chosen: with the wall 17 rad/s; 23 ms of delay leave 12 dB and 68 deg")  # fmt: skip
    proportional_beyond = parameter(1.5, "m/(s*N)", "gain on top, for what is left of an error beyond `error_large` once demands that "
                                    "have not taken effect yet are counted", display_unit="mm/(s*N)", minimum=0.0,
                                    source="seeds 1 to 16: as much again; twice that leaps and overshoots")  # fmt: skip
    error_large = parameter(0.010, "N", "force error that is no noise", display_unit="mN", minimum=0.0,
                            source="three standard deviations of the sensor")  # fmt: skip
    proportional_wall = parameter(0.150, "m/(s*N)", "gain of the fallback with the measured wall", display_unit="mm/(s*N)", minimum=0.0,
                                  source="paper, section V.B: 150 mm/(s N)")  # fmt: skip
    acceleration_maximum = parameter(
        10.0,
        "m/s^2",
        "limit of the demand's change",
        minimum=0.1,
        source="6.5 N for 0.65 kg, and 6 N for friction, sheath and overshoot, stay below 15 N",
    )
    forward_maximum = parameter(0.25, "m/s", "limit of the learned part", display_unit="mm/s", minimum=0.0,
                                source="chosen: twice what a beat of 2 Hz needs")  # fmt: skip
    stiffness = parameter(11.2, "N/m", "contact force per motion of the tip, to begin with", display_unit="N/mm", minimum=1.0,
                          source="of the bent end, 3 EI / L^3 of wall; 20 % off costs little")  # fmt: skip
    delay = parameter(20e-3, "s", "from a demand until the force sensor's value shows it, to begin with", display_unit="ms", minimum=5e-3,
                      maximum=0.1, source="one period each of sensor, controller and holding, 4 ms of the drive")  # fmt: skip
    lead = parameter(10e-3, "s", "by which what was learned is applied ahead", display_unit="ms", minimum=0.0, maximum=0.05,
                     source="seeds 3001 to 3010: of 5, 8, 9, 10, 11 and 14 ms the least largest errors; without it learning is slow and rings")  # fmt: skip
    blend = parameter(
        1.0, "s", "time in which the learned motion fades in and out", minimum=1e-2, source="as the estimators: a beat"
    )
    change_maximum = parameter(
        0.08,
        "N",
        "change of the force from one value to the next that is believed",
        minimum=0.0,
        source="estimate: 0.3 m/s of an early beat over stiffness, and ten deviations of noise",
    )
    still = parameter(8, "", "equal values in a row that are no longer believed", type=Int64, minimum=2,
                      source="chosen: by noise and resolution once in 2000 values; it costs one value")  # fmt: skip
    hold = parameter(
        0.5,
        "s",
        "time that it continues without a plausible force",
        minimum=0.0,
        source="chosen: half a beat; the rate is known to 1 %",
    )
    worse = parameter(
        1.0,
        "",
        "part of the fallback's mean square error above which the learned motion is given up",
        minimum=0.0,
        source="chosen: a result worse than the fallback is not used",
    )

    trust = local(0.0, "", "part of the learned motion that is fed forward")
    mode = local(SEARCHING, "", "0 searching, 1 following, 2 leaving", type=Int32)
    demand = local(0.0, "m", "integral of the velocity demand", display_unit="mm")
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    corrected = local(0.0, "m", "integral of the demand but for the learned part", display_unit="mm")
    line_corrected = local(0.0, "m", "its last values, the same ring", shape=(LINE,))
    latest = local(0, "", "place of the latest", type=Int64)
    last_force = local(0.0, "N", "last value of the sensor")
    believed = local(0.0, "N", "last value that was believed")
    equal = local(0, "", "values in a row that were equal", type=Int64)
    hold_periods = local(0, "", "periods for which the sensor holds a value: the least that was seen", type=Int64)
    measured = local(False, "", "whether stiffness and delay are measured instead of nominal", type=Boolean)
    stiffness_ratio = local(1.0, "", "stiffness over the nominal one")
    extra_delay = local(0.0, "s", "delay beyond the nominal one")
    noise_part = local(
        1.0, "", "usual noise over that of the sensor, at most 1: noise is learned that much more slowly"
    )
    unseen = local(0.0, "s", "time without a believable value")
    feedback = local(0.0, "N", "force error that the feedback sees")
    square = local(0.0, "N^2", "mean square of the force error")
    mean_square = local(
        0.0, "N^2", "the same since the fallback is alone or the learned motion fully trusted, at most 10 s"
    )
    alone = local(0.0, "s", "time since when the fallback has been alone")
    locked_time = local(0.0, "s", "time since when the learned motion has been fully trusted")
    square_fallback = local(0.0, "N^2", "mean square when the fallback was last alone")
    wait = local(0.0, "s", "time until the learned motion is tried again")
    retry = local(0.0, "s", "the next such time")
    wall_share = local(0.0, "", "part of the fallback that is the measured wall")
    wall_judged = local(False, "", "whether that mean square is one with the measured wall", type=Boolean)


def begin_control(self: LearnedControl) -> None:
    """Reset the state of the controller."""
    for i in range(LINE):
        self.line[i] = 0.0
        self.line_corrected[i] = 0.0
    self.demand = 0.0
    self.corrected = 0.0
    self.latest = 0
    self.hold_periods = SLOWEST
    self.measured = False
    self.stiffness_ratio = 1.0
    self.extra_delay = 0.0
    self.noise_part = 1.0
    self.stiffness_estimate = self.stiffness
    self.delay_estimate = self.delay
    self.last_force = self.force
    self.believed = self.force
    self.equal = SLOWEST  # the first value may have begun before
    self.unseen = 0.0
    self.feedback = 0.0
    self.square = 0.0
    self.mean_square = 0.0
    self.square_fallback = 0.0
    self.alone = 0.0
    self.locked_time = 0.0
    self.wait = 0.0
    self.retry = RETRY
    self.wall_share = 0.0
    self.wall_judged = False
    initialize_inverse(self, self.heart_position)
    self.trust = 0.0
    self.feedforward = 0.0
    self.target_velocity = 0.0


def sense(self: LearnedControl, h: float) -> bool:
    """Take the force in; whether it is believed."""
    is_fresh = believe(self, h)
    self.stiffness_estimate = self.stiffness_ratio * self.stiffness
    held = (self.hold_periods - 1) * h
    self.delay_estimate = min(max(self.delay + self.extra_delay + held, h), (LINE - 2) * h)
    changing = 0.0 < self.wall_share < 1.0
    self.alone = self.alone + h if self.mode == SEARCHING and not changing else 0.0
    self.locked_time = self.locked_time + h if self.trust >= 1.0 else 0.0
    self.wait = max(self.wait - h, 0.0)
    if is_fresh:
        self.feedback = self.setpoint - self.believed
        judge(self, h)
    else:
        self.feedback *= exp(-h / FORGETTING)
    return is_fresh


def judge(self: LearnedControl, h: float) -> None:
    """Mean square of the force error over 2 s, and since fallback or learned motion has been alone."""
    square = self.feedback * self.feedback
    self.square += h / JUDGED * (square - self.square)
    since = max(self.alone, self.locked_time)
    if since <= JUDGED:
        self.mean_square = self.square
    else:
        self.mean_square += h / min(since, AVERAGED) * (square - self.mean_square)
    if self.alone > JUDGED:
        self.square_fallback = self.mean_square
        self.wall_judged = self.wall_share >= 1.0


def believe(self: LearnedControl, h: float) -> bool:
    """Return whether the force is plausible; the fallback uses every finite value."""
    if self.force == self.last_force:
        self.equal += 1
    else:
        self.hold_periods = min(self.hold_periods, self.equal + 1)
        self.equal = 0
    self.last_force = self.force
    change = abs(self.force - self.believed)
    likely = change <= self.change_maximum * self.hold_periods and self.equal < self.still * self.hold_periods
    if likely or (self.mode == SEARCHING and change < FARTHEST):
        self.believed = self.force
        self.unseen = 0.0
        return True
    self.unseen += h
    return False


def is_new(self: LearnedControl) -> bool:
    """Whether the force is a new one, and none that a slow sensor holds."""
    return self.equal % self.hold_periods == 0


def inferred_reference(self: LearnedControl, h: float) -> float:
    """Return y, the gripper position [m] that would have produced zero force error, inferred from demand and force."""
    return delayed(self, self.line, h) + (self.setpoint - self.believed) / self.stiffness_estimate


def delayed(self: LearnedControl, line: Any, h: float) -> float:
    """Return the value of a ring buffer `delay` ago."""
    return delayed_value(line, self.latest, self.delay_estimate / h, LINE)


def may_begin(self: LearnedControl) -> bool:
    """Return whether the learned motion may be tried; with a measured wall the fallback is observed first, for 10 s."""
    with_wall = self.wall_share > 0.0 or self.heart_status < 2
    return self.enable and self.wait <= 0.0 and not (with_wall and self.alone < AVERAGED)


def bearable(self: LearnedControl) -> bool:
    """Return whether the force is measured and the learned motion leaves no larger error than the fallback; if not, wait."""
    unknown = self.wall_share >= 1.0 and not self.wall_judged and self.locked_time > JUDGED
    if self.unseen > self.hold or unknown:
        return False
    limit = self.worse * self.square_fallback
    much = TWICE * limit if self.wall_judged else limit
    worse = self.locked_time > JUDGED and self.square > much
    worse = worse or (self.locked_time > 2.0 * AVERAGED and self.mean_square > limit)
    if worse and self.mode == FOLLOWING:
        self.wait = self.retry
        self.retry = min(2.0 * self.retry, RETRY_LATEST)
    return not worse


def gain_part(self: LearnedControl, h: float) -> float:
    """Part of the gain that leaves the margin, with dead time and stiffness as estimated."""
    dead_time = self.delay_estimate + LAG + 0.5 * (self.hold_periods - 1) * h
    part = min(1.0, PHASE_LOSS / max(self.proportional * self.stiffness_estimate * dead_time, 1e-9))
    return part if self.measured else min(part, CAUTION)


def wall_velocity(self: LearnedControl, h: float) -> float:
    """Return the feedforward of the paper's third controller [m/s] and update the share of that controller in the fallback."""
    is_valid = self.heart_status < 2
    if is_valid and self.wall_share <= 0.0:
        initialize_inverse(self, self.heart_position)
    step = h / self.blend
    self.wall_share = min(self.wall_share + step, 1.0) if is_valid else max(self.wall_share - step, 0.0)
    if not is_valid:
        return 0.0
    last = self.position_in
    advance_inverse(self, self.heart_position)
    return (self.position_in - last) / h


def command(self: LearnedControl, forward: float, h: float) -> None:
    """Feedback, the learned motion [m/s] as far as it is trusted, and as far as it is not, the measured wall's."""
    wanted = self.enable and self.mode == FOLLOWING
    step = h / self.blend
    self.trust = min(self.trust + step, 1.0) if wanted else max(self.trust - step, 0.0)
    self.feedforward = self.trust * min(max(forward, -self.forward_maximum), self.forward_maximum)
    wall = wall_velocity(self, h)
    fallback = (1.0 - self.trust) * self.wall_share
    ahead = self.feedforward + fallback * wall

    # dead time: demands that have not taken effect yet will reduce the error
    left = self.feedback - self.stiffness_estimate * (self.corrected - delayed(self, self.line_corrected, h))
    part = gain_part(self, h)
    gain = (1.0 - fallback) * part * self.proportional + fallback * self.proportional_wall
    velocity = gain * self.feedback + ahead
    velocity += self.trust * part * self.proportional_beyond * dead_zone(left, self.error_large / self.noise_part)
    most = h * self.acceleration_maximum
    velocity = min(max(velocity, self.target_velocity - most), self.target_velocity + most)
    self.target_velocity = min(max(velocity, -self.velocity_maximum), self.velocity_maximum)
    self.demand += h * self.target_velocity
    self.corrected += h * (self.target_velocity - ahead)
    self.latest = (self.latest + 1) % LINE
    self.line[self.latest] = self.demand
    self.line_corrected[self.latest] = self.corrected


def publish_state(self: LearnedControl, rate: float, disturbed: bool) -> None:
    """Publish the state."""
    self.rate = rate
    self.share = self.trust
    self.state = LOCKED
    if self.trust <= 0.0 and self.wait > 0.0:
        self.state = WORSE
    elif self.trust <= 0.0:
        self.state = WALL_ALONE if self.wall_share >= 1.0 else PI_ALONE
    elif self.unseen > 0.0:
        self.state = BLIND
    elif disturbed:
        self.state = DISTURBED
    elif self.trust < 1.0:
        self.state = FADING
