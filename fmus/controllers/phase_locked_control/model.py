"""Force control that learns the gripper's trajectory over the phase of the beat."""

from math import exp, floor, pi

from fmus.beat_search import RING, TREND, BeatSearch, fit, forget, remember, scan
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

from twin.component import Boolean, Int32, Int64, input, local, output, parameter, terminal

PI_ALONE, FADING, LOCKED, BLIND, DISTURBED = 0, 1, 2, 3, 4
SEARCHING, FOLLOWING, LEAVING = 0, 1, 2
LINE = 32  # periods that the demand is remembered

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
JUDGED = 2.0  # [s] over which the force error is averaged
FARTHEST = 100.0  # [N]: no force is larger; what is not finite is not smaller either
FORGETTING = 0.02  # [s] in which the last force is forgotten when none comes


class PhaseLockedControl(BeatSearch, PhaseFilter):
    """Force controller that finds the beat in the force, and learns where the gripper has to be at each phase.

    Repetitive control over the phase of an extended Kalman filter; equations in the README.
    A beat that comes early is known when it is there: 70 mN once.
    """

    period = 5e-3

    setpoint = input("N", "desired contact force", start=0.2, minimum=0.0, nominal=0.1)
    force = input("N", "measured contact force", nominal=0.1)
    enable = input("", "whether the learned motion may move the gripper; otherwise it fades out", start=True, type=Boolean)

    target_velocity = output("m/s", "velocity demand for the drive, positive distal", display_unit="mm/s")
    state = output("", "0 PI alone, 1 fading in or out, 2 locked, 3 no force is seen, 4 the beat is not as learned",
                   type=Int32)
    share = output("", "part of the learned motion that is fed forward")
    rate = output("Hz", "heart rate; 0: none yet")
    phase = output("rad", "phase of the first harmonic, from 0 to 2 pi")
    feedforward = output("m/s", "learned part of the demand", display_unit="mm/s")
    innovation = output("m", "last sample minus what was expected of it", display_unit="mm")
    strain = output("", "squared innovation over its variance, averaged; a third is usual, above one the beat is not as learned")

    drive = terminal("what it commands", rule="bus", target_velocity=target_velocity)

    proportional = parameter(1.5, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="chosen: with the wall 17 rad/s; 23 ms of delay leave 12 dB and 68 deg")
    velocity_maximum = parameter(0.5, "m/s", "limit of the velocity demand", display_unit="mm/s", minimum=0.0,
                                 source="as the other controllers: ten times what the heart needs")
    forward_maximum = parameter(0.25, "m/s", "limit of the learned part", display_unit="mm/s", minimum=0.0,
                                source="chosen: twice what a beat of 2 Hz needs")
    stiffness = parameter(11.2, "N/m", "contact force per motion of the tip", display_unit="N/mm", minimum=1.0,
                          source="of the bent end, 3 EI / L^3 of wall; 20 % off costs little")
    noise = parameter(0.5e-3, "m", "standard deviation of a sample", display_unit="mm", minimum=1e-6,
                      source="estimate: 3 mN of the sensor over the stiffness, and as much again for friction")
    delay = parameter(20e-3, "s", "from a demand until the force sensor's value shows it", display_unit="ms", minimum=5e-3,
                      maximum=0.1, source="one period each of sensor, controller and holding, 4 ms of the drive")
    lead = parameter(6e-3, "s", "by which what was learned is applied ahead", display_unit="ms", minimum=0.0, maximum=0.05,
                     source="seeds 1 to 12, flat from 4 to 7 ms; without it learning is slow and rings")
    blend = parameter(1.0, "s", "time in which the learned motion fades in and out", minimum=1e-2,
                      source="as the estimators: a beat")
    change_maximum = parameter(0.08, "N", "change of the force from one value to the next that is believed", minimum=0.0,
                               source="estimate: 0.3 m/s of an early beat over stiffness, and ten deviations of noise")
    still = parameter(8, "", "equal values in a row that are no longer believed", type=Int64, minimum=2,
                      source="chosen: by noise and resolution once in 2000 values; it costs one value")
    hold = parameter(0.5, "s", "time that it goes on without a believable force", minimum=0.0,
                     source="chosen: half a beat; the rate is known to 1 %")
    worse = parameter(1.0, "", "part of PI's own mean square error above which the learned motion is given up",
                      minimum=0.0, source="chosen: what is worse than PI alone is not used")

    trust = local(0.0, "", "part of the learned motion that is fed forward")
    unrest = local(0.0, "", "squared innovation over its variance, averaged")
    off = local(0.0, "m", "latest innovation", display_unit="mm")
    mode = local(SEARCHING, "", "0 searching, 1 following, 2 leaving", type=Int32)
    demand = local(0.0, "m", "integral of the velocity demand", display_unit="mm")
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    latest = local(0, "", "place of the latest", type=Int64)
    last_force = local(0.0, "N", "last value of the sensor")
    believed = local(0.0, "N", "last value that was believed")
    equal = local(0, "", "values in a row that were equal", type=Int64)
    unseen = local(0.0, "s", "time without a believable value")
    feedback = local(0.0, "N", "force error that the feedback sees")
    calm = local(0.0, "", "beats since the model last failed to explain the force")
    rate_mean = local(0.0, "rad/s", "rate of the last beats")
    misfit = local(0.0, "m^2", "mean square of what phases around the circle leave of the last samples", shape=(SHIFTS,))
    off_beat = local(False, "", "whether the beat is not as learned", type=Boolean)
    square = local(0.0, "N^2", "mean square of the force error")
    square_alone = local(0.0, "N^2", "the same when PI was last alone")

    def initialize(self) -> None:
        forget(self)
        for i in range(3):
            self.anchor[i] = 0.0
            self.axis[i] = 1.0 if i == 2 else 0.0
        for i in range(LINE):
            self.line[i] = 0.0
        self.demand = 0.0
        self.latest = 0
        self.last_force = self.force
        self.believed = self.force
        self.equal = 0
        self.unseen = 0.0
        self.feedback = 0.0
        self.square = 0.0
        self.square_alone = 0.0
        self.unrest = RELAXED
        self.off_beat = False
        self.trust = 0.0
        self.feedforward = 0.0
        self.off = 0.0
        self.target_velocity = 0.0
        start_search(self)
        publish(self)

    def step(self, t: float, h: float) -> None:
        seen = believe(self, h)
        if seen:
            self.feedback = self.setpoint - self.believed
            self.square += h / JUDGED * (self.feedback * self.feedback - self.square)
        else:
            self.feedback *= exp(-h / FORGETTING)
        place = demanded(self, h) + (self.setpoint - self.believed) / self.stiffness
        if self.mode == SEARCHING:
            self.square_alone = self.square
            search(self, t, place)
        else:
            follow(self, place, seen, h)
        command(self, h)
        publish(self)


def believe(self: PhaseLockedControl, h: float) -> bool:
    """Whether the force is a new one and may be true; PI alone believes every number."""
    self.equal = self.equal + 1 if self.force == self.last_force else 0
    self.last_force = self.force
    change = abs(self.force - self.believed)
    likely = change <= self.change_maximum and self.equal < self.still
    if likely or (self.mode == SEARCHING and change < FARTHEST):
        self.believed = self.force
        self.unseen = 0.0
        return True
    self.unseen += h
    return False


def demanded(self: PhaseLockedControl, h: float) -> float:
    """Where the gripper was asked to be when the force that is seen was felt [m]."""
    periods = self.delay / h
    whole = floor(periods)
    part = periods - whole
    k = self.latest - int(whole) + LINE
    return (1.0 - part) * self.line[k % LINE] + part * self.line[(k - 1) % LINE]


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
    better = self.trust < 1.0 or self.square <= self.worse * self.square_alone
    if not (within and better and healthy(self)) or self.unseen > self.hold:
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


def command(self: PhaseLockedControl, h: float) -> None:
    """Feedback, and the learned motion as far as it is trusted."""
    wanted = self.enable and self.mode == FOLLOWING
    step = h / self.blend
    self.trust = min(self.trust + step, 1.0) if wanted else max(self.trust - step, 0.0)
    turn = self.mean[RATE] * h
    ahead = self.mean[PHASE] + self.mean[RATE] * (self.delay + self.lead)
    forward = (required(self, ahead) - required(self, ahead - turn)) / h
    forward += 2.0 * pi * self.breath_rate * self.mean[QUADRATURE]
    self.feedforward = self.trust * min(max(forward, -self.forward_maximum), self.forward_maximum)
    velocity = self.proportional * self.feedback + self.feedforward
    self.target_velocity = min(max(velocity, -self.velocity_maximum), self.velocity_maximum)
    self.demand += h * self.target_velocity
    self.latest = (self.latest + 1) % LINE
    self.line[self.latest] = self.demand


def publish(self: PhaseLockedControl) -> None:
    """What is told about it."""
    self.rate = self.mean[RATE] / (2.0 * pi)
    self.phase = self.mean[PHASE]
    self.share = self.trust
    self.strain = self.unrest
    self.innovation = self.off
    self.state = LOCKED
    if self.trust <= 0.0:
        self.state = PI_ALONE
    elif self.unseen > 0.0:
        self.state = BLIND
    elif self.off_beat:
        self.state = DISTURBED
    elif self.trust < 1.0:
        self.state = FADING
