"""Figures of a prediction: errors, prediction bands, area between distribution functions, and the consistency test.

Band: half width that holds the stated share of samples of runs that the fit has not seen, from the errors of a
cross-validation (Vovk, Annals of Mathematics and Artificial Intelligence 74, 2015: cross-conformal prediction), folds
weighted equally. Consistency: the mean errors of a run and of its first twentieth, the largest mean error of any twentieth,
and the largest change of the mean error at a time within the run, against prediction limits for another run (Student's t, of
the logarithm for the last two), each at a quarter of the false-alarm rate (Hahn and Meeker, Statistical Intervals, 1991,
chapter 4). A run that is shorter than the folds is compared
with contiguous parts of them: its variance is that between folds and that within folds together (random effects), with
Satterthwaite's degrees of freedom (Biometrics Bulletin 2(6), 1946). Errors have heavier tails than a normal distribution:
limits for parts are widened until parts of left-out folds exceed them at the stated rate (cross-conformal).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from twin.arrays import Array

BLOCKS = 20  # parts of a run whose mean errors are tested
RANKS = 401  # points of a fold's distribution function
BISECTIONS = 40
SIDE = 2  # twentieths at least before and after a change of the mean error
SMALLEST = 1e-12  # limit of a statistic that does not scatter; has a logarithm
SHORTEST_PART = 8  # rows of the shortest runs for which there are own limits
LEVELS = 8  # lengths of runs at most, each half of the one before, for which there are own limits


@dataclass(frozen=True)
class Band:
    """Prediction band: half width, and the shares of each left-out fold that a band from the others holds."""

    half_width: float
    coverages: list[float]


@dataclass(frozen=True)
class Limits:
    """Limits of one output's errors in a run of at least `rows` samples that agrees with the model, in the quantity's unit.

    Mean error over the run and over its first twentieth: a center and the largest deviation from it. `peak_limit`: largest
    mean error of any twentieth; `change_limit`: largest difference between the mean errors after and before a time.
    """

    rows: int
    offset: float
    offset_limit: float
    start: float
    start_limit: float
    peak_limit: float
    change_limit: float = inf  # of a file that was frozen without it


@dataclass(frozen=True)
class Disagreement:
    """Where and how an output leaves its limits: from `time` [s] on.

    `offset`: measured minus predicted, mean of the run, or of the parts beyond the limit, or from a change on.
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

    The level of the quantile is the one at which bands from all other folds hold `share`: of a fold on average, and of all
    samples, whose mean counts. Folds are what is drawn anew, but one long fold may have most of the samples.
    """
    if len(folds) < 2:
        return Band(pooled_quantile(folds, share), [])
    ranks = np.linspace(0, 1, RANKS)
    curves = [np.quantile(fold, ranks) for fold in folds]
    lengths = [len(fold) for fold in folds]

    def coverages(level: float) -> list[float]:
        own = []
        for i, fold in enumerate(folds):
            others = np.concatenate([curve for k, curve in enumerate(curves) if k != i])
            own.append(float(np.mean(fold <= np.quantile(others, level))))
        return own

    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        held = coverages(middle)
        of_folds_and_samples = (np.mean(held) + np.average(held, weights=lengths)) / 2
        low, high = (middle, high) if of_folds_and_samples < share else (low, middle)
    return Band(float(np.quantile(np.concatenate(curves), high)), coverages(high))


def block_means(error: Array) -> Array:
    """Mean errors of the twentieths of a run."""
    count = min(BLOCKS, len(error))
    begins = np.arange(count) * len(error) // count
    return np.asarray(np.add.reduceat(error, begins) / np.diff(begins, append=len(error)))


def changes(means: Array) -> Array:
    """Mean error from each twentieth on less that before it; 0 closer than `SIDE` to an end."""
    count, total = len(means), np.cumsum(means)
    result = np.zeros(count)
    for k in range(SIDE, count - SIDE + 1):
        result[k] = (total[-1] - total[k - 1]) / (count - k) - total[k - 1] / k
    return result


def limits(folds: Sequence[Array], rate: float) -> list[list[Limits]]:
    """Limits of each output from the signed errors of left-out folds, each of shape (samples, outputs).

    For runs as long as the shortest fold, half of that, and so on. `rate`: probability that another run of the same
    population exceeds a limit of any output. Empty from fewer than three folds.
    """
    outputs = folds[0].shape[1]
    if len(folds) < 3:
        return [[] for _ in range(outputs)]
    shortest = min(len(fold) for fold in folds)
    counts = [2**k for k in range(min(LEVELS, max(1, shortest // SHORTEST_PART).bit_length()))]
    levels = [limits_of_parts(folds, count, shortest // count, rate) for count in counts]
    return [[level[output] for level in levels] for output in range(outputs)]


def limits_of_parts(folds: Sequence[Array], count: int, rows: int, rate: float) -> list[Limits]:
    """Limits of each output for runs that are as long as one of `count` parts of a fold.

    They are widened until parts of a fold exceed those from all other folds at no more than the stated rate, if there
    are enough parts to tell.
    """
    outputs = folds[0].shape[1]
    values = np.array(
        [
            [[statistics(part[:, output]) for output in range(outputs)] for part in np.array_split(fold, count)]
            for fold in folds
        ]
    )  # shape (folds, parts, outputs, statistics)
    scores = []
    for k in range(len(folds)):
        center, limit = center_and_limit(np.delete(values, k, axis=0), rate)
        scores += np.max(np.abs(values[k] - center) / limit, axis=(1, 2)).tolist()
    rank = int(np.ceil((len(scores) + 1) * (1 - rate)))
    widening = max(1.0, sorted(scores)[rank - 1]) if rank <= len(scores) and len(folds) > 3 else 1.0
    center, limit = center_and_limit(values, rate)
    return [
        Limits(rows, offset, largest[0], start, *largest[1:])
        for (offset, start, *_), largest in zip(center.tolist(), (widening * limit).tolist(), strict=True)
    ]


def statistics(error: Array) -> tuple[float, float, float, float]:
    """Mean errors of a run and of its first twentieth, largest mean error of any twentieth, and its largest change."""
    means = block_means(error)
    peak, change = (max(float(np.max(np.abs(own))), SMALLEST) for own in (means, changes(means)))
    return float(np.mean(error)), float(means[0]), peak, change


def center_and_limit(values: Array, rate: float) -> tuple[Array, Array]:
    """Center and largest deviation from it of each statistic, shape (outputs, statistics); the last two have center 0.

    `values`: statistics of parts of folds, shape (folds, parts, outputs, statistics).
    """
    outputs = values.shape[2]
    tail = rate / outputs / values.shape[3]
    center = np.mean(values, axis=(0, 1))
    center[:, 2:] = 0.0
    limit = np.empty_like(center)
    for output in range(outputs):
        for k in range(2):
            limit[output, k] = deviation(values[:, :, output, k], 1 - tail / 2)
        for k in range(2, values.shape[3]):
            logarithms = np.log(values[:, :, output, k])
            limit[output, k] = np.exp(np.mean(logarithms) + deviation(logarithms, 1 - tail))
    return center, np.maximum(limit, SMALLEST)


def false_alarms(folds: Sequence[Array], rate: float) -> list[dict[str, int]]:
    """How many contiguous parts of each fold exceed limits from all other folds: rows of a part, parts, alarms."""
    counts: list[dict[str, int]] = []
    for k, fold in enumerate(folds):
        every = limits([other for j, other in enumerate(folds) if j != k], rate)
        for number, level in enumerate(every[0]):
            if number == len(counts):
                counts.append({"rows": level.rows, "parts": 0, "alarms": 0})
            for begin in range(0, len(fold) - level.rows + 1, level.rows):
                part = fold[begin : begin + level.rows]
                rows = np.arange(len(part))
                failures = [disagreement("", part[:, i], rows, own) for i, own in enumerate(every)]
                counts[number]["parts"] += 1
                counts[number]["alarms"] += any(failures)
    return counts


def deviation(values: Array, probability: float) -> float:
    """Largest deviation from the mean of a part of another fold, from those of known folds, shape (folds, parts)."""
    from scipy.special import stdtrit  # quantile of Student's t

    folds, parts = values.shape
    between = (1 + 1 / folds) * float(np.var(np.mean(values, axis=1), ddof=1))
    within = float(np.mean(np.var(values, axis=1, ddof=1))) * (1 - 1 / parts) if parts > 1 else 0.0
    square_sum = between**2 / (folds - 1) + (within**2 / (folds * (parts - 1)) if parts > 1 else 0.0)
    if square_sum == 0.0:
        return 0.0
    freedom = (between + within) ** 2 / square_sum
    return float(stdtrit(freedom, probability) * np.sqrt(between + within))


def limits_for(rows: int, every: Sequence[Limits]) -> Limits:
    """Limits for a run of this many rows: those of the longest parts that are not longer."""
    fitting = [own for own in every if own.rows <= rows]
    return max(fitting, key=lambda own: own.rows) if fitting else min(every, key=lambda own: own.rows)


def disagreement(column: str, error: Array, time: Array, every: Sequence[Limits]) -> Disagreement | None:
    """Where a run's signed errors leave the limits, or None."""
    own = limits_for(len(error), every)
    means = block_means(error)
    begins = np.arange(len(means)) * len(error) // len(means)
    is_beyond = np.abs(means) > own.peak_limit
    is_off = np.abs(means - own.offset) > own.offset_limit
    change = changes(means)
    offset = float(np.mean(error))
    if abs(means[0] - own.start) > own.start_limit:
        first, limit = 0, own.start_limit
        offset = offset if abs(offset) > limit else float(means[0])  # a deviation that ends with the start
    elif is_beyond.any():
        first, limit = int(np.argmax(is_beyond)), own.peak_limit
        offset = float(np.mean(means[is_beyond]))
    elif np.max(np.abs(change)) > own.change_limit:
        first, limit = int(np.argmax(np.abs(change))), own.change_limit
        offset = float(np.mean(means[first:]))
    elif abs(offset - own.offset) > own.offset_limit:
        first, limit = int(np.argmax(is_off)), own.offset_limit
    else:
        return None
    return Disagreement(column, float(time[begins[first]]), -offset, limit)
