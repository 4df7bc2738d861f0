"""Quasi-periodic motion: an offset, respiration, and harmonics of a heart rate that wanders.

    y = c + p + r sin(phi) + sum over i from 2 of a_i sin(i phi) + b_i cos(i phi)
    d phi / dt = w,   p and its quadrature q turn at the rate of respiration; all else stands still, but for noise

After Yuen et al., Robotic motion compensation for beating heart surgery, Int. J. Robotics Research 28(10), 2009, and
eq. (4) of Al-Ahmad et al. (RACS). Amplitudes and phases of the higher harmonics stand as sine and cosine parts about the
phase of the first: a harmonic that is not there has no phase to get lost, and one phase moves the whole beat.
"""

from __future__ import annotations

from math import cos, exp, hypot, pi, sin, sqrt
from typing import Any

from fmus.fourier import begin_harmonics, fill_waves, renew_variance
from fmus.unscented import gather, spread

from twin.component import Component, local, parameter

HARMONICS = 4
OFFSET, BREATH, QUADRATURE, BREATH_RATE, RATE, PHASE, FIRST = 0, 1, 2, 3, 4, 5, 6
N = FIRST + 1 + 2 * (HARMONICS - 1)
POINTS = 2 * N


class QuasiPeriodic(Component):
    """Model, mean and covariance of the filter."""

    former_names = (
        ("offset_walk", "offset_process_noise"),
        ("breath_walk", "breath_process_noise"),
        ("rate_walk", "rate_process_noise"),
        ("phase_walk", "phase_process_noise"),
        ("amplitude_walk", "amplitude_process_noise"),
    )

    offset_process_noise = parameter(
        0.1e-3,
        "m",
        "deviation that the offset gains in a second",
        minimum=0.0,
        source="chosen: a patient who shifts by a millimeter in minutes",
    )
    breath_process_noise = parameter(
        0.3e-3,
        "m",
        "deviation that respiration gains in a second",
        minimum=0.0,
        source="chosen: breaths differ by about a millimeter",
    )
    breath_rate = parameter(
        0.25,
        "Hz",
        "usual rate of respiration",
        minimum=0.1,
        maximum=0.5,
        source="a ventilator's 12 to 18 breaths a minute",
    )
    breath_deviation = parameter(
        0.05,
        "Hz",
        "standard deviation of that rate",
        minimum=1e-3,
        maximum=0.06,
        source="the same; the points reach 3.6 deviations, and a rate below zero has no meaning",
    )
    rate_process_noise = parameter(
        0.03,
        "Hz",
        "deviation that the heart rate gains in a second",
        minimum=0.0,
        source="5 % of 1.3 Hz within ten seconds: 0.05 1.3 (2 / 10)^0.5",
    )
    phase_process_noise = parameter(
        0.1,
        "rad",
        "deviation that the phase gains in a second",
        minimum=0.0,
        source="beats that differ by 1.6 % of their length",
    )
    amplitude_process_noise = parameter(
        0.1e-3,
        "m",
        "deviation that an amplitude gains in a second",
        minimum=0.0,
        source="chosen: amplitudes change by a tenth in ten seconds",
    )

    mean = local(0.0, "", "offset, respiration, quadrature, its rate, rate, phase, amplitudes", shape=(N,))
    covariance = local(0.0, "", "of the same", shape=(N, N))
    lower = local(0.0, "", "its Cholesky factor", shape=(N, N))
    points = local(0.0, "", "points of the unscented transform", shape=(POINTS, N))
    values = local(0.0, "", "what each would measure", shape=(POINTS,))
    gain = local(0.0, "", "of the filter", shape=(N,))
    waves = local(0.0, "", "sine and cosine of each harmonic", shape=(2 * HARMONICS,))


BREATH_MEMORY = 20.0  # [s] memory of the rate of respiration; assumed


def predict(self: QuasiPeriodic, h: float) -> bool:
    """Predict mean and covariance by h [s] and the sigma points' measurements; return False if the covariance is not positive definite."""
    if not spread(self.mean, self.covariance, self.lower, self.points, N):
        return False
    usual = 2.0 * pi * self.breath_rate
    keep = exp(-h / BREATH_MEMORY)
    for k in range(POINTS):
        angle = self.points[k, BREATH_RATE] * h
        c = cos(angle)
        s = sin(angle)
        p = self.points[k, BREATH]
        q = self.points[k, QUADRATURE]
        self.points[k, BREATH] = c * p + s * q
        self.points[k, QUADRATURE] = c * q - s * p
        self.points[k, BREATH_RATE] = usual + keep * (self.points[k, BREATH_RATE] - usual)
        self.points[k, PHASE] += self.points[k, RATE] * h
    gather(self.points, self.mean, self.covariance, N)
    for i in range(N):
        walk = self.amplitude_process_noise
        if i == OFFSET:
            walk = self.offset_process_noise
        elif i in (BREATH, QUADRATURE):
            walk = self.breath_process_noise
        elif i == BREATH_RATE:
            walk = 2.0 * pi * self.breath_deviation * (2.0 / BREATH_MEMORY) ** 0.5
        elif i == RATE:
            walk = 2.0 * pi * self.rate_process_noise
        elif i == PHASE:
            walk = self.phase_process_noise
        self.covariance[i, i] += walk * walk * h
    bound_phase(self)
    if not spread(self.mean, self.covariance, self.lower, self.points, N):
        return False
    for k in range(POINTS):
        self.values[k] = displacement(self, k)
    return True


def displacement(self: QuasiPeriodic, k: int) -> float:
    """The motion [m] of one point."""
    fill_waves(self.waves, 0, self.points[k, PHASE], HARMONICS)
    y = self.points[k, OFFSET] + self.points[k, BREATH] + self.points[k, FIRST] * self.waves[0]
    for i in range(1, HARMONICS):
        sine = self.points[k, FIRST + 2 * i - 1] * self.waves[2 * i]
        y += sine + self.points[k, FIRST + 2 * i] * self.waves[2 * i + 1]
    return y


def ahead(self: QuasiPeriodic, tau: float, shift: float) -> tuple[float, float, float]:
    """Position [m], velocity [m/s] and respiration [m] of the mean after tau [s], with a phase shifted by [rad]."""
    m = self.mean
    turn = m[BREATH_RATE] * tau
    p = cos(turn) * m[BREATH] + sin(turn) * m[QUADRATURE]
    q = cos(turn) * m[QUADRATURE] - sin(turn) * m[BREATH]
    fill_waves(self.waves, 0, m[PHASE] + m[RATE] * tau + shift, HARMONICS)
    y = m[OFFSET] + p + m[FIRST] * self.waves[0]
    slope = m[FIRST] * self.waves[1]
    for i in range(1, HARMONICS):
        a = m[FIRST + 2 * i - 1]
        b = m[FIRST + 2 * i]
        y += a * self.waves[2 * i] + b * self.waves[2 * i + 1]
        slope += (i + 1) * (a * self.waves[2 * i + 1] - b * self.waves[2 * i])
    return y, m[BREATH_RATE] * q + m[RATE] * slope, p


def start(self: QuasiPeriodic, fitted: Any, trend: int, rate: float) -> None:
    """Begin with a fit: `trend` powers of time from -1 to 1 (now), then sine and cosine parts with phase zero now."""
    middle = 0.0
    now = 0.0
    for i in range(trend):
        now += fitted[i]
        if i % 2 == 0:
            middle += fitted[i] / (i + 1)
    self.mean[OFFSET] = middle
    self.mean[BREATH] = now - middle
    self.mean[QUADRATURE] = 0.0
    self.mean[BREATH_RATE] = 2.0 * pi * self.breath_rate
    self.mean[RATE] = 2.0 * pi * rate
    self.mean[PHASE] = begin_harmonics(self.mean, FIRST, fitted, trend, HARMONICS)
    widen(self)


def widen(self: QuasiPeriodic) -> None:
    """Set the initial covariance: estimated worst case after five seconds."""
    for i in range(N):
        for j in range(N):
            self.covariance[i, j] = 0.0
        deviation = 0.5e-3
        if i in (OFFSET, BREATH, QUADRATURE):
            deviation = 2e-3
        elif i == BREATH_RATE:
            deviation = 2.0 * pi * self.breath_deviation
        elif i == RATE:
            deviation = 2.0 * pi * 0.05
        elif i == PHASE:
            deviation = 0.2
        self.covariance[i, i] = deviation * deviation


def renew(self: QuasiPeriodic, i: int, deviation: float) -> None:
    """Reset the covariance of one part of the state."""
    renew_variance(self.covariance, i, deviation, N)


def bound_phase(self: QuasiPeriodic) -> None:
    """Bound the variance of the phase: sigma points must not spread over several turns."""
    variance = self.covariance[PHASE, PHASE]
    if variance > 1.0:
        scale = 1.0 / sqrt(variance)
        for j in range(N):
            self.covariance[PHASE, j] *= scale
            self.covariance[j, PHASE] *= scale


def amplitude(self: QuasiPeriodic, i: int) -> float:
    """Of a harmonic [m], counted from 0."""
    if i == 0:
        return abs(self.mean[FIRST])
    return hypot(self.mean[FIRST + 2 * i - 1], self.mean[FIRST + 2 * i])
