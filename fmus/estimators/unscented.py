"""Unscented transform with 2 n symmetric points of equal weight, for a scalar measurement.

Julier and Uhlmann, Proc. IEEE 92(3), 2004, with kappa = 0: with their kappa = 3 - n the covariance of a state this long
may become indefinite. Noise is additive, and enters where the points have moved; they are drawn anew before a measurement.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from fmus.dense import cholesky


def spread(mean: Any, covariance: Any, lower: Any, points: Any, n: int) -> bool:
    """Draw the points, one in a row; False if the covariance is not positive definite."""
    if not cholesky(covariance, lower, n):
        return False
    distance = sqrt(1.0 * n)
    for k in range(n):
        for i in range(n):
            step = distance * lower[i, k]
            points[k, i] = mean[i] + step
            points[n + k, i] = mean[i] - step
    return True


def gather(points: Any, mean: Any, covariance: Any, n: int) -> None:
    """Mean and covariance of the points, which are distances from the mean afterwards."""
    for i in range(n):
        total = 0.0
        for k in range(2 * n):
            total += points[k, i]
        mean[i] = total / (2.0 * n)
        for k in range(2 * n):
            points[k, i] -= mean[i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(2 * n):
                total += points[k, i] * points[k, j]
            covariance[i, j] = total / (2.0 * n)
            covariance[j, i] = covariance[i, j]


def average(values: Any, n: int) -> tuple[float, float]:
    """Mean and variance of the sigma points' measurements; `values` holds the deviations afterwards."""
    mean = 0.0
    for k in range(2 * n):
        mean += values[k]
    mean /= 2.0 * n
    variance = 0.0
    for k in range(2 * n):
        values[k] -= mean
        variance += values[k] * values[k]
    return mean, variance / (2.0 * n)


def correct(
    points: Any, values: Any, mean: Any, covariance: Any, gain: Any, innovation: float, variance: float, n: int
) -> None:
    """Take one measurement in: `values` are distances from their mean, `variance` is that of the innovation."""
    for i in range(n):
        total = 0.0
        for k in range(2 * n):
            total += (points[k, i] - mean[i]) * values[k]
        gain[i] = total / (2.0 * n) / variance
    for i in range(n):
        mean[i] += gain[i] * innovation
        for j in range(i + 1):
            covariance[i, j] -= gain[i] * gain[j] * variance
            covariance[j, i] = covariance[i, j]
