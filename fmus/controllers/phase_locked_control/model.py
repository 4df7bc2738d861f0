"""Force control that learns the gripper's trajectory over the phase of the beat."""

from math import pi

from fmus.beat_search import REFINED, RING, TREND, BeatSearch, fit, forget, remember, scan
from fmus.learned_control import (
    FOLLOWING,
    LEAVING,
    SEARCHING,
    SPACING,
    LearnedControl,
    bearable,
    begin_control,
    command,
    felt,
    is_new,
    place_wanted,
    sense,
    tell,
)
from fmus.phase_filter import (
    BREATH,
    COLOR,
    HARMONICS,
    OFFSET,
    PHASE,
    QUADRATURE,
    BREATH_RATE,
    LATER,
    RATE,
    STIFFER,
    PhaseFilter,
    begin_filter,
    clear_profile,
    correct,
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

BREATHS = 6
NEAR = 0.08  # part of a rate within which others are tried, over the last two beats
CLEAR, UNCLEAR = 0.1, 0.25  # rest of the search with which to begin: at first, since with 0.25 one of 60 starts with respiration goes wrong,
PATIENT = 8.0  # and after so long [s], since a heart whose every second beat is early never is as clear
PASSING = 0.1  # [s] over which the strain is averaged
STRAINED, RELAXED, CAP = 1.0, 0.5, 25.0  # strain of a beat that is not as learned, and is again; a third is usual
GATE = 3.0  # innovation in standard deviations from which the filter takes no sample in
SHIFTS = 32  # phases around the circle that are compared
WINDOW = 0.02  # [s] over which they are: four samples
CLEARLY, FITTING = 0.3, 1e-3  # what a new phase leaves, as part of what the old one does, and at most [m]
AFTER = 0.05  # doubt of the rate after a leap, as part of it: a leap of the phase is not one of the rate
PAUSE = 1.5  # beats for which nothing is learned after an unrest: an early beat and its pause last 1.3 to 1.6


class PhaseLockedControl(LearnedControl, BeatSearch, PhaseFilter):
    """Force controller that finds the beat in the force, and learns where the gripper has to be at each phase.

    Repetitive control over the phase of an extended Kalman filter; equations in the README.
    A beat that comes early is known when it is there: 70 mN once.
    """

    phase = output("rad", "phase of the first harmonic, from 0 to 2 pi")
    strain = output(
        "", "squared innovation over its variance, averaged; a third is usual, above one the beat is not as learned"
    )

    breath_seen = output("Hz", "TODO")
    noise = parameter(
        0.5e-3,
        "m",
        "standard deviation of a sample",
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
    white = local(0.0, "m^2", "TODO")
    cautious = local(1.0, "", "TODO")
    caution = parameter(1.0, "", "TODO", source="x")
    speed = local(0.0, "m/s", "of the tip", display_unit="mm/s")
    unrest = local(0.0, "", "squared innovation over its variance, averaged")
    off = local(0.0, "m", "latest innovation", display_unit="mm")
    calm = local(0.0, "", "beats since the model last failed to explain the force")
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
        for i in range(3):
            self.anchor[i] = 0.0
            self.axis[i] = 1.0 if i == 2 else 0.0
        self.unrest = RELAXED
        self.off_beat = False
        self.off = 0.0
        forget(self)
        start_search(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        seen = sense(self, h)
        place = place_wanted(self, h)
        last = self.tip
        wall = place - kept(self, h)
        self.speed = (self.tip - last) / h
        fresh = seen and is_new(self)
        if fresh and remember(self, SPACING, t, 0.0, 0.0, wall):
            self.along[self.head] = self.ring[self.head, 2]
        if self.mode == SEARCHING:
            search(self)
        else:
            follow(self, place, wall, fresh, h)
        command(self, forward(self, h), h)
        publish(self)


def kept(self: PhaseLockedControl, h: float) -> float:
    """What friction and play keep of the demand that is felt now [m]."""
    asked = felt(self, self.line, h)
    self.tip = min(max(self.tip, asked - self.play), asked + self.play)
    return asked - self.tip


def start_search(self: PhaseLockedControl) -> None:
    """Forget the beat, but not the last seconds: a new search may begin at once."""
    self.candidate = 0
    clear_profile(self)
    self.mean[PHASE] = 0.0
    self.mean[RATE] = 0.0
    self.mean[STIFFER] = 1.0
    self.mean[LATER] = 0.0
    self.nearby = -1
    self.mode = SEARCHING


def search(self: PhaseLockedControl) -> None:
    """With a full ring, try a rate at each call; begin with the one that explains most of the last two beats."""
    if not self.enable or self.count < RING:
        return
    if self.nearby < 0:
        if scan(self, BREATHS) and self.beat_rest <= (CLEAR if self.alone < PATIENT else UNCLEAR):
            self.nearby = 0
    elif self.nearby < REFINED:
        rate = self.beat_rate * (1.0 + NEAR * (2.0 * self.nearby / (REFINED - 1.0) - 1.0))
        rest = fit(self, rate, TREND, HARMONICS, 2.0 / self.beat_rate)
        if self.nearby == 0 or rest < self.rest_least:
            self.rest_least = rest
            self.nearest = rate
        self.nearby += 1
    else:
        fit(self, self.nearest, TREND, HARMONICS, 2.0 / self.nearest)
        begin(self)


def begin(self: PhaseLockedControl) -> None:
    """Follow the beat that was fitted last."""
    begin_filter(self, self.fitted, TREND, self.nearest)
    self.unrest = RELAXED
    self.off_beat = False
    self.white = max(0.33 * self.noise * self.noise, 2.2 * self.rest_least)
    self.calm = PAUSE
    for j in range(SHIFTS):
        self.misfit[j] = 0.0
    self.mode = FOLLOWING


def follow(self: PhaseLockedControl, place: float, wall: float, seen: bool, h: float) -> None:
    """Predict, take the sample in and learn from it; give up what does not explain the force."""
    predict(self, h)
    expected, variance = look(self, self.tip, self.speed)
    if seen:
        variance += noise_square(self)
        last = self.off
        self.off = self.feedback / self.stiffness - expected
        ratio = self.off * self.off / variance
        strain = self.off * self.off / (variance - noise_square(self) + max(self.noise * self.noise, 3.0 * self.white))
        s = self.run * h
        self.unrest += s / PASSING * (min(strain, CAP) - self.unrest)
        self.off_beat = self.unrest > (RELAXED if self.off_beat else STRAINED)
        compare(self, wall, s)
        change = 0.5 * (self.off - last) * (self.off - last)
        self.white += s / 2.0 * (min(change, 9.0 * self.white) - self.white)
        if ratio <= GATE * GATE:
            correct(self, self.off, variance)
            self.mean[STIFFER] = min(max(self.mean[STIFFER], 0.3), 4.0)
            self.mean[LATER] = min(max(self.mean[LATER], -0.01), 0.06)
            self.mean[BREATH_RATE] = min(max(self.mean[BREATH_RATE], 0.5), 3.5)
        self.calm = 0.0 if self.off_beat else self.calm + self.mean[RATE] * s / (2.0 * pi)
        if self.off_beat:
            realign(self)
        if self.calm >= PAUSE:
            common = self.mean[OFFSET] + self.mean[BREATH] + harmonics(self, self.mean[PHASE])
            self.cautious = min(1.0, (3.0*self.white)**-0.5*self.noise) if self.caution else 1.0
            learn(self, place - common, wall - common, s)
    within = 0.5 * self.rate_minimum < self.mean[RATE] / (2.0 * pi) < 1.5 * self.rate_maximum
    if not (within and bearable(self) and healthy(self)):
        self.mode = LEAVING
    if self.mode == LEAVING and self.trust <= 0.0:
        start_search(self)


def noise_square(self: PhaseLockedControl) -> float:
    return max(0.67 * self.noise * self.noise + self.white, self.noise * self.noise)


def compare(self: PhaseLockedControl, wall: float, h: float) -> None:
    """What each of the phases around the circle would have left of the last samples."""
    for j in range(SHIFTS):
        phase = self.mean[PHASE] + 2.0 * pi * j / SHIFTS
        rest = wall - self.mean[OFFSET] - self.mean[BREATH] - moved(self, phase)
        self.misfit[j] += h / WINDOW * (rest * rest - self.misfit[j])


def realign(self: PhaseLockedControl) -> None:
    """Leap to the phase that explains the last samples, if one does and the filter's does not."""
    best = 0
    for j in range(1, SHIFTS):
        if self.misfit[j] < self.misfit[best]:
            best = j
    least = self.misfit[best]
    if best == 0 or least > CLEARLY * self.misfit[0] or least > 4.0 * max(self.noise * self.noise, 3.0 * self.white):
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


def forward(self: PhaseLockedControl, h: float) -> float:
    """Speed of what was learned [m/s], when the demand of now will be felt."""
    ahead = self.mean[PHASE] + self.mean[RATE] * (self.delay + self.mean[LATER] + self.lead)
    beat = (required(self, ahead) - required(self, ahead - self.mean[RATE] * h)) / h
    return beat + self.mean[BREATH_RATE] * self.mean[QUADRATURE]


def publish(self: PhaseLockedControl) -> None:
    """What is told about it."""
    self.phase = self.mean[PHASE]
    self.stiffness_seen = self.mean[STIFFER] * self.stiffness
    self.delay_seen = self.mean[LATER] + self.delay
    self.breath_seen = self.mean[BREATH_RATE] / (2.0 * pi)
    self.strain = self.unrest
    self.innovation = self.off
    tell(self, self.mean[RATE] / (2.0 * pi), self.off_beat)
