"""Figures of a prediction: errors, prediction bands, area between distribution functions, and the consistency test.

Band: half width that holds the stated share of samples of runs that the fit has not seen, from the errors of a
cross-validation (Vovk, Annals of Mathematics and Artificial Intelligence 74, 2015: cross-conformal prediction), folds
weighted equally. Consistency: the mean errors of a run and of its first twentieth, and the largest mean error of any
twentieth, against prediction limits for another run (Student's t, of the logarithm for the last), each at a third of the
false-alarm rate (Hahn and Meeker, Statistical Intervals, 1991, chapter 4).
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
    """Limits of one output's errors in a run that agrees with the model, all in the quantity's unit.

    Mean error over the run and over its first twentieth: a center and the largest deviation from it. `peak_limit`: largest
    mean error of any twentieth.
    """

    offset: float
    offset_limit: float
    start: float
    start_limit: float
    peak_limit: float


@dataclass(frozen=True)
class Disagreement:
    """Where and how an output leaves its limits: from `time` [s] on.

    `offset`: measured minus predicted, mean of the run, or of the parts beyond the limit if the start is within its limit.
    """

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

    `rate`: probability that another run of the same population exceeds one of the three limits.
    """
    from scipy.stats import t

    if len(folds) < 3:
        return None
    count, tail = len(folds), rate / 3
    widening = np.sqrt(1 + 1 / count)

    def deviation(values: Array, probability: float) -> float:
        return float(t.ppf(probability, count - 1) * np.std(values, ddof=1) * widening)

    means = [block_means(fold) for fold in folds]
    offsets = np.array([float(np.mean(fold)) for fold in folds])
    starts = np.array([own[0] for own in means])
    peaks = np.log([max(float(np.max(np.abs(own))), 1e-12) for own in means])
    return Limits(
        float(np.mean(offsets)),
        deviation(offsets, 1 - tail / 2),
        float(np.mean(starts)),
        deviation(starts, 1 - tail / 2),
        float(np.exp(np.mean(peaks) + deviation(peaks, 1 - tail))),
    )


def disagreement(column: str, error: Array, time: Array, own: Limits) -> Disagreement | None:
    """Where a run's signed errors leave the limits, or None."""
    means = block_means(error)
    blocks = np.array_split(np.arange(len(error)), len(means))
    is_beyond = np.abs(means) > own.peak_limit
    is_off = np.abs(means - own.offset) > own.offset_limit
    offset = float(np.mean(error))
    if abs(means[0] - own.start) > own.start_limit:
        first, limit = 0, own.start_limit
        offset = offset if abs(offset) > limit else float(means[0])  # a deviation that ends with the start
    elif is_beyond.any():
        first, limit = int(np.argmax(is_beyond)), own.peak_limit
        offset = float(np.mean(means[is_beyond]))
    elif abs(offset - own.offset) > own.offset_limit:
        first, limit = int(np.argmax(is_off)), own.offset_limit
    else:
        return None
    return Disagreement(column, float(time[blocks[first][0]]), -offset, limit)
