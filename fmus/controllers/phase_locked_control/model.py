"""Force control that learns the gripper's trajectory over the phase of the beat."""

from math import pi

from fmus.beat_search import RING, TREND, BeatSearch, fit, forget, remember, scan
from fmus.learned_control import (
    FOLLOWING,
    LEAVING,
    SEARCHING,
    LearnedControl,
    bearable,
    begin_control,
    command,
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
    RATE,
    PhaseFilter,
    begin_filter,
    clear_profile,
    correct,
    healthy,
    learn,
    look,
    predict,
    renew,
    required,
)

from twin.component import Boolean, local, output, parameter

CLEAR = 0.25  # rest of the search with which to begin
PASSING = 0.1  # [s] over which the strain is averaged
STRAINED, RELAXED, CAP = 1.0, 0.5, 25.0  # strain of a beat that is not as learned, and is again; a third is usual
GATE = 3.0  # innovation in standard deviations from which the filter takes no sample in
SHIFTS = 32  # phases around the circle that are compared
WINDOW = 0.02  # [s] over which they are: four samples
CLEARLY, FITTING = 0.3, 1e-3  # what a new phase leaves, as part of what the old one does, and at most [m]
AFTER = 0.05  # doubt of the rate after a leap, as part of it: a leap of the phase is not one of the rate
YOUNG = 6.0  # beats of learning before which every beat differs from what was learned
PAUSE = 1.5  # beats for which nothing is learned after an unrest: an early beat and its pause last 1.3 to 1.6
LONG_RUN = 3.0  # beats over which the rate is averaged, for the time after a leap


class PhaseLockedControl(LearnedControl, BeatSearch, PhaseFilter):
    """Force controller that finds the beat in the force, and learns where the gripper has to be at each phase.

    Repetitive control over the phase of an extended Kalman filter; equations in the README.
    A beat that comes early is known when it is there: 70 mN once.
    """

    phase = output("rad", "phase of the first harmonic, from 0 to 2 pi")
    strain = output("", "squared innovation over its variance, averaged; a third is usual, above one the beat is not as learned")

    noise = parameter(0.5e-3, "m", "standard deviation of a sample", display_unit="mm", minimum=1e-6,
                      source="estimate: 3 mN of the sensor over the stiffness, and as much again for friction")

    unrest = local(0.0, "", "squared innovation over its variance, averaged")
    off = local(0.0, "m", "latest innovation", display_unit="mm")
    calm = local(0.0, "", "beats since the model last failed to explain the force")
    rate_mean = local(0.0, "rad/s", "rate of the last beats")
    misfit = local(0.0, "m^2", "mean square of what phases around the circle leave of the last samples", shape=(SHIFTS,))
    off_beat = local(False, "", "whether the beat is not as learned", type=Boolean)

    def initialize(self) -> None:
        begin_control(self)
        for i in range(3):
            self.anchor[i] = 0.0
            self.axis[i] = 1.0 if i == 2 else 0.0
        self.unrest = RELAXED
        self.off_beat = False
        self.off = 0.0
        start_search(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        seen = sense(self, h)
        place = place_wanted(self, h)
        if self.mode == SEARCHING:
            search(self, t, place)
        else:
            follow(self, place, seen, h)
        command(self, forward(self, h), h)
        publish(self)


def start_search(self: PhaseLockedControl) -> None:
    """Forget the beat."""
    forget(self)
    clear_profile(self)
    self.mean[PHASE] = 0.0
    self.mean[RATE] = 0.0
    self.mode = SEARCHING


def search(self: PhaseLockedControl, t: float, place: float) -> None:
    """Fill the ring, then try a rate at each call; begin with the one that explains most of the motion."""
    if remember(self, t, 0.0, 0.0, place):
        self.along[self.head] = self.ring[self.head, 2]
    if not self.enable or self.count < RING or not scan(self) or self.beat_rest > CLEAR:
        return
    fit(self, self.beat_rate, HARMONICS, 2.0 / self.beat_rate)
    begin_filter(self, self.fitted, TREND, self.beat_rate)
    self.unrest = RELAXED
    self.off_beat = False
    self.calm = PAUSE
    self.rate_mean = self.mean[RATE]
    for j in range(SHIFTS):
        self.misfit[j] = 0.0
    self.mode = FOLLOWING


def follow(self: PhaseLockedControl, place: float, seen: bool, h: float) -> None:
    """Predict, take the sample in and learn from it; give up what does not explain the force."""
    predict(self, h)
    expected, variance = look(self)
    if seen:
        variance += self.noise * self.noise
        self.off = place - expected
        ratio = self.off * self.off / variance
        self.unrest += h / PASSING * (min(ratio, CAP) - self.unrest)
        young = self.lessons < YOUNG
        self.off_beat = self.unrest > (RELAXED if self.off_beat else STRAINED)
        compare(self, place, h)
        if young or ratio <= GATE * GATE:
            correct(self, self.off, variance)
        turn = self.mean[RATE] * h / (2.0 * pi)
        self.rate_mean += turn / LONG_RUN * (self.mean[RATE] - self.rate_mean)
        self.calm = 0.0 if self.off_beat else self.calm + turn
        if self.off_beat:
            realign(self)
        if young or self.calm >= PAUSE:
            learn(self, place - self.mean[OFFSET] - self.mean[BREATH] - required(self, self.mean[PHASE]), h)
    within = 0.5 * self.rate_minimum < self.mean[RATE] / (2.0 * pi) < 1.5 * self.rate_maximum
    if not (within and bearable(self) and healthy(self)):
        self.mode = LEAVING
    if self.mode == LEAVING and self.trust <= 0.0:
        start_search(self)


def compare(self: PhaseLockedControl, place: float, h: float) -> None:
    """What each of the phases around the circle would have left of the last samples."""
    for j in range(SHIFTS):
        phase = self.mean[PHASE] + 2.0 * pi * j / SHIFTS
        rest = place - self.mean[OFFSET] - self.mean[BREATH] - required(self, phase)
        self.misfit[j] += h / WINDOW * (rest * rest - self.misfit[j])


def realign(self: PhaseLockedControl) -> None:
    """Leap to the phase that explains the last samples, if one does and the filter's does not."""
    best = 0
    for j in range(1, SHIFTS):
        if self.misfit[j] < self.misfit[best]:
            best = j
    least = self.misfit[best]
    if least > CLEARLY * self.misfit[0] or least > FITTING * FITTING:
        return
    self.mean[PHASE] += 2.0 * pi * best / SHIFTS
    if self.mean[PHASE] > 2.0 * pi:
        self.mean[PHASE] -= 2.0 * pi
    self.mean[COLOR] = 0.0
    renew(self, PHASE, 2.0 * pi / SHIFTS)
    self.mean[RATE] = self.rate_mean
    renew(self, RATE, AFTER * self.mean[RATE])
    for j in range(SHIFTS):
        self.misfit[j] = least
    self.unrest = RELAXED
    self.off_beat = False


def forward(self: PhaseLockedControl, h: float) -> float:
    """Speed of what was learned [m/s], when the demand of now will be felt."""
    ahead = self.mean[PHASE] + self.mean[RATE] * (self.delay + self.lead)
    beat = (required(self, ahead) - required(self, ahead - self.mean[RATE] * h)) / h
    return beat + 2.0 * pi * self.breath_rate * self.mean[QUADRATURE]


def publish(self: PhaseLockedControl) -> None:
    """What is told about it."""
    self.phase = self.mean[PHASE]
    self.strain = self.unrest
    self.innovation = self.off
    tell(self, self.mean[RATE] / (2.0 * pi), self.off_beat)
