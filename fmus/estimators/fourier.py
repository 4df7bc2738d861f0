"""Harmonics of a phase: their waves by recurrence, and where a filter over them begins from a fit."""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import Any


def fill_waves(waves: Any, first: int, angle: float, harmonics: int) -> None:
    """Fill in sine and cosine of multiples of the angle, from index `first` on."""
    s = sin(angle)
    c = cos(angle)
    s_i = s
    c_i = c
    for i in range(harmonics):
        waves[first + 2 * i] = s_i
        waves[first + 2 * i + 1] = c_i
        s_next = s_i * c + c_i * s
        c_i = c_i * c - s_i * s
        s_i = s_next


def begin_harmonics(mean: Any, first: int, fitted: Any, trend: int, harmonics: int) -> float:
    """Amplitudes about the phase of the first harmonic, from a fit behind `trend` coefficients; that phase [rad].

    The first has no cosine part: `mean` has its amplitude, then sine and cosine parts of the others.
    """
    phase = atan2(fitted[trend + 1], fitted[trend])
    mean[first] = hypot(fitted[trend], fitted[trend + 1])
    for i in range(1, harmonics):
        a = fitted[trend + 2 * i]
        b = fitted[trend + 2 * i + 1]
        angle = (i + 1) * phase
        mean[first + 2 * i - 1] = a * cos(angle) + b * sin(angle)
        mean[first + 2 * i] = b * cos(angle) - a * sin(angle)
    return phase


def renew_variance(covariance: Any, i: int, deviation: float, n: int) -> None:
    """Reset the covariance of one part of a state of size n."""
    for j in range(n):
        covariance[i, j] = 0.0
        covariance[j, i] = 0.0
    covariance[i, i] = deviation * deviation
