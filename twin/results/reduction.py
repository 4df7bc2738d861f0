"""From samples to one number, at once or part by part where they do not fit into memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Array = np.ndarray[Any, Any]

REDUCE: dict[str, Callable[[Array], Any]] = {
    "mean":         np.mean,
    "std":          np.std,
    "rms":          lambda x: np.sqrt(np.mean(np.square(x))),
    "max_abs":      lambda x: np.max(np.abs(x)),
    "min":          np.min,
    "max":          np.max,
    "final":        lambda x: x[-1],
    "peak_to_peak": np.ptp,
}  # fmt: skip

OF_MOMENTS: dict[str, Callable[[Moments], Any]] = {
    "mean":         lambda of: of.mean,
    "std":          lambda of: np.sqrt(of.spread / of.count),
    "rms":          lambda of: np.sqrt(of.square),
    "max_abs":      lambda of: np.maximum(abs(of.low), abs(of.high)),
    "min":          lambda of: of.low,
    "max":          lambda of: of.high,
    "final":        lambda of: of.last,
    "peak_to_peak": lambda of: of.high - of.low,
}  # fmt: skip


@dataclass(frozen=True)
class Moments:
    """What the reductions need to know of samples that have been seen. `spread`: sum of squares about the mean."""

    count: int
    mean: Any
    square: Any  # mean of the squares
    spread: Any
    low: Any
    high: Any
    last: Any

    @classmethod
    def of(cls, x: Array) -> Self:
        """Of samples, at least one."""
        count, mean = len(x), np.mean(x)
        return cls(count, mean, np.mean(np.square(x)), np.var(x) * count, np.min(x), np.max(x), x[-1])

    def and_then(self, other: Self) -> Self:
        """Of these samples and those that follow (Chan, Golub, LeVeque, The American Statistician 37, 1983)."""
        count = self.count + other.count
        part, apart = other.count / count, other.mean - self.mean
        return type(self)(
            count,
            self.mean + apart * part,
            self.square + (other.square - self.square) * part,
            self.spread + other.spread + apart**2 * self.count * part,
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
            other.last,
        )


def reduced(reduce: str, parts: Iterable[Array]) -> float:
    """The number that a reduction makes of samples; not a number if there are none."""
    alone: Array | None = None  # the only part until now
    seen: Moments | None = None
    with np.errstate(all="ignore"):
        for part in (part for part in parts if len(part)):
            if alone is None and seen is None:
                alone = part
                continue
            before = seen or Moments.of(alone)  # type: ignore[arg-type]  # one of both is there
            alone, seen = None, before.and_then(Moments.of(part))
        if alone is not None:
            return float(REDUCE[reduce](alone))
        return np.nan if seen is None else float(OF_MOMENTS[reduce](seen))
