"""Figures of a prediction: errors, prediction bands, area between distribution functions, and the consistency test.

Band: half width that holds the stated share of samples of runs that the fit has not seen, from the errors of a
cross-validation (Vovk, Annals of Mathematics and Artificial Intelligence 74, 2015: cross-conformal prediction), folds
weighted equally. Consistency: the mean error of a run, and the largest mean error of a twentieth of it, against
prediction limits for another run (Student's t, of the logarithm for the latter), each at half of the false-alarm rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    Array = np.ndarray[Any, Any]

BLOCKS = 20  # parts of a run whose mean errors are tested
RANKS = 401  # points of a fold's distribution function
BISECTIONS = 40


@dataclass(frozen=True)
class Band:
    """Prediction band: half width, and the shares of each left-out fold that a band from the others holds."""

    half_width: float
    coverages: list[float]


@dataclass(frozen=True)
class Limits:
    """Limits of one output's errors in a run that agrees with the model, all in the quantity's unit."""

    offset: float  # mean over the runs of the cross-validation
    offset_limit: float  # largest deviation from it
    peak_limit: float  # largest mean error of a block


@dataclass(frozen=True)
class Disagreement:
    """Where and how an output leaves its limits: from `time` [s] on, with mean error `offset` (measured - predicted)."""

    column: str
    time: float
    offset: float
    limit: float


def summary(error: Array) -> dict[str, float]:
    """Root mean square, mean and largest error."""
    return {
        "rmse": float(np.sqrt(np.mean(error**2))),
        "mean_error": float(np.mean(error)),
        "largest": float(np.max(np.abs(error))),
    }


def area(predicted: Array, measured: Array) -> float:
    """Area between the distribution functions of prediction and measurement, in their unit.

    The area validation metric of Ferson, Oberkampf and Ginzburg, Computer Methods in Applied Mechanics and Engineering
    197, 2008; Oberkampf and Roy, Verification and Validation in Scientific Computing, 2010, chapter 12; ASME V&V 20.
    """
    from scipy.stats import wasserstein_distance

    return float(wasserstein_distance(predicted, measured))


def pooled_quantile(folds: Sequence[Array], level: float) -> float:
    """Quantile of absolute errors, folds weighted equally."""
    ranks = np.linspace(0, 1, RANKS)
    return float(np.quantile(np.concatenate([np.quantile(fold, ranks) for fold in folds]), level))


def band(folds: Sequence[Array], share: float) -> Band:
    """Band from the absolute errors of left-out folds.

    The level of the quantile is the one at which bands from all other folds hold `share` of a fold on average.
    """
    if len(folds) < 2:
        return Band(pooled_quantile(folds, share), [])
    ranks = np.linspace(0, 1, RANKS)
    curves = [np.quantile(fold, ranks) for fold in folds]

    def coverages(level: float) -> list[float]:
        own = []
        for i, fold in enumerate(folds):
            others = np.concatenate([curve for k, curve in enumerate(curves) if k != i])
            own.append(float(np.mean(fold <= np.quantile(others, level))))
        return own

    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if np.mean(coverages(middle)) < share else (low, middle)
    return Band(float(np.quantile(np.concatenate(curves), high)), coverages(high))


def block_means(error: Array) -> Array:
    """Mean errors of the twentieths of a run."""
    return np.array([float(np.mean(block)) for block in np.array_split(error, min(BLOCKS, len(error)))])


def limits(folds: Sequence[Array], rate: float) -> Limits | None:
    """Limits from the signed errors of left-out folds, or None from fewer than three.

    `rate`: probability that another run of the same population exceeds one of the two limits.
    """
    from scipy.stats import t

    if len(folds) < 3:
        return None
    count = len(folds)
    widening = np.sqrt(1 + 1 / count)
    offsets = np.array([float(np.mean(fold)) for fold in folds])
    peaks = np.log([max(float(np.max(np.abs(block_means(fold)))), 1e-12) for fold in folds])
    two_sided, one_sided = (float(t.ppf(1 - tail, count - 1)) for tail in (rate / 4, rate / 2))
    return Limits(
        float(np.mean(offsets)),
        float(two_sided * np.std(offsets, ddof=1) * widening),
        float(np.exp(np.mean(peaks) + one_sided * np.std(peaks, ddof=1) * widening)),
    )


def disagreement(column: str, error: Array, time: Array, own: Limits) -> Disagreement | None:
    """Where a run's signed errors leave the limits, or None."""
    means = block_means(error)
    offset = float(np.mean(error))
    is_off = abs(offset - own.offset) > own.offset_limit
    is_beyond = np.abs(means) > own.peak_limit
    if not is_off and not is_beyond.any():
        return None
    blocks = is_beyond if is_beyond.any() else np.abs(means - own.offset) > own.offset_limit
    first = int(np.argmax(blocks))
    starts = [block[0] for block in np.array_split(np.arange(len(error)), len(means))]
    later = error[starts[first] :]
    return Disagreement(
        column, float(time[starts[first]]), -float(np.mean(later)), own.offset_limit if is_off else own.peak_limit
    )
