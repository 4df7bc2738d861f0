"""Force control that learns the gripper's trajectory over the phase of the beat."""

from math import pi

from fmus.beat_search import REFINED, RING, TREND, BeatSearch, fit, fix_direction, forget, remember, scan
from fmus.learned_control import (
    AVERAGED,
    FOLLOWING,
    JUDGED,
    LEAVING,
    SEARCHING,
    SPACING,
    LearnedControl,
    bearable,
    begin_control,
    command,
    delayed,
    inferred_reference,
    is_new,
    may_begin,
    publish_state,
    sense,
)
from fmus.phase_filter import (
    BREATH,
    BREATH_RATE,
    COLOR,
    DELAY,
    HARMONICS,
    OFFSET,
    PHASE,
    QUADRATURE,
    RATE,
    STIFFNESS,
    PhaseFilter,
    begin_filter,
    clear_profile,
    correct,
    correlate,
    harmonics,
    healthy,
    learn,
    look,
    moved,
    predict,
    renew,
    required,
)

from twin.component import Boolean, Int64, local, output, parameter

BREATHS = 6  # coefficients of the trend in the search: 4.5 s hold two breaths at 30 a minute, which a cubic does not follow
WALL = 2  # column of the search's ring; the others are its derivatives
TERMS = TREND + 2 * HARMONICS
OTHER, THRICE = 0.25, 3  # part by which the rate found must differ from the one followed, and how often, to begin anew
MEAN_RATE = 2.0  # [s] over which the rate followed is averaged for that
SHORT = 1.2  # [s] of memory, at least, of the last fit: 35 samples for its 12 coefficients
NEAR = 0.08  # part of a rate within which others are tried, over the last two beats
CLEAR, UNCLEAR = 0.1, 0.25  # rest of the search with which to begin: at first, since with 0.25 one of 60 starts with respiration goes wrong,
PATIENT = 8.0  # and after so long [s], since a heart whose every second beat is early never is as clear
PASSING = 0.1  # [s] over which the normalized innovation squared (NIS) is averaged
STRAINED, RELAXED, CAP = 1.0, 0.5, 25.0  # NIS of a beat that is not as learned, and is again; a third is usual
GATE = 3.0  # innovation in standard deviations from which the filter takes no sample in
SHIFTS = 32  # phases around the circle that are compared
WINDOW, FOUR = 0.02, 0.25  # [s] over which they are, and part of a sample: four samples at least
CLEARLY, FITTING = 0.3, 4.0  # what a new phase leaves, as part of what the old one does, and at most, over the noise's variance
SETTLED = 1.0  # [s] for which nothing leaps after it has faded in: a plant unlike the nominal one looks like another phase
WHITE = 0.5  # part of the variance of `noise` that may be the sensor's own, the rest is friction; 3 mN are a third
FEWEST, MOST = 20, 400  # samples over which the sensor's noise is averaged, at first and at last
SLOW, SLOWLY = 2, 0.3  # periods that a sensor may hold a value, and part of what is learned from one that holds it longer
AFTER = 0.05  # doubt of the rate after a leap, as part of it: a leap of the phase is not one of the rate
PAUSE = 1.5  # beats for which nothing is learned after an unrest: an early beat and its pause last 1.3 to 1.6


class PhaseDomainRepetitiveControl(LearnedControl, BeatSearch, PhaseFilter):
    """Force controller that finds the beat in the force, and learns where the gripper has to be at each phase.

    Repetitive control over the phase of an extended Kalman filter; equations in the README.
    A beat that comes early is known when it is there: 70 mN once.
    """

    former_names = (("strain", "nis"), ("calm", "beats_since_disturbance"))

    phase = output("rad", "phase of the first harmonic, from 0 to 2 pi")
    nis = output(
        "", "squared innovation over its variance, averaged; a third is usual, above one the beat is not as learned"
    )
    breath_rate_estimate = output("Hz", "rate of respiration; without any, without meaning")

    noise = parameter(
        0.5e-3,
        "m",
        "standard deviation of a sample, to begin with and at least",
        display_unit="mm",
        minimum=1e-6,
        source="estimate: 3 mN of the sensor over the stiffness, and as much again for friction",
    )

    play = parameter(
        2.1e-3,
        "m",
        "motion of the gripper to either side that the tip does not follow",
        display_unit="mm",
        minimum=0.0,
        source="half of the 4.4 mm by which gripper and tip differ in beyond_paper; 1.5 to 2.7 mm do too",
    )

    tip = local(0.0, "m", "place of the tip, by demand and play", display_unit="mm")
    speed = local(0.0, "m/s", "speed of the tip", display_unit="mm/s")
    changes = local(0.0, "", "derivatives of the last fit by relative stiffness, and by delay", shape=(2, TERMS))
    change = local(0.0, "", "one of them", shape=(TERMS,))
    white = local(0.0, "m^2", "variance of the sensor's noise, from differences of innovations")
    samples = local(0.0, "", "samples over which that is averaged")
    rate_mean = local(0.0, "Hz", "rate followed, averaged")
    others = local(0, "", "times in a row that another rate was found", type=Int64)
    unrest = local(0.0, "", "squared innovation over its variance, averaged")
    off = local(0.0, "m", "latest innovation", display_unit="mm")
    beats_since_disturbance = local(0.0, "", "beats since the model last failed to explain the force")
    nearby = local(-1, "", "rate near the one found whose turn it is; -1: none is found yet", type=Int64)
    nearest = local(0.0, "Hz", "the best of these")
    rest_least = local(0.0, "m^2", "mean square that it leaves")
    misfit = local(
        0.0, "m^2", "mean square of what phases around the circle leave of the last samples", shape=(SHIFTS,)
    )
    off_beat = local(False, "", "whether the beat is not as learned", type=Boolean)

    def initialize(self) -> None:
        begin_control(self)
        self.tip = 0.0
        fix_direction(self)
        self.unrest = RELAXED
        self.off_beat = False
        self.off = 0.0
        forget(self)
        start_search(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        is_fresh = sense(self, h)
        reference = inferred_reference(self, h)
        last = self.tip
        wall = reference - play_residual(self, h)
        self.speed = (self.tip - last) / h
        new = is_fresh and is_new(self)
        by_stiffness = -self.feedback / self.stiffness_estimate / self.stiffness_ratio
        if new and remember(self, SPACING, t, by_stiffness, -self.speed, wall):
            self.along[self.head] = self.ring[self.head, WALL]
        search(self, t)
        if self.mode != SEARCHING:
            follow(self, reference, wall, new, h)
        command(self, forward(self, h), h)
        publish(self)


def play_residual(self: PhaseDomainRepetitiveControl, h: float) -> float:
    """Return the part of the delayed demand that the play operator absorbs [m]."""
    demand = delayed(self, self.line, h)
    self.tip = min(max(self.tip, demand - self.play), demand + self.play)
    return demand - self.tip


def start_search(self: PhaseDomainRepetitiveControl) -> None:
    """Forget the beat, but not the last seconds: a new search may begin at once."""
    self.candidate = 0
    self.mean[PHASE] = 0.0
    self.mean[RATE] = 0.0
    self.mean[STIFFNESS] = 1.0
    self.mean[DELAY] = 0.0
    self.stiffness_ratio = 1.0
    self.extra_delay = 0.0
    self.measured = False
    self.noise_part = 1.0
    self.nearby = -1
    self.mode = SEARCHING


def search(self: PhaseDomainRepetitiveControl, t: float) -> None:
    """With a full ring, try a rate at each call; begin with the one that explains most of the last two beats.

    It goes on while a beat is followed: the filter may have lost it and be content.
    """
    blocked = self.mode == LEAVING or (self.mode == SEARCHING and not may_begin(self))
    if blocked or not self.enable or self.count < RING:
        return
    if self.nearby < 0:
        if scan(self, BREATHS) and has_beat(self):
            self.nearby = 0
    elif self.nearby < REFINED:
        rate = self.beat_rate * (1.0 + NEAR * (2.0 * self.nearby / (REFINED - 1.0) - 1.0))
        rest = fit(self, rate, TREND, HARMONICS, max(2.0 / self.beat_rate, SHORT))
        if self.nearby == 0 or rest < self.rest_least:
            self.rest_least = rest
            self.nearest = rate
        self.nearby += 1
    elif self.nearby < REFINED + 2:
        column = self.nearby - REFINED
        choose_column(self, column)
        fit(self, self.nearest, TREND, HARMONICS, max(2.0 / self.nearest, SHORT))
        for i in range(TREND + 2 * HARMONICS):
            self.changes[column, i] = self.fitted[i]
        choose_column(self, WALL)
        self.nearby += 1
    else:
        fit(self, self.nearest, TREND, HARMONICS, max(2.0 / self.nearest, SHORT))
        begin(self, t - self.ring_time[self.head])


def choose_column(self: PhaseDomainRepetitiveControl, column: int) -> None:
    """Let the search look at the wall's motion, or at its derivative by stiffness or delay."""
    for k in range(RING):
        self.along[k] = self.ring[k, column]


def has_beat(self: PhaseDomainRepetitiveControl) -> bool:
    """Whether the scan that has ended is a reason to begin."""
    if self.mode == SEARCHING:
        return self.beat_rest <= (CLEAR if self.alone < PATIENT else UNCLEAR)
    other = abs(self.rate_mean - self.beat_rate) > OTHER * self.beat_rate and self.beat_rest <= CLEAR
    self.others = self.others + 1 if other else 0
    return self.others >= THRICE


def begin(self: PhaseDomainRepetitiveControl, age: float) -> None:
    """Follow the beat that was fitted last, to a sample of some age [s]."""
    clear_profile(self)
    begin_filter(self, self.fitted, TREND, self.nearest)
    if self.beat_rest > CLEAR:
        # what is irregular would be taken for another plant
        renew(self, STIFFNESS, 0.0)
        renew(self, DELAY, 0.0)
    else:
        for i in range(TREND + 2 * HARMONICS):
            self.change[i] = self.changes[0, i]
        correlate(self, STIFFNESS, self.fitted, self.change, TREND)
        for i in range(TREND + 2 * HARMONICS):
            self.change[i] = self.changes[1, i]
        correlate(self, DELAY, self.fitted, self.change, TREND)
    self.mean[PHASE] += self.mean[RATE] * age
    self.nearby = -1
    self.others = 0
    self.rate_mean = self.nearest
    self.unrest = RELAXED
    self.off_beat = False
    self.white = WHITE * self.noise * self.noise
    self.samples = FEWEST
    self.beats_since_disturbance = PAUSE
    for j in range(SHIFTS):
        self.misfit[j] = 0.0
    self.mode = FOLLOWING


def follow(self: PhaseDomainRepetitiveControl, reference: float, wall: float, new: bool, h: float) -> None:
    """Predict, update with a new sample and learn from it; give up a model that does not explain the force."""
    predict(self, h)
    self.rate_mean += h / MEAN_RATE * (self.mean[RATE] / (2.0 * pi) - self.rate_mean)
    expected, variance = look(self, self.tip, self.speed)
    if new:
        take(self, self.feedback / self.stiffness - expected, variance, wall, self.hold_periods * h)
        if self.beats_since_disturbance >= PAUSE:
            common = self.mean[OFFSET] + self.mean[BREATH] + harmonics(self, self.mean[PHASE])
            learn(self, reference - common, wall - common, self.noise_part, self.hold_periods * h)
    self.stiffness_ratio = self.mean[STIFFNESS]
    self.extra_delay = self.mean[DELAY]
    self.measured = self.measured or self.trust >= 1.0
    within = 0.5 * self.rate_minimum < self.mean[RATE] / (2.0 * pi) < 1.5 * self.rate_maximum
    if not (bearable(self) and within and healthy(self)):
        self.mode = LEAVING
    if self.mode == LEAVING and self.trust <= 0.0:
        start_search(self)


def take(self: PhaseDomainRepetitiveControl, off: float, variance: float, wall: float, h: float) -> None:
    """Judge an innovation [m] of which the filter expects a variance [m2], and take it in."""
    loud = loudness(self)
    nis = off * off / (variance + loud)
    variance += max((1.0 - WHITE) * self.noise * self.noise + self.white, self.noise * self.noise)
    ratio = off * off / variance
    self.unrest += h / PASSING * (min(nis, CAP) - self.unrest)
    self.off_beat = self.unrest > (RELAXED if self.off_beat else STRAINED)
    compare(self, wall, h)

    # at the start a plant unlike the nominal one raises the NIS: this identifies the plant
    usual = not self.off_beat or self.locked_time < JUDGED
    if usual:
        change = 0.5 * (off - self.off) * (off - self.off)
        self.samples = min(self.samples + 1.0, MOST)
        self.white += (min(change, GATE * GATE * self.white) - self.white) / self.samples
    self.off = off
    if ratio <= GATE * GATE:
        correct(self, off, variance, usual and self.locked_time < AVERAGED)
    self.noise_part = self.noise / loud**0.5
    if self.hold_periods > SLOW:
        self.noise_part *= SLOWLY
    self.beats_since_disturbance = 0.0 if self.off_beat else self.beats_since_disturbance + self.mean[RATE] * h / (2.0 * pi)
    if self.off_beat and self.locked_time >= SETTLED:
        realign(self)


def loudness(self: PhaseDomainRepetitiveControl) -> float:
    """Variance [m2] that an innovation may have if all is well: friction and play are as loud as usual, over the sensor's."""
    return max(self.noise * self.noise, self.white / WHITE)


def compare(self: PhaseDomainRepetitiveControl, wall: float, h: float) -> None:
    """What each of the phases around the circle would have left of the last samples."""
    part = min(h / WINDOW, FOUR)
    for j in range(SHIFTS):
        phase = self.mean[PHASE] + 2.0 * pi * j / SHIFTS
        rest = wall - self.mean[OFFSET] - self.mean[BREATH] - moved(self, phase)
        self.misfit[j] += part * (rest * rest - self.misfit[j])


def realign(self: PhaseDomainRepetitiveControl) -> None:
    """Leap to the phase that explains the last samples, if one does and the filter's does not."""
    best = 0
    for j in range(1, SHIFTS):
        if self.misfit[j] < self.misfit[best]:
            best = j
    least = self.misfit[best]
    if best == 0 or least > CLEARLY * self.misfit[0] or least > FITTING * loudness(self):
        return
    self.mean[PHASE] += 2.0 * pi * best / SHIFTS
    if self.mean[PHASE] > 2.0 * pi:
        self.mean[PHASE] -= 2.0 * pi
    self.mean[COLOR] = 0.0
    renew(self, PHASE, 2.0 * pi / SHIFTS)
    renew(self, RATE, AFTER * self.mean[RATE])
    for j in range(SHIFTS):
        self.misfit[j] = least
    self.unrest = RELAXED
    self.off_beat = False


def forward(self: PhaseDomainRepetitiveControl, h: float) -> float:
    """Return the speed of the learned trajectory [m/s] at the time when the present demand takes effect."""
    if self.mode == SEARCHING:
        return 0.0
    ahead = self.mean[PHASE] + self.mean[RATE] * (self.delay_estimate + self.lead)
    beat = (required(self, ahead) - required(self, ahead - self.mean[RATE] * h)) / h
    return beat + self.mean[BREATH_RATE] * self.mean[QUADRATURE]


def publish(self: PhaseDomainRepetitiveControl) -> None:
    """Publish the state."""
    self.phase = self.mean[PHASE]
    self.breath_rate_estimate = self.mean[BREATH_RATE] / (2.0 * pi)
    self.nis = self.unrest
    self.innovation = self.off
    publish_state(self, self.mean[RATE] / (2.0 * pi), self.off_beat)
