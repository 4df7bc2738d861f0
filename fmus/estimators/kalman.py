"""Kalman filter's update of n states by one sample. Arrays come from the component that calls."""

from __future__ import annotations

from typing import Any


def project(covariance: Any, row: Any, gain: Any, variance: float, n: int) -> float:
    """Set `gain` to covariance times `row`, the sample's derivative by each state; the sample's `variance` with theirs."""
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += covariance[i, j] * row[j]
        gain[i] = total
        variance += row[i] * total
    return variance


def update(mean: Any, covariance: Any, gain: Any, innovation: float, variance: float, n: int) -> None:
    """Take in a sample with this innovation and its variance."""
    for i in range(n):
        mean[i] += gain[i] / variance * innovation
        for j in range(i + 1):
            covariance[i, j] -= gain[i] * gain[j] / variance
            covariance[j, i] = covariance[i, j]
