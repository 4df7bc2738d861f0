"""Where in the beat the wall rests, from the contact force of a tip that is held still."""

from math import cos, floor, isfinite, pi, sin, sqrt

from twin.component import Boolean, Component, Int64, input, local, output, parameter

HARMONICS = 6
GRID = 64  # phases at which the speed is computed
BINS = 32  # parts of a beat in which samples are averaged: a mean force of any size then leaks into no harmonic
ROOM = 512  # samples of a beat; a longer one is not learned
TURN = 2.0 * pi


class WallRest(Component):
    """Learns the course of the contact force over a beat, and opens a gate where it changes least.

    While nothing moves the tip, its force on the wall changes as the wall moves: by the stiffness of both, which need not be
    known. A beat is put together when its second R wave is found. A wall whose force is lost in noise opens no gate.
    """

    period = 5e-3

    measured_force = input("N", "contact force", nominal=0.1)
    listening = input("", "whether the tip is in contact and nothing moves it", type=Boolean)
    phase = input("rad", "phase of the heartbeat now, 0 to 2 pi", nominal=3.0)
    phase_valid = input("", "whether that is known", type=Boolean)
    waves = input("", "R waves found so far", type=Int64)
    beat_period = input("s", "period of the beats of late", start=1.0, nominal=1.0)

    open = output("", "whether what sets out now arrives while the wall rests", type=Boolean)
    valid = output("", "whether it is known where the wall rests", type=Boolean)
    rest_phase = output("rad", "phase in the middle of the rest")
    rest_width = output("rad", "width of the rest")
    stroke = output("N", "peak to peak of the force over a beat")
    beats = output("", "beats that the course is the mean of", type=Int64)

    lead = parameter(0.27, "s", "time from the opening to the arrival", display_unit="ms", minimum=0.0,
                     source="needle from its home to the surface: 5 mm of its slide at 19 mm/s")
    speed_limit = parameter(0.25, "", "part of the largest speed of the beat below which the wall is at rest", minimum=0.0,
                            maximum=1.0, source="chosen before results")
    wave_delay = parameter(20e-3, "s", "time from an R wave until it is found", display_unit="ms", minimum=0.0,
                           source="delay of heart_phase: learned of a detector")
    spread = parameter(0.03, "s", "time to both sides in which the wall is to be slow: what the arrival may be off by",
                       display_unit="ms", minimum=0.0,
                       source="estimate: period of the sequence 10 ms, slide and needle 20 ms, R wave 4 ms")
    beats_needed = parameter(3, "", "beats before it is known where the wall rests", type=Int64, minimum=1, source="chosen")
    memory = parameter(8, "", "beats over which the course is averaged", type=Int64, minimum=1, source="chosen")
    likeness = parameter(0.6, "", "rms difference of a beat to the course, over its rms, from which on it is another", minimum=0.0,
                         source="chosen: a wander of 5 % makes 0.2")
    regular = parameter(0.12, "", "part by which a beat may be longer or shorter than those before", minimum=0.0,
                        source="as tolerance of heart_phase: not an early beat, no missed wave")
    rate_tolerance = parameter(0.1, "", "change of the beat's period from which on the course is learned anew", minimum=0.0,
                               source="chosen: twice the variability at rest")
    noise = parameter(3e-3, "N", "standard deviation of the force", minimum=0.0, source="force_sensor: resolution 3.1 mN, noise")

    line = local(0.0, "N", "force since the last R wave was found", shape=(ROOM,))
    count = local(0, "", "samples in it", type=Int64)
    complete = local(False, "", "whether all of them were listened to", type=Boolean)
    since = local(0.0, "s", "since the last R wave was found")
    unsteady = local(0.0, "", "variance of a beat's length about those before, as part of it")
    last_waves = local(0, "", "R waves at the last step", type=Int64)
    mean = local(0.0, "N", "mean force of each part of a beat", shape=(BINS,))
    samples = local(0, "", "samples of each part", type=Int64, shape=(BINS,))
    course = local(0.0, "N", "cosine and sine parts of the force over a beat", shape=(HARMONICS, 2))
    series = local(0.0, "N", "the same of the last beat", shape=(HARMONICS, 2))
    speed = local(0.0, "N", "change of the force per phase over a beat", shape=(GRID,))
    learned_period = local(0.0, "s", "period of the beats that were learned")
    confirmed = local(False, "", "whether a beat of this contact was like the course", type=Boolean)
    others = local(0, "", "beats in a row that were others", type=Int64)
    middle = local(0.0, "rad", "phase in the middle of the rest")
    width = local(0.0, "rad", "its width; 0: there is none")
    span = local(0.0, "N", "peak to peak of the course")
    half_open = local(0.0, "rad", "by which the arrival may be off the middle of the rest: less by what beats vary")
    largest = local(0.0, "N", "peak of the change per phase")

    def initialize(self) -> None:
        self.beats = 0
        self.others = 0
        self.confirmed = False
        self.complete = False
        self.last_waves = self.waves
        self.since = self.unsteady = 0.0
        self.count = 0
        self.learned_period = self.beat_period
        self.middle = self.width = self.span = 0.0
        publish(self)
        self.half_open = 0.0
        self.open = self.valid = False

    def step(self, t: float, h: float) -> None:
        self.since += h
        if self.waves != self.last_waves:
            watch_rate(self)
            if self.complete and self.waves == self.last_waves + 1:
                take_beat(self, h)
            self.last_waves = self.waves
            self.count = 0
            self.complete = True
        if self.listening and self.count < ROOM and isfinite(self.measured_force):
            self.line[self.count] = self.measured_force
            self.count += 1
        else:
            self.complete = False
        if not self.listening:
            self.confirmed = False

        learned = self.beats >= self.beats_needed and self.width > 0.0
        self.valid = learned and self.confirmed and self.phase_valid
        self.open = False
        if self.valid and self.beat_period > 0.0 and isfinite(self.phase):
            turns = (self.phase - self.middle) / TURN + self.lead / self.beat_period
            away = TURN * (turns - floor(turns + 0.5))
            self.half_open = max(0.5 * self.width - TURN * sqrt(self.unsteady), 0.5 * TURN / GRID)
            self.open = abs(away) <= self.half_open
        publish(self)


def watch_rate(self: WallRest) -> None:
    """How much the length of a beat differs from those before; early beats and missed waves are left out."""
    if self.beat_period > 0.0:
        off = self.since / self.beat_period - 1.0
        if abs(off) <= self.regular:
            self.unsteady += (off * off - self.unsteady) / self.memory
    self.since = 0.0


def publish(self: WallRest) -> None:
    """Where the wall rests."""
    self.rest_phase = self.middle
    self.rest_width = self.width
    self.stroke = self.span


def transform(self: WallRest, h: float) -> bool:
    """The Fourier series of the beat that is over; whether there are samples enough."""
    period = self.count * h
    for i in range(BINS):
        self.mean[i] = 0.0
        self.samples[i] = 0
    for i in range(self.count):
        turns = (i * h + self.wave_delay) / period  # the wave was there before it was found
        k = min(floor((turns - floor(turns)) * BINS), BINS - 1)
        self.mean[k] += self.line[i]
        self.samples[k] += 1
    for i in range(BINS):
        if self.samples[i] == 0:
            return False
        self.mean[i] /= self.samples[i]
    for k in range(HARMONICS):
        self.series[k, 0] = self.series[k, 1] = 0.0
        for i in range(BINS):
            angle = TURN * (k + 1) * (i + 0.5) / BINS
            self.series[k, 0] += 2.0 / BINS * self.mean[i] * cos(angle)
            self.series[k, 1] += 2.0 / BINS * self.mean[i] * sin(angle)
    return True


def take_beat(self: WallRest, h: float) -> None:
    """A whole beat: part of the mean if it is like it; two others in a row begin a new one."""
    if not abs(self.count * h - self.beat_period) <= self.regular * self.beat_period or not transform(self, h):
        return
    if abs(self.beat_period - self.learned_period) > self.rate_tolerance * self.learned_period:
        self.beats = 0
    difference_power = size = 0.0
    for k in range(HARMONICS):
        for part in range(2):
            difference = self.series[k, part] - self.course[k, part]
            difference_power += difference * difference
            size += self.course[k, part] * self.course[k, part]
    floor_power = 4.0 * HARMONICS * self.noise * self.noise / self.count
    if self.beats > 0 and difference_power > self.likeness * self.likeness * size + floor_power:
        self.others += 1
        self.confirmed = False
        if self.others < 2:
            return
        self.beats = 0
    self.others = 0
    if self.beats == 0:
        self.learned_period = self.beat_period
    self.beats += 1
    news = 1.0 / min(self.beats, self.memory)
    for k in range(HARMONICS):
        for part in range(2):
            before = 0.0 if self.beats == 1 else self.course[k, part]
            self.course[k, part] = before + news * (self.series[k, part] - before)
    self.learned_period += news * (self.beat_period - self.learned_period)
    self.confirmed = True
    find_rest(self)


def find_rest(self: WallRest) -> None:
    """The middle and the ends of the part of the beat in which the force changes least."""
    lowest = highest = self.largest = 0.0
    for j in range(GRID):
        angle = TURN * j / GRID
        value = slope = 0.0
        for k in range(HARMONICS):
            c = cos((k + 1) * angle)
            s = sin((k + 1) * angle)
            value += self.course[k, 0] * c + self.course[k, 1] * s
            slope += (k + 1) * (self.course[k, 1] * c - self.course[k, 0] * s)
        self.speed[j] = slope
        lowest = value if j == 0 else min(lowest, value)
        highest = value if j == 0 else max(highest, value)
        self.largest = max(self.largest, abs(slope))
    self.span = highest - lowest
    self.width = 0.0

    # noise of the series' value: of its 2 HARMONICS coefficients
    deviation = self.noise * sqrt(4.0 * HARMONICS / (self.count * self.beats))
    if self.span < 6.0 * deviation:
        return
    around = floor(self.spread / self.beat_period * GRID + 0.5)
    best = 0
    least = fastest(self, 0, around)
    for j in range(1, GRID):
        value = fastest(self, j, around)
        if value < least:
            least = value
            best = j
    limit = self.speed_limit * self.largest
    if least > limit:
        return
    back = 0
    while back < GRID // 2 and fastest(self, best - back - 1, around) <= limit:
        back += 1
    on = 0
    while on < GRID // 2 and fastest(self, best + on + 1, around) <= limit:
        on += 1
    turns = (best + 0.5 * (on - back)) / GRID
    self.middle = TURN * (turns - floor(turns))
    self.width = TURN * (1 + on + back) / GRID


def fastest(self: WallRest, j: int, around: int) -> float:
    """Largest speed about a phase of the grid."""
    most = 0.0
    for i in range(2 * around + 1):
        most = max(most, abs(self.speed[(j - around + i + 2 * GRID) % GRID]))
    return most
