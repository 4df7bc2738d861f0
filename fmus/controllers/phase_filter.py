"""Phase, rate and shape of a motion that repeats: an extended Kalman filter with colored error, and a profile over the phase.

    w = o + p + c + H(phi) + wall(phi),   y = o + p + H(phi) + profile(phi)
    H = r sin(phi) + sum for i = 2..4 of a_i sin(i phi) + b_i cos(i phi)
    d phi / dt = rate,   p and its quadrature turn at the rate of respiration, c fades, all else stands still, but for noise
    error = stiffness (w - tip(t - delay)) + noise

Parker and Anderson, Frequency tracking of nonsinusoidal periodic signals in noise, Signal Processing 20(2), 1990, have
rate and harmonics in one filter; the rate of respiration is a state in the same way. The filter sees the force error and the
tip that the demand has moved. Stiffness and delay are states too: while the learned motion fades in, tip and error change and
the wall's motion does not, which tells them apart. Adaptive higher harmonic control identifies its plant beside the
disturbance like that (Johnson, NASA TP-1996, 1982, recalled). Where the gripper has to be, y, differs from w by what friction and
play keep. Profiles, bins over a beat, are what four harmonics cannot: rests of the wall's motion, and the gripper's leap
across the play. They are learned beside the filter, as in repetitive control, but over the phase and not over time.
"""

from __future__ import annotations

from math import cos, exp, floor, pi, sin
from typing import Any

from fmus.fourier import begin_harmonics, fill_waves, renew_variance
from fmus.kalman import project

from twin.component import Component, local, parameter

HARMONICS = 4
PHASE, RATE, OFFSET, BREATH, QUADRATURE, BREATH_RATE, COLOR, STIFFNESS, DELAY, FIRST = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
N = FIRST + 1 + 2 * (HARMONICS - 1)
BINS = 200  # of the profile: 5 ms at one beat a second
REACH = 15  # bins to either side that one sample teaches
BREATH_LEAST, BREATH_MOST = 0.5, 3.5  # [rad/s]: 4.8 to 33 breaths a minute
RATIO_LEAST, RATIO_MOST = 0.3, 4.0  # of the stiffness over the nominal one
DELAY_LEAST, DELAY_MOST = -10e-3, 60e-3  # [s] beyond the nominal delay
SMALL = 1e-3  # step of a difference quotient
FARTHEST = 1e3  # no rate [rad/s] is larger, no place [m], no variance
BIN = 2.0 * pi / BINS  # [rad]


class PhaseFilter(Component):
    """Mean and covariance of the filter, and the profiles."""

    former_names = (
        ("rate_walk", "rate_process_noise"),
        ("phase_walk", "phase_process_noise"),
        ("offset_walk", "offset_process_noise"),
        ("breath_walk", "breath_process_noise"),
        ("amplitude_walk", "amplitude_process_noise"),
        ("breath_rate_walk", "breath_rate_process_noise"),
    )

    rate_process_noise = parameter(
        0.06,
        "",
        "deviation that the heart rate gains in a second, as part of it",
        minimum=0.0,
        source="seeds 3001 to 3010: 0.025 and 0.04 are worse, 0.08 as good; a wander of 5 % within ten seconds is 0.03",
    )
    phase_process_noise = parameter(
        0.05,
        "rad",
        "deviation that the phase gains in a second",
        minimum=0.0,
        source="beats that differ by 0.8 % of their length",
    )
    offset_process_noise = parameter(0.3e-3, "m", "deviation that the offset gains in a second", display_unit="mm", minimum=0.0,
                                     source="a hand-over lets the instrument fall back by a millimeter, every 15 s: 1 / 15^0.5; flat to 0.4")  # fmt: skip
    breath_process_noise = parameter(0.5e-3, "m", "deviation that respiration gains in a second", display_unit="mm", minimum=0.0,
                                     source="chosen: a breath that begins is followed within a second; with 0.2 the phase takes it over")  # fmt: skip
    breath_rate = parameter(0.25, "Hz", "rate of respiration to begin with", minimum=0.08, maximum=0.5,
                            source="a ventilator's 12 to 18 breaths a minute")  # fmt: skip
    amplitude_process_noise = parameter(0.02e-3, "m", "deviation that an amplitude gains in a second", display_unit="mm", minimum=0.0,
                                        source="seeds 1 to 5: what changes is the profile's to learn")  # fmt: skip
    color = parameter(0.15e-3, "m", "standard deviation of the colored error", display_unit="mm", minimum=1e-6,
                      source="seeds 3001 to 3010: 0.05 and 0.3 are worse; half of the sensor's noise over the stiffness")  # fmt: skip
    color_time = parameter(
        0.03,
        "s",
        "time in which it fades",
        minimum=1e-3,
        source="estimate: the gripper crosses friction and play in 30 ms",
    )
    learning = parameter(1.0, "", "part of an error that the profile takes over in one beat", minimum=0.0, maximum=1.0,
                         source="seeds 3001 to 3010: 0.6 and 0.8 leave larger errors in the first beats")  # fmt: skip
    kernel = parameter(4.0, "", "bins over which a sample is spread", minimum=0.5, maximum=6.0,
                       source="seeds 1 to 5, flat from 3 to 6: 20 ms at one beat a second, the loop's delay")  # fmt: skip

    breath_rate_process_noise = parameter(
        0.01,
        "Hz",
        "deviation that the rate of respiration gains in a second",
        minimum=0.0,
        source="chosen: a fifth of the usual rate in half a minute",
    )
    breath_deviation = parameter(
        0.1,
        "Hz",
        "standard deviation of that rate at the start",
        minimum=0.0,
        source="6 to 30 breaths a minute are 1.5 to 2.5 deviations away",
    )
    stiffness_ratio_deviation = parameter(
        0.3,
        "",
        "standard deviation of the stiffness over the nominal one, at the start",
        minimum=0.0,
        source="chosen: half and twice are 1.7 and 3.3 deviations away; 0.5 is worse at twice",
    )
    delay_deviation = parameter(8e-3, "s", "standard deviation of the delay beyond the nominal one, at the start", display_unit="ms",
                                minimum=0.0, source="chosen: 20 ms are 2.5 deviations away")  # fmt: skip

    mean = local(0.0, "", "phase, rate, offset, respiration, colored error, plant, amplitudes", shape=(N,))
    covariance = local(0.0, "", "of the same", shape=(N, N))
    slope = local(0.0, "", "of the measurement over each", shape=(N,))
    gain = local(0.0, "", "of the filter", shape=(N,))
    waves = local(0.0, "", "sine and cosine of each harmonic", shape=(2 * HARMONICS,))
    lessons = local(0.0, "", "beats that the profiles have learned from")
    wall = local(
        0.0, "m", "what the harmonics leave of the wall's motion, over the phase", shape=(BINS,), display_unit="mm"
    )
    profile = local(0.0, "m", "the same of where the gripper has to be", shape=(BINS,), display_unit="mm")


def clear_profile(self: PhaseFilter) -> None:
    """Reset the profile."""
    self.lessons = 0.0
    for k in range(BINS):
        self.profile[k] = 0.0
        self.wall[k] = 0.0


def between(bins: Any, phase: float) -> float:
    """A profile between its bins [m]."""
    position = phase / BIN
    below = floor(position)
    part = position - below
    k = int(below) % BINS
    return (1.0 - part) * bins[k] + part * bins[(k + 1) % BINS]


def required(self: PhaseFilter, phase: float) -> float:
    """R at a phase [m]: where the gripper has to be, but for the offset."""
    return harmonics(self, phase) + between(self.profile, phase)


def moved(self: PhaseFilter, phase: float) -> float:
    """W at a phase [m]: where the wall is, but for the offset."""
    return harmonics(self, phase) + between(self.wall, phase)


def harmonics(self: PhaseFilter, phase: float) -> float:
    """What both have in common [m]."""
    fill_waves(self.waves, 0, phase, HARMONICS)
    y = self.mean[FIRST] * self.waves[0]
    for i in range(1, HARMONICS):
        sine = self.mean[FIRST + 2 * i - 1] * self.waves[2 * i]
        y += sine + self.mean[FIRST + 2 * i] * self.waves[2 * i + 1]
    return y


def begin_mean(self: PhaseFilter, fitted: Any, trend: int) -> None:
    """Phase, offset and amplitudes of a fit: `trend` powers of time from -1 to 1 (now), then sine and cosine parts with phase zero now."""
    self.mean[PHASE] = begin_harmonics(self.mean, FIRST, fitted, trend, HARMONICS)
    self.mean[OFFSET] = 0.0
    for i in range(trend):
        self.mean[OFFSET] += fitted[i]


def correlate(self: PhaseFilter, plant: int, fitted: Any, change: Any, trend: int) -> None:
    """Set the covariance of the fit with stiffness or delay: the fit changes by `change` per unit."""
    variance = self.covariance[plant, plant]
    begin_mean(self, fitted, trend)
    for i in range(N):
        self.slope[i] = self.mean[i]
    for i in range(trend + 2 * HARMONICS):
        fitted[i] += SMALL * change[i]
    begin_mean(self, fitted, trend)
    for i in range(trend + 2 * HARMONICS):
        fitted[i] -= SMALL * change[i]
    for i in range(N):
        self.gain[i] = (self.mean[i] - self.slope[i]) / SMALL if i in (PHASE, OFFSET) or i >= FIRST else 0.0
        self.mean[i] = self.slope[i]
    for i in range(N):
        self.covariance[plant, i] += self.gain[i] * variance
        self.covariance[i, plant] += self.gain[i] * variance
        for j in range(N):
            self.covariance[i, j] += self.gain[i] * self.gain[j] * variance


def begin_filter(self: PhaseFilter, fitted: Any, trend: int, rate: float) -> None:
    """Begin with a fit."""
    begin_mean(self, fitted, trend)
    self.mean[RATE] = 2.0 * pi * rate
    self.mean[BREATH] = 0.0
    self.mean[QUADRATURE] = 0.0
    self.mean[COLOR] = 0.0
    self.mean[BREATH_RATE] = 2.0 * pi * self.breath_rate
    for i in range(N):
        for j in range(N):
            self.covariance[i, j] = 0.0

        # little doubt of the amplitudes: while the gripper begins to move, the play would else be taken for another beat
        deviation = 0.25e-3
        if i == PHASE:
            deviation = 0.2
        elif i == RATE:
            deviation = 0.05 * self.mean[RATE]
        elif i in (OFFSET, BREATH, QUADRATURE):
            deviation = 2e-3
        elif i == BREATH_RATE:
            deviation = 2.0 * pi * self.breath_deviation
        elif i == COLOR:
            deviation = self.color
        elif i == STIFFNESS:
            deviation = self.stiffness_ratio_deviation
        elif i == DELAY:
            deviation = self.delay_deviation
        self.covariance[i, i] = deviation * deviation


def predict(self: PhaseFilter, h: float) -> None:
    """Move mean and covariance on by h [s]."""
    keep = exp(-h / self.color_time)
    self.mean[PHASE] += h * self.mean[RATE]
    if self.mean[PHASE] > 2.0 * pi:
        self.mean[PHASE] -= 2.0 * pi
    self.mean[COLOR] *= keep
    turn = self.mean[BREATH_RATE] * h
    c = cos(turn)
    s = sin(turn)
    p = self.mean[BREATH]
    self.mean[BREATH] = c * p + s * self.mean[QUADRATURE]
    self.mean[QUADRATURE] = c * self.mean[QUADRATURE] - s * p
    b = h * self.mean[BREATH]
    q = h * self.mean[QUADRATURE]
    for j in range(N):
        p = self.covariance[BREATH, j]
        r = self.covariance[BREATH_RATE, j]
        self.covariance[BREATH, j] = c * p + s * self.covariance[QUADRATURE, j] + q * r
        self.covariance[QUADRATURE, j] = c * self.covariance[QUADRATURE, j] - s * p - b * r
        self.covariance[PHASE, j] += h * self.covariance[RATE, j]
        self.covariance[COLOR, j] *= keep
    for i in range(N):
        p = self.covariance[i, BREATH]
        r = self.covariance[i, BREATH_RATE]
        self.covariance[i, BREATH] = c * p + s * self.covariance[i, QUADRATURE] + q * r
        self.covariance[i, QUADRATURE] = c * self.covariance[i, QUADRATURE] - s * p - b * r
        self.covariance[i, PHASE] += h * self.covariance[i, RATE]
        self.covariance[i, COLOR] *= keep
        walk = self.amplitude_process_noise
        if i == PHASE:
            walk = self.phase_process_noise
        elif i == RATE:
            walk = self.rate_process_noise * self.mean[RATE]
        elif i == OFFSET:
            walk = self.offset_process_noise
        elif i in (BREATH, QUADRATURE):
            walk = self.breath_process_noise
        elif i == BREATH_RATE:
            walk = 2.0 * pi * self.breath_rate_process_noise
        elif i in (STIFFNESS, DELAY):
            walk = 0.0
        elif i == COLOR:
            walk = self.color * ((1.0 - keep * keep) / h) ** 0.5
        self.covariance[i, i] += walk * walk * h


def look(self: PhaseFilter, tip: float, speed: float) -> tuple[float, float]:
    """Predict the force error divided by the nominal stiffness [m], and its variance [m2].

    `tip` [m] and `speed` [m/s] are those of the tip that the error tells of. Leaves slopes and covariance with the sample.
    """
    phase = self.mean[PHASE]
    fill_waves(self.waves, 0, phase, HARMONICS)
    w = self.mean[OFFSET] + self.mean[BREATH] + self.mean[COLOR]
    w += self.mean[FIRST] * self.waves[0] + between(self.wall, phase)
    bent = (between(self.wall, phase + 2.0 * BIN) - between(self.wall, phase - 2.0 * BIN)) / (4.0 * BIN)
    turn = self.mean[FIRST] * self.waves[1] + bent
    ratio = self.mean[STIFFNESS]
    self.slope[FIRST] = ratio * self.waves[0]
    for i in range(1, HARMONICS):
        a = self.mean[FIRST + 2 * i - 1]
        b = self.mean[FIRST + 2 * i]
        w += a * self.waves[2 * i] + b * self.waves[2 * i + 1]
        turn += (i + 1) * (a * self.waves[2 * i + 1] - b * self.waves[2 * i])
        self.slope[FIRST + 2 * i - 1] = ratio * self.waves[2 * i]
        self.slope[FIRST + 2 * i] = ratio * self.waves[2 * i + 1]
    self.slope[OFFSET] = ratio
    self.slope[BREATH] = ratio
    self.slope[QUADRATURE] = 0.0
    self.slope[BREATH_RATE] = 0.0
    self.slope[COLOR] = ratio
    self.slope[RATE] = 0.0
    self.slope[PHASE] = ratio * turn
    self.slope[STIFFNESS] = w - tip
    self.slope[DELAY] = ratio * speed
    return ratio * (w - tip), project(self.covariance, self.slope, self.gain, 0.0, N)


def correct(self: PhaseFilter, innovation: float, variance: float, plant: bool) -> None:
    """Take in the sample that was looked at; `variance` is that of the innovation [m2].

    Unless `plant`, stiffness and delay stay as they are, with their doubt (Schmidt's consider filter).
    """
    for i in range(N):
        is_frozen = not plant and i in (STIFFNESS, DELAY)
        if not is_frozen:
            self.mean[i] += self.gain[i] / variance * innovation
        for j in range(i + 1):
            if is_frozen and j in (STIFFNESS, DELAY):
                continue
            self.covariance[i, j] -= self.gain[i] * self.gain[j] / variance
            self.covariance[j, i] = self.covariance[i, j]
    self.mean[BREATH_RATE] = min(max(self.mean[BREATH_RATE], BREATH_LEAST), BREATH_MOST)
    self.mean[STIFFNESS] = min(max(self.mean[STIFFNESS], RATIO_LEAST), RATIO_MOST)
    self.mean[DELAY] = min(max(self.mean[DELAY], DELAY_LEAST), DELAY_MOST)


def learn(self: PhaseFilter, reference: float, wall: float, part: float, h: float) -> None:
    """Distribute the residuals of gripper reference and wall [m] over the profile bins near the phase.

    `part` of what is usually learned is, and `h` [s] have passed since the last sample.
    """
    rest = reference - between(self.profile, self.mean[PHASE])
    rest_wall = wall - between(self.wall, self.mean[PHASE])
    bin_now = self.mean[PHASE] / BIN
    below = floor(bin_now)

    # a bin is met by as many samples as fit into the kernel: each gives its part of what is learned in a beat
    width = self.kernel * (2.0 * pi) ** 0.5
    rate = max(self.learning * part, 1.0 / (1.0 + self.lessons))
    self.lessons += self.mean[RATE] * h / (2.0 * pi)
    share = min(rate * abs(self.mean[RATE]) * h / BIN / width, 1.0)
    for k in range(-REACH, REACH + 1):
        away = (below + k - bin_now) / self.kernel
        met = (int(below) + k + BINS) % BINS
        part = share * exp(-0.5 * away * away)
        self.profile[met] += part * rest
        self.wall[met] += part * rest_wall


def healthy(self: PhaseFilter) -> bool:
    """Return whether mean and covariance are finite and plausible; comparisons with NaN are false."""
    good = True
    for i in range(N):
        good = good and abs(self.mean[i]) < FARTHEST and 0.0 <= self.covariance[i, i] < FARTHEST
    return good


def renew(self: PhaseFilter, i: int, deviation: float) -> None:
    """Reset the covariance of one part of the state."""
    renew_variance(self.covariance, i, deviation, N)
