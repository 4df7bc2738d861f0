"""Principal direction and heart rate of a moving tip over the last five seconds.

The rate is that of the least squares fit of a cubic trend and harmonics which leaves least. Half of a rate fits what the
rate fits, twice the rate does not: of rates that leave about as little, the highest is the heart's.
"""

from __future__ import annotations

from math import exp, pi, sqrt

from fmus.dense import cholesky, eigenvectors, solve
from fmus.fourier import fill_waves

from twin.component import Component, Int64, local, parameter

RING = 128  # samples in the buffer
STRIDE = 5  # samples: over 0.2 s the heart moves, respiration hardly
TREND = 4  # coefficients of the cubic, which takes respiration off
BASIS = TREND + 8
SCANNED = 3  # harmonics
CANDIDATES = 61
LONG = 5.0  # [s] memory of the search
REFINED = 9  # rates that are tried within 8 % of the one that was found, over the last beats
RELATIVE = 1.3  # a rate is as good as the best if it leaves no more than 1.3 times as much,
ABSOLUTE = 0.03  # and another 3 % of the motion


class BeatSearch(Component):
    """Ring buffer of the tip's path, with its principal direction and rate."""

    toward = parameter(
        (0.0, 0.0, 1.0),
        "",
        "rough direction in which the estimate grows",
        source="chosen: z, as the fiber's tip points",
    )
    rate_minimum = parameter(
        0.7,
        "Hz",
        "least heart rate looked for",
        minimum=0.5,
        fixed=True,
        source="chosen: 42 beats a minute; five seconds hold three and a half beats",
    )
    rate_maximum = parameter(
        2.9,
        "Hz",
        "highest heart rate looked for",
        maximum=3.0,
        fixed=True,
        source="150 beats a minute that wander by 5 %, three deviations; above 3 Hz 25 samples a second are too few",
    )

    axis = local(0.0, "", "direction of the heart's motion", shape=(3,))
    beat_rate = local(0.0, "Hz", "heart rate found in the last seconds; 0: none yet")
    beat_rest = local(1.0, "", "fraction of the motion's power that no beat at that rate explains")
    recent = local(0.0, "", "time and place of the last three samples", shape=(3, 4))
    recent_count = local(0, "", "how many there are", type=Int64)
    ring_time = local(0.0, "s", "when each sample of the ring was taken", shape=(RING,))
    ring = local(0.0, "m", "place of each", shape=(RING, 3))
    along = local(0.0, "m", "the same along the direction", shape=(RING,))
    head = local(0, "", "place of the latest sample in the ring", type=Int64)
    count = local(0, "", "samples in the ring", type=Int64)
    anchor = local(0.0, "m", "place where the estimate is zero", shape=(3,))
    spread_matrix = local(0.0, "", "of the tip's steps", shape=(3, 3))
    axes = local(0.0, "", "its eigenvectors", shape=(3, 3))
    gram = local(0.0, "", "normal equations", shape=(BASIS, BASIS))
    gram_lower = local(0.0, "", "their Cholesky factor", shape=(BASIS, BASIS))
    basis = local(0.0, "", "functions of the fit at one sample", shape=(BASIS,))
    fitted = local(0.0, "", "coefficients [m]: trend, then sine and cosine of each harmonic", shape=(BASIS,))
    rests = local(0.0, "", "part of the motion that each rate leaves", shape=(CANDIDATES,))
    candidate = local(0, "", "rate whose turn it is", type=Int64)


def forget(self: BeatSearch) -> None:
    """Begin anew."""
    self.count = 0
    self.recent_count = 0
    self.candidate = 0
    self.beat_rate = 0.0
    self.beat_rest = 1.0


def fix_direction(self: BeatSearch) -> None:
    """Search along the third coordinate, from zero: for a motion that is not measured in space."""
    for i in range(3):
        self.anchor[i] = 0.0
        self.axis[i] = 1.0 if i == 2 else 0.0


def remember(self: BeatSearch, spacing: float, time: float, x: float, y: float, z: float) -> bool:
    """Take a sample; True when the ring has a new one: the median of three, so that single outliers are left out.

    At least `spacing` [s] lie between two: at 25 Hz they hold four harmonics of 2.9 Hz.
    """
    last = self.recent_count % 3
    self.recent[last, 0] = time
    self.recent[last, 1] = x
    self.recent[last, 2] = y
    self.recent[last, 3] = z
    self.recent_count += 1
    if self.recent_count < 3:
        return False
    middle = median(self.recent[0, 0], self.recent[1, 0], self.recent[2, 0])
    if self.count > 0 and middle < self.ring_time[self.head] + spacing:
        return False
    self.head = (self.head + 1) % RING
    self.count = min(self.count + 1, RING)
    self.ring_time[self.head] = middle
    for i in range(3):
        self.ring[self.head, i] = median(self.recent[0, i + 1], self.recent[1, i + 1], self.recent[2, i + 1])
    return True


def median(a: float, b: float, c: float) -> float:
    """The middle one."""
    return max(min(a, b), min(max(a, b), c))


def find_direction(self: BeatSearch, share: float) -> None:
    """Turn the direction toward the largest axis of the tip's steps over 0.2 s, by a fraction of the difference."""
    for i in range(3):
        for j in range(3):
            self.spread_matrix[i, j] = 0.0
    for k in range(self.count - STRIDE):
        here = (self.head - k + RING) % RING
        there = (here - STRIDE + RING) % RING
        for i in range(3):
            step = self.ring[here, i] - self.ring[there, i]
            for j in range(3):
                self.spread_matrix[i, j] += step * (self.ring[here, j] - self.ring[there, j])
    eigenvectors(self.spread_matrix, self.axes, 3)
    best = 0
    for j in range(1, 3):
        if self.spread_matrix[j, j] > self.spread_matrix[best, best]:
            best = j
    sign = 0.0
    for i in range(3):
        sign += self.axes[i, best] * self.toward[i]
    side = 1.0 if sign >= 0.0 else -1.0
    size = 0.0
    for i in range(3):
        self.axis[i] += share * (side * self.axes[i, best] - self.axis[i])
        size += self.axis[i] * self.axis[i]
    for i in range(3):
        self.axis[i] /= max(sqrt(size), 1e-9)
    for k in range(self.count):
        here = (self.head - k + RING) % RING
        self.along[here] = along(self, self.ring[here, 0], self.ring[here, 1], self.ring[here, 2])


def find_anchor(self: BeatSearch) -> None:
    """Middle of the ring: where the estimate is zero from now on."""
    for i in range(3):
        total = 0.0
        for k in range(RING):
            total += self.ring[k, i]
        self.anchor[i] = total / RING


def along(self: BeatSearch, x: float, y: float, z: float) -> float:
    """Place along the direction [m]."""
    return (
        (x - self.anchor[0]) * self.axis[0] + (y - self.anchor[1]) * self.axis[1] + (z - self.anchor[2]) * self.axis[2]
    )


def fit(self: BeatSearch, rate: float, trend: int, harmonics: int, memory: float) -> float:
    """Least squares of trend and harmonics, phases from the latest sample on; the mean square [m2] that is left.

    Samples count less by their age over the memory [s].
    """
    n = trend + 2 * harmonics
    for i in range(n):
        self.fitted[i] = 0.0
        for j in range(i + 1):
            self.gram[i, j] = 0.0
    latest = self.ring_time[self.head]
    half = 0.5 * (latest - self.ring_time[(self.head + 1) % RING])
    power = 0.0
    weights = 0.0
    for k in range(RING):
        since = self.ring_time[k] - latest
        fill_basis(self, 1.0 + since / half, trend, 2.0 * pi * rate * since, harmonics)
        weight = exp(since / memory)
        weights += weight
        power += weight * self.along[k] * self.along[k]
        for i in range(n):
            weighted = weight * self.basis[i]
            self.fitted[i] += weighted * self.along[k]
            for j in range(i + 1):
                self.gram[i, j] += weighted * self.basis[j]
    for i in range(n):
        self.gram[i, i] += 1e-9 * weights
        self.basis[i] = self.fitted[i]
    if not cholesky(self.gram, self.gram_lower, n):
        return power / weights
    solve(self.gram_lower, self.fitted, n)
    for i in range(n):
        power -= self.fitted[i] * self.basis[i]
    return max(power, 0.0) / weights


def fill_basis(self: BeatSearch, u: float, trend: int, angle: float, harmonics: int) -> None:
    """Powers of u from -1 to 1, then sine and cosine of multiples of the angle."""
    self.basis[0] = 1.0
    for i in range(1, trend):
        self.basis[i] = u * self.basis[i - 1]
    fill_waves(self.basis, trend, angle, harmonics)


def candidate_rate(self: BeatSearch, index: float) -> float:
    """Rate [Hz] at an index of the table of candidates; fractional indices interpolate."""
    return self.rate_minimum + (self.rate_maximum - self.rate_minimum) * index / (CANDIDATES - 1)


def scan(self: BeatSearch, trend: int) -> bool:
    """Try the next candidate rate on a full ring; return True when all were tried and the rate is found."""
    moving = fit(self, 1.0, trend, 0, LONG)
    rest = fit(self, candidate_rate(self, 1.0 * self.candidate), trend, SCANNED, LONG)
    self.rests[self.candidate] = rest / max(moving, 1e-12)
    self.candidate += 1
    if self.candidate < CANDIDATES:
        return False
    self.candidate = 0
    choose(self)
    return True


def choose(self: BeatSearch) -> None:
    """The highest of the rates that leave about as little as the best, between candidates by a parabola."""
    least = self.rests[0]
    for i in range(1, CANDIDATES):
        least = min(least, self.rests[i])
    chosen = 0
    for i in range(CANDIDATES):
        before = self.rests[max(i - 1, 0)]
        after = self.rests[min(i + 1, CANDIDATES - 1)]
        valley = self.rests[i] <= before and self.rests[i] <= after
        if valley and self.rests[i] <= RELATIVE * least + ABSOLUTE:
            chosen = i
    shift = 0.0
    if 0 < chosen < CANDIDATES - 1:
        before = self.rests[chosen - 1]
        after = self.rests[chosen + 1]
        bend = before - 2.0 * self.rests[chosen] + after
        if bend > 0.0:
            shift = 0.5 * (before - after) / bend
    self.beat_rate = candidate_rate(self, chosen + shift)
    self.beat_rest = self.rests[chosen]


def refine(self: BeatSearch, harmonics: int) -> float:
    """Rate of the last two beats near the one found, which may have changed meanwhile; leaves the fit at it."""
    memory = 2.0 / self.beat_rate
    best = self.beat_rate
    least = 0.0
    for i in range(REFINED):
        rate = self.beat_rate * (1.0 + 0.16 * (i / (REFINED - 1.0) - 0.5))
        rest = fit(self, rate, TREND, harmonics, memory)
        if i == 0 or rest < least:
            least = rest
            best = rate
    moving = fit(self, 1.0, TREND, 0, memory)
    self.beat_rest = fit(self, best, TREND, harmonics, memory) / max(moving, 1e-12)
    return best
