"""Reduction of samples to one number, at once or part by part if they do not fit into memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    Array = np.ndarray[Any, Any]

REDUCTIONS: dict[str, Callable[[Array], Any]] = {
    "mean": np.mean,
    "std": np.std,
    "rms": lambda x: np.sqrt(np.mean(np.square(x))),
    "max_abs": lambda x: np.max(np.abs(x)),
    "min": np.min,
    "max": np.max,
    "final": lambda x: x[-1],
    "peak_to_peak": np.ptp,
}

MOMENT_REDUCTIONS: dict[str, Callable[[Moments], Any]] = {
    "mean": lambda of: of.mean,
    "std": lambda of: np.sqrt(of.squared_deviations / of.count),
    "rms": lambda of: np.sqrt(of.square),
    "max_abs": lambda of: np.maximum(abs(of.low), abs(of.high)),
    "min": lambda of: of.low,
    "max": lambda of: of.high,
    "final": lambda of: of.last,
    "peak_to_peak": lambda of: of.high - of.low,
}


@dataclass(frozen=True)
class Moments:
    """Moments and extremes of samples. `spread`: sum of squares about the mean."""

    count: int
    mean: Any
    square: Any  # mean of the squares
    squared_deviations: Any
    low: Any
    high: Any
    last: Any

    @classmethod
    def from_samples(cls, x: Array) -> Self:
        """Compute from samples, at least one."""
        count, mean = len(x), np.mean(x)
        return cls(count, mean, np.mean(np.square(x)), np.var(x) * count, np.min(x), np.max(x), x[-1])

    def merge(self, other: Self) -> Self:
        """Merge with those of the following samples (Chan, Golub, LeVeque, The American Statistician 37, 1983)."""
        count = self.count + other.count
        fraction, difference = other.count / count, other.mean - self.mean
        return type(self)(
            count,
            self.mean + difference * fraction,
            self.square + (other.square - self.square) * fraction,
            self.squared_deviations + other.squared_deviations + difference**2 * self.count * fraction,
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
            other.last,
        )


INSTANT_INDEX: dict[str, Callable[[Any], Any]] = {  # of the metrics that are the value at one instant
    "max_abs": lambda x: np.argmax(np.abs(x)),
    "min": np.argmin,
    "max": np.argmax,
    "final": lambda x: len(x) - 1,
}


def selected_time(reduce: str, parts: Iterable[tuple[Array, Array]]) -> float | None:
    """Return the time of the sample that a reduction selects [s]; None if it is not a single sample. `parts`: (time, value)."""
    if reduce not in INSTANT_INDEX:
        return None
    select = INSTANT_INDEX[reduce]
    candidates = [(time[select(value)], value[select(value)]) for time, value in parts if len(value)]
    return float(candidates[select(np.array([value for _, value in candidates]))][0]) if candidates else None


def window_end(parts: Iterable[tuple[Array, Array]], instant: float) -> float:
    """Return the time of the last row with the value of an instant [s]: a value that stays for a while is of the window that ends there."""
    time, value = map(np.concatenate, zip(*parts, strict=True))
    return float(time[np.flatnonzero(value == value[np.argmin(np.abs(time - instant))])[-1]])


def sample_limits(reduce: str, low: float | None, high: float | None) -> tuple[float | None, float | None]:
    """Return the limits that every sample must keep for its extreme to keep `low` and `high`; none of other reductions."""
    if reduce == "max_abs" and high is not None:
        return -high, high
    return (low if reduce == "min" else None), (high if reduce == "max" else None)


def extreme_times(
    reduce: str, low: float | None, high: float | None, parts: Sequence[tuple[Array, Array]]
) -> tuple[float | None, float | None]:
    """Return the time of the sample that an extreme is, and of the first sample that its limits exclude [s]; None: neither."""
    if reduce == "final":
        return None, None
    limits = sample_limits(reduce, low, high)
    outside = [time[is_outside(value, *limits)] for time, value in parts if limits != (None, None)]
    return selected_time(reduce, parts), next((float(times[0]) for times in outside if len(times)), None)


def reduce_samples(reduce: str, parts: Iterable[Array]) -> float:
    """Reduce samples to one number; NaN if there are none."""
    only_part: Array | None = None  # as long as it is the only one
    moments: Moments | None = None
    with np.errstate(all="ignore"):
        for part in (part for part in parts if len(part)):
            if only_part is None and moments is None:
                only_part = part
                continue
            previous = moments or Moments.from_samples(only_part)  # type: ignore[arg-type]  # one of them is set
            only_part, moments = None, previous.merge(Moments.from_samples(part))
        if only_part is not None:
            return float(REDUCTIONS[reduce](only_part))
        return np.nan if moments is None else float(MOMENT_REDUCTIONS[reduce](moments))


def is_outside(value: Any, low: float | None, high: float | None) -> Any:
    """Return a mask of values outside of the limits; NaN and infinity are outside."""
    mask = ~np.isfinite(value)
    if low is not None:
        mask = mask | (value < low)
    if high is not None:
        mask = mask | (value > high)
    return mask


def limit_excess(value: Any, low: float | None, high: float | None) -> Any:
    """Return how far values are outside of the limits, negative inside; infinite where they are not finite."""
    value = np.asarray(np.nan if value is None else value, float)
    excess = np.full(value.shape, -np.inf)
    if low is not None:
        excess = np.maximum(excess, low - value)
    if high is not None:
        excess = np.maximum(excess, value - high)
    return np.where(np.isfinite(value), excess, np.inf)
