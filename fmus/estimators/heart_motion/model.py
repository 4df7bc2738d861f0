"""Heart motion estimator: unscented Kalman filter over the tracked tip."""

from math import floor, pi, sqrt

from fmus.beat_search import RING, TREND, BeatSearch, along, find_anchor, find_direction, forget, refine, remember, scan
from fmus.measured_motion import MeasuredMotion, forget_samples, measured_instead, smooth
from fmus.quasi_periodic import (
    HARMONICS,
    OFFSET,
    PHASE,
    RATE,
    N,
    QuasiPeriodic,
    ahead,
    amplitude,
    predict,
    renew,
    start,
)
from fmus.tracked_tip import TrackedTip, changed
from fmus.unscented import average, correct

from twin.component import Boolean, Int32, input, local, output, parameter

VALID, DEGRADED, LOST = 0, 1, 2
SEARCHING, FOLLOWING, LEAVING = 0, 1, 2
FARTHEST = 10.0  # [m]: no tip is farther from the frame's origin; what is not finite is not nearer either
OLDEST = 1.0  # [s]
SPACING = 39e-3  # [s] of what the search looks at: five seconds
PLAIN, CLEAR = 0.5, 0.25  # rest of the search with which a beat is there, rest of the last beats with which to begin
SHIFTS = 24  # phases that are tried after a disturbance
ADAPTING = 2.0  # [s] over which the noise is averaged
PASSING = 0.1  # [s] over which the strain is averaged
STRAINED, RELAXED, CAP = 6.0, 3.0, 25.0  # squared innovation over its variance: one on the average, if all is well

ODD = 0.05  # part of the beat's power in odd harmonics below which it is one of twice the rate: 0.15 and more at the right one
UNSURE = 0.5  # [rad] deviation of the phase from which it is looked for anew
STALE = 0.2  # [s] after which the latest sample of the ring says nothing of now
LONGEST_STEP = 10e-3  # [s] of the filter where no samples come
LONGEST = 8.0  # [s] that a ring of five seconds may span: not more than three were lost
MEMORY, TROUBLED = 5.0, 0.7  # [s], part of that time that disturbances may take before all is learned anew


class HeartMotion(TrackedTip, BeatSearch, QuasiPeriodic, MeasuredMotion):
    """Heart motion along its principal direction, learned from the tracked tip over some beats and predicted ahead.

    Al-Ahmad et al. (RACS), section IV.A: an unscented Kalman filter of a quasi-periodic motion; state of eq. (4).
    It publishes every millisecond, whenever samples come, so that differences over time have no steps.
    Zero until five seconds of motion are known, then blended in; where the tip is at rest there is nothing to learn.
    """

    period = 1e-3
    former_names = (
        ("lesson", "training_time"),
        ("patience", "max_disturbed_beats"),
        ("found_rate", "search_rate"),
        ("found_rest", "residual_power_ratio"),
        ("place", "sample"),
        ("taught", "trained_time"),
        ("strain", "nis"),
    )

    learn = input("", "whether samples are taken in; otherwise the learned motion is predicted", start=True, type=Boolean)
    enable = input("", "whether the estimate is published; otherwise it fades to zero", start=True, type=Boolean)

    position = output("m", "heart motion, `horizon` ahead; its mean while it was learned is zero", display_unit="mm")
    velocity = output("m/s", "its rate", display_unit="mm/s")
    phase = output("rad", "phase of the first harmonic at that time, from 0 to 2 pi")
    rate = output("Hz", "heart rate; 0: none yet")
    amplitude = output("m", "of each harmonic", shape=(HARMONICS,), display_unit="mm")
    respiration = output("m", "respiration's part of the motion", display_unit="mm")
    deviation = output("m", "standard deviation of the motion, as the filter sees it", display_unit="mm")
    innovation = output("m", "last sample minus what was expected of it", display_unit="mm")
    measured = output("m", "last sample along the direction", display_unit="mm")
    disturbed = output("", "whether samples are left out because the beat is not as learned", type=Boolean)
    direction = output("", "direction of the heart's motion, positive along `toward`", shape=(3,))
    search_rate = output("Hz", "heart rate of the search over the last seconds, independent of the filter; 0: none yet")
    residual_power_ratio = output("", "fraction of the motion's power that no beat at that rate explains")
    status = output("", "0 valid, 1 degraded: predicted, or in doubt; 2 lost", type=Int32)

    horizon = parameter(0.0, "s", "time by which the motion is ahead of the instant at which it is published",
                        display_unit="ms", source="0: the age of the samples is made up for, no lag of what follows")
    noise = parameter(0.6e-3, "m", "standard deviation of a valid sample", display_unit="mm", minimum=1e-5,
                      source="paper, section IV.C: 0.60 mm at the start, then as it is; a degraded one has twice as much")
    noise_minimum = parameter(0.15e-3, "m", "the least that is believed", display_unit="mm", minimum=1e-5,
                              source="estimate: a quarter of the paper's; beats differ by as much from their model")
    gate = parameter(4.0, "", "innovation in standard deviations from which a sample is an outlier", minimum=1.0,
                     source="chosen: one of 16000 good samples is lost")
    max_disturbed_beats = parameter(1.5, "", "beats that a disturbance may last before the phase is looked for anew", minimum=0.0,
                                    source="chosen: an ectopic beat and its pause are 1.3 to 1.6 beats from its onset")
    hold = parameter(30.0, "s", "time for which the motion is predicted without samples", minimum=0.0,
                     source="chosen: three of the paper's experiments; `deviation` shows its quality")
    training_time = parameter(0.0, "s", "time for which it only learns, to predict alone afterwards; 0: both all the time",
                              minimum=0.0, source="0: the tip moves with the wall; else seven seconds or more")
    blend = parameter(1.0, "s", "time in which the estimate fades in and out", minimum=1e-2,
                      source="chosen: as the heart's own blend-in")

    mode = local(SEARCHING, "", "0 searching, 1 following, 2 leaving", type=Int32)
    instant = local(0.0, "s", "instant that the filter's mean is for")
    age = local(0.0, "s", "age of the latest sample when it came")
    unseen = local(0.0, "s", "time without a sample that was taken in")
    level = local(0.0, "m^2", "variance of a valid sample, estimated from the innovations")
    nis = local(1.0, "", "squared innovation over its variance, averaged")
    disturbance = local(0.0, "s", "how long samples have been left out")
    trouble = local(0.0, "", "part of the last seconds that was disturbed")
    off_beat = local(False, "", "whether samples are left out", type=Boolean)
    sigma = local(0.0, "m", "standard deviation of the motion, as the filter sees it")
    off = local(0.0, "m", "latest innovation")
    sample = local(0.0, "m", "latest sample along the direction")
    trained_time = local(0.0, "s", "duration of the training so far")
    share = local(0.0, "", "part of the estimate that is published, before it is smoothed")
    doubt = local(0, "", "searches in a row that found another beat", type=Int32)
    anchored = local(False, "", "whether zero is fixed", type=Boolean)

    def initialize(self) -> None:
        forget(self)
        for i in range(3):
            self.last_position[i] = 0.0
            self.axis[i] = self.toward[i]
            self.anchor[i] = 0.0
        for i in range(N):
            self.mean[i] = 0.0
        self.mean[RATE] = 2.0 * pi
        self.anchored = False
        self.mode = SEARCHING
        self.instant = -OLDEST
        self.age = 0.0
        self.unseen = 0.0
        self.share = 0.0
        self.trained_time = 0.0
        self.doubt = 0
        self.nis = 1.0
        self.level = self.noise * self.noise
        self.disturbance = 0.0
        self.trouble = 0.0
        self.off_beat = False
        self.off = 0.0
        self.sample = 0.0
        forget_samples(self)
        self.sigma = 0.0
        publish(self, 0.0, 0.0)

    def step(self, t: float, h: float) -> None:
        self.trained_time += h
        is_usable = usable(self)
        if is_usable:
            self.age = self.tip_age
        at = t - self.age
        fresh = is_usable and at > self.instant + 1e-9 and changed(self)
        gained = fresh and remember(
            self, SPACING, at, self.tip_position[0], self.tip_position[1], self.tip_position[2]
        )
        if self.mode == SEARCHING:
            if fresh:
                self.instant = at
            search(self, at, gained)
        else:
            self.unseen += h
            follow(self, at, fresh, gained)
        publish(self, t, h)


def is_trained(self: HeartMotion) -> bool:
    """Return whether the training time is over and a beat was learned."""
    return self.trained_time > self.training_time and self.mode == FOLLOWING


def usable(self: HeartMotion) -> bool:
    """Return whether the input is a valid position and time; comparisons with NaN are false."""
    if not self.learn or (self.training_time > 0.0 and is_trained(self)):
        return False
    if not (self.tip_status == VALID or self.tip_status == DEGRADED):
        return False
    if not 0.0 <= self.tip_age <= OLDEST:
        return False
    near = True
    for i in range(3):
        near = near and abs(self.tip_position[i]) < FARTHEST
    return near


def search(self: HeartMotion, at: float, gained: bool) -> None:
    """Fill the ring, then try a rate at each call; begin with the one that explains at least half of the motion."""
    if gained and self.count == RING:
        find_direction(self, 1.0)
    stale = at > self.ring_time[self.head] + STALE
    if self.count < RING or stale or not scan(self, TREND):
        return
    if self.beat_rest < PLAIN:
        begin(self)


def begin(self: HeartMotion) -> None:
    """Start the filter from the fit over the ring."""
    if not self.anchored:
        find_anchor(self)
        self.anchored = True
    find_direction(self, 1.0)
    rate = refine(self, HARMONICS)
    if self.beat_rest > CLEAR:
        return
    start(self, self.fitted, TREND, rate)
    self.instant = self.ring_time[self.head]
    self.level = self.noise * self.noise
    self.mode = FOLLOWING
    self.unseen = 0.0
    self.nis = 1.0
    self.disturbance = 0.0
    self.trouble = 0.0
    self.off_beat = False
    self.doubt = 0
    self.candidate = 0


def follow(self: HeartMotion, at: float, fresh: bool, gained: bool) -> None:
    """One sample, or the time of one that did not come."""
    if self.mode == LEAVING and self.share <= 0.0:
        self.mode = SEARCHING
        self.candidate = 0
        self.trained_time = 0.0
        if at - self.ring_time[(self.head + 1) % RING] > LONGEST:
            forget(self)
        return
    elapsed = at - self.instant
    if fresh or elapsed > LONGEST_STEP:
        if not predict(self, elapsed):
            leave(self)
            return
        self.instant = at
        mean, variance = average(self.values, N)
        self.sigma = sqrt(variance)
        if fresh and self.mode == FOLLOWING:  # a correction would make the estimate jump while it fades out
            weigh(self, mean, variance, elapsed)
    if self.mode == FOLLOWING and gained and self.count == RING:
        find_direction(self, 0.02)
        watch(self)
        if self.disturbance * self.mean[RATE] > self.max_disturbed_beats * 2.0 * pi:
            realign(self)
    if self.mode == FOLLOWING and self.unseen > self.hold:
        leave(self)


def weigh(self: HeartMotion, mean: float, variance: float, elapsed: float) -> None:
    """Take a sample in, unless it is an outlier, or one of a beat that is not as learned."""
    self.sample = along(self, self.tip_position[0], self.tip_position[1], self.tip_position[2])
    self.off = self.sample - mean
    smooth(self, self.instant, self.sample)
    expected = variance
    variance += self.level if self.tip_status == VALID else 4.0 * self.level
    ratio = self.off * self.off / variance
    self.nis += min(elapsed / PASSING, 1.0) * (min(ratio, CAP) - self.nis)
    unsure = self.covariance[PHASE, PHASE] > UNSURE * UNSURE
    if self.off_beat:
        self.disturbance += elapsed
        self.off_beat = unsure or self.nis > RELAXED
    else:
        self.disturbance = 0.0
        self.off_beat = unsure or self.nis > STRAINED
    self.trouble += elapsed / MEMORY * ((1.0 if self.off_beat else 0.0) - self.trouble)
    if not self.off_beat and ratio <= self.gate * self.gate:
        correct(self.points, self.values, self.mean, self.covariance, self.gain, self.off, variance, N)
        self.unseen = 0.0
        if self.tip_status == VALID:
            self.level += min(elapsed / ADAPTING, 1.0) * (self.off * self.off - expected - self.level)
            self.level = max(self.level, self.noise_minimum * self.noise_minimum)


def doubtful(self: HeartMotion) -> bool:
    """Return whether the learned motion is implausible: an irregular beat, another rate found, or a rate outside the heart's range."""
    rate = self.mean[RATE] / (2.0 * pi)
    return self.off_beat or self.doubt > 0 or not 0.75 * self.rate_minimum < rate < 1.33 * self.rate_maximum


def is_half_rate(self: HeartMotion) -> bool:
    """Return whether nearly all of the beat is in even harmonics: then the heart beats at twice the filter's rate."""
    odd = self.amplitude[0] * self.amplitude[0] + self.amplitude[2] * self.amplitude[2]
    even = self.amplitude[1] * self.amplitude[1] + self.amplitude[3] * self.amplitude[3]
    return odd < ODD * (odd + even)


def watch(self: HeartMotion) -> None:
    """Continue the search in parallel to the filter; restart with half or twice the rate if it is found three times in a row.

    So is a beat that is mostly not as learned. Until the search explains enough of it, what is measured is published.
    """
    if not scan(self, TREND):
        return
    ratio = self.mean[RATE] / (2.0 * pi * self.beat_rate)
    if self.beat_rest < PLAIN and (ratio < 0.75 or (ratio > 1.33 and not explains_more(self))):
        self.doubt += 1
    else:
        self.doubt = 0
    if self.doubt >= 3 or self.trouble > TROUBLED:
        begin(self)


def explains_more(self: HeartMotion) -> bool:
    """Return whether the filter explains more of the motion than the search: half of a rate fits what the rate fits."""
    power = 0.0
    for i in range(HARMONICS):
        power += 0.5 * self.amplitude[i] * self.amplitude[i]
    return not self.off_beat and self.level < self.beat_rest * power


def realign(self: HeartMotion) -> None:
    """Look for the phase, and the offset, with which the last beat is as learned; else go on without samples."""
    least = 0.0
    best = 0
    best_mean = 0.0
    for trial in range(SHIFTS):
        square, mean = misfit(self, trial * 2.0 * pi / SHIFTS)
        if trial == 0 or square < least:
            least = square
            best = trial
            best_mean = mean
    if least > 9.0 * self.noise * self.noise:
        return
    self.mean[PHASE] += best * 2.0 * pi / SHIFTS
    self.mean[OFFSET] += best_mean
    renew(self, OFFSET, 1e-3)
    renew(self, RATE, 0.05 * self.mean[RATE])
    renew(self, PHASE, 0.2)
    self.nis = 1.0
    self.off_beat = False
    self.disturbance = 0.0


def misfit(self: HeartMotion, shift: float) -> tuple[float, float]:
    """Variance [m2] and mean [m] of the last beat's samples minus the model with a shifted phase."""
    total = 0.0
    square = 0.0
    count = 0
    for k in range(RING):
        since = self.ring_time[k] - self.instant
        if since * self.mean[RATE] > -2.0 * pi:
            expected, _, _ = ahead(self, since, shift)
            off = self.along[k] - expected
            total += off
            square += off * off
            count += 1
    if count < 3:
        return 1.0, 0.0
    mean = total / count
    return square / count - mean * mean, mean


def leave(self: HeartMotion) -> None:
    """Fade out, then search anew."""
    self.mode = LEAVING
    self.doubt = 0
    self.off_beat = False


def publish(self: HeartMotion, t: float, h: float) -> None:
    """Outputs for the end of the step and the horizon."""
    step = h / self.blend
    before = self.share
    wanted = self.enable and self.mode == FOLLOWING and (self.training_time <= 0.0 or is_trained(self))
    self.share = min(before + step, 1.0) if wanted else max(before - step, 0.0)
    part = self.share * self.share * (3.0 - 2.0 * self.share)
    growth = 6.0 * self.share * (1.0 - self.share) * (self.share - before) / max(h, 1e-9)
    tau = t + h + self.horizon - self.instant
    position, velocity, breath = ahead(self, tau, 0.0)
    position, velocity = measured_instead(self, doubtful(self), t + h + self.horizon, h, position, velocity)
    self.position = part * position
    self.velocity = part * velocity + growth * position
    turns = (self.mean[PHASE] + self.mean[RATE] * tau) / (2.0 * pi)
    self.phase = 2.0 * pi * (turns - floor(turns))
    self.respiration = part * breath
    for i in range(HARMONICS):
        self.amplitude[i] = amplitude(self, i)
    for i in range(3):
        self.direction[i] = self.axis[i]
    self.search_rate = self.beat_rate
    self.residual_power_ratio = self.beat_rest
    self.deviation = self.sigma
    self.innovation = self.off
    self.measured = self.sample
    self.disturbed = self.off_beat
    is_following = self.mode == FOLLOWING
    self.rate = self.mean[RATE] / (2.0 * pi) if is_following else 0.0
    self.status = LOST
    if is_following:
        sure = self.unseen < PASSING and not doubtful(self) and not is_half_rate(self)
        self.status = VALID if sure else DEGRADED
