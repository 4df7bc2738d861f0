"""Force control by a quasi-periodic disturbance observer: the last beat is played back, and its length followed."""

from math import exp, floor

from fmus.beat_search import RING, TREND, BeatSearch, fix_direction, forget, remember, scan
from fmus.learned_control import (
    FOLLOWING,
    LEAVING,
    SEARCHING,
    SPACING,
    LearnedControl,
    bearable,
    begin_control,
    command,
    inferred_reference,
    may_begin,
    publish_state,
    sense,
)

from twin.component import Boolean, Int64, local, parameter

MEMORY = 512  # periods that are remembered: a beat at 0.4 Hz
REACH = 10  # periods to either side that a sample teaches
CLEAR = 0.25  # rest of the search with which to begin
SLOPES = 2.0  # [s] over which the mean square of the slope is averaged
SHORTEST, LONGEST = 0.7, 1.4  # length of a beat over that of those before it: a few samples move it no further
LONG_RUN = 3.0  # beats over which the length is averaged for that
FAR, FARTHER = 2e-3, 10e-3  # [m] of one sample that the beat's length is corrected by, and its drift: an outlier is no evidence
PASSING = 0.1  # [s] over which the rest is averaged
STRAINED, RELAXED = 5e-3, 3e-3  # [m] rms of a beat that is not as the last ones, and is again; 0.5 mm is usual, 2 mm while it breathes


class QuasiPeriodicControl(LearnedControl, BeatSearch):
    """Force controller that plays back the last beat of the motion it should have made, with its length followed.

    After the quasi-periodic disturbance observer (Muramatsu and Katsura, arXiv 2406.00362); equations in the README.
    It has no phase: a beat that comes early is played back a beat later, and leaves it a beat behind.
    """

    buffers = (*LearnedControl.buffers, ("rate_minimum", (MEMORY - REACH - 2) / LONGEST))

    learning = parameter(0.5, "", "weight of a new beat in the playback", minimum=0.0, maximum=1.0,
                         source="chosen: half, so that noise of one beat has faded after three; 0.3 and 0.8 are worse")
    kernel = parameter(4.0, "", "periods over which a sample is spread", minimum=0.5, maximum=5.0,
                       source="that of phase_locked_control: 20 ms, the loop's delay")
    length_time = parameter(0.4, "s", "time in which the beat's length is followed", minimum=0.05,
                            source="seeds 301 to 304: 0.15 s follows noise, 1.2 s is too slow for 5 % of wander")

    acceleration_maximum = parameter(8.0, "m/s^2", "limit of the demand's change", minimum=0.1,
                                     source="as phase_locked_control's, a fifth less: what is played back swings between two cycles, "
                                     "and 10 asks for 15.5 N of 15")

    past = local(0.0, "m", "playback: a ring, `REACH` periods ahead of now", shape=(MEMORY,))
    now = local(0, "", "periods since the start", type=Int64)
    length = local(0.0, "s", "of the beat")
    length_mean = local(0.0, "s", "of the last beats")
    slope_square = local(0.0, "m^2/s^2", "mean square of the motion's speed")
    rest_square = local(0.0, "m^2", "mean square of what the last beat does not explain")
    drift = local(0.0, "m", "mean of that over a beat: respiration")
    off = local(0.0, "m", "latest sample minus the last beat's")
    off_beat = local(False, "", "whether the beat is not as the last ones", type=Boolean)

    def initialize(self) -> None:
        begin_control(self)
        self.measured = True  # the nominal stiffness and delay are used
        fix_direction(self)
        self.now = MEMORY
        self.off = 0.0
        start_search(self)
        self.innovation = 0.0
        publish_state(self, 0.0, self.off_beat)

    def step(self, t: float, h: float) -> None:
        is_fresh = sense(self, h)
        reference = inferred_reference(self, h)
        self.now += 1
        if self.mode == SEARCHING:
            self.past[self.now % MEMORY] = reference
            search(self, t, reference, h)
        else:
            follow(self, reference, is_fresh, h)
        command(self, forward(self, h), h)
        self.innovation = self.off
        publish_state(self, 0.0 if self.mode == SEARCHING else 1.0 / self.length, self.off_beat)


def start_search(self: QuasiPeriodicControl) -> None:
    """Forget the beat."""
    forget(self)
    self.length = 0.0
    self.rest_square = 0.0
    self.drift = 0.0
    self.off_beat = False
    self.mode = SEARCHING


def search(self: QuasiPeriodicControl, t: float, reference: float, h: float) -> None:
    """Search the rate; the ring already holds the last beat, whose playback begins when the rate is found."""
    if remember(self, SPACING, t, 0.0, 0.0, reference):
        self.along[self.head] = self.ring[self.head, 2]
    if not may_begin(self) or self.count < RING or not scan(self, TREND) or self.beat_rest > CLEAR:
        return
    self.length = 1.0 / self.beat_rate
    self.length_mean = self.length
    self.slope_square = 0.0
    for k in range(MEMORY // 2):
        slope = played_slope(self, -2.0 - k, h)
        self.slope_square += slope * slope / (MEMORY // 2)
    for k in range(1, REACH + 1):
        self.past[(self.now + k) % MEMORY] = played(self, k - self.length / h)
    self.mode = FOLLOWING


def played(self: QuasiPeriodicControl, k: float) -> float:
    """The ring at k periods from now, between them too [m]."""
    below = floor(k)
    part = k - below
    i = (self.now + int(below) + MEMORY) % MEMORY
    return (1.0 - part) * self.past[i] + part * self.past[(i + 1) % MEMORY]


def played_slope(self: QuasiPeriodicControl, k: float, h: float) -> float:
    """Its slope, over four periods [m/s]."""
    return (played(self, k + 2.0) - played(self, k - 2.0)) / (4.0 * h)


def follow(self: QuasiPeriodicControl, reference: float, is_fresh: bool, h: float) -> None:
    """Copy the last beat ahead, compare the sample with it and update it; give up a beat that does not explain the force."""
    self.past[(self.now + REACH) % MEMORY] = played(self, REACH - self.length / h)
    if is_fresh:
        self.off = reference - played(self, 0.0)
        self.drift += h / self.length * (min(max(self.off, -FARTHER), FARTHER) - self.drift)
        shape = min(max(self.off - self.drift, -FARTHER), FARTHER)
        self.rest_square += h / PASSING * (shape * shape - self.rest_square)
        limit = RELAXED if self.off_beat else STRAINED
        self.off_beat = self.trust >= 1.0 and self.rest_square > limit * limit
        stretch(self, h)
        if not self.off_beat:
            teach(self)
    if not bearable(self) or not abs(self.off) < 1.0:
        self.mode = LEAVING
    if self.mode == LEAVING and self.trust <= 0.0:
        start_search(self)


def stretch(self: QuasiPeriodicControl, h: float) -> None:
    """Move the length of the beat to where the sample lies on the last one: where it is steep, as a line does."""
    slope = played_slope(self, -self.length / h, h)
    self.slope_square += h / SLOPES * (slope * slope - self.slope_square)
    rest = min(max(self.off - self.drift, -FAR), FAR)
    self.length -= h / self.length_time * rest * slope / max(self.slope_square, 1e-8)
    self.length = min(max(self.length, SHORTEST * self.length_mean), LONGEST * self.length_mean)
    self.length_mean += h / (LONG_RUN * self.length_mean) * (self.length - self.length_mean)


def teach(self: QuasiPeriodicControl) -> None:
    """Spread the rest over the samples to either side, so that a beat takes over the part `learning` of it."""
    width = self.kernel * 2.5066282746310002
    for k in range(-REACH, REACH + 1):
        away = k / self.kernel
        self.past[(self.now + k + MEMORY) % MEMORY] += self.learning / width * exp(-0.5 * away * away) * self.off


def forward(self: QuasiPeriodicControl, h: float) -> float:
    """Return the speed of the last beat [m/s] at the time when the present demand takes effect."""
    if self.mode == SEARCHING:
        return 0.0
    ahead = (self.delay + self.lead - self.length) / h
    return (played(self, ahead) - played(self, ahead - 1.0)) / h
