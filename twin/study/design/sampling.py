"""Distributions by their quantile functions: a part of one becomes a value, which is all that sampling needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    Array = np.ndarray[Any, Any]

TAIL = 0.01  # part that is left out at an open end where a design wants both ends of a factor


def score(u: Array) -> Array:
    """Normal scores of parts of one. Imported when needed: the processes that run cases draw nothing."""
    from scipy import special

    return np.asarray(special.ndtri(u))


def part_below(z: Any) -> Array:
    """Parts of one of normal scores."""
    from scipy import special

    return np.asarray(special.ndtr(z))


def uniform(u: Array, a: float, b: float) -> Array:
    """Evenly from a to b."""
    return a + (b - a) * u


def log_uniform(u: Array, a: float, b: float) -> Array:
    """The logarithm evenly."""
    return np.asarray(a * (b / a) ** u)


def normal(u: Array, mean: float, deviation: float) -> Array:
    """Of Gauss."""
    return np.asarray(mean + deviation * score(u))


def log_normal(u: Array, median: float, spread: float) -> Array:
    """The logarithm of Gauss; `spread` is the geometric standard deviation."""
    return np.asarray(median * spread ** score(u))


def below_uniform(x: float, a: float, b: float) -> float:
    """Part below x."""
    return (x - a) / (b - a)


def below_log_uniform(x: float, a: float, b: float) -> float:
    """Part below x."""
    return float(np.log(x / a) / np.log(b / a)) if x > 0 else 0.0


def below_normal(x: float, mean: float, deviation: float) -> float:
    """Part below x."""
    return float(part_below((x - mean) / deviation))


def below_log_normal(x: float, median: float, spread: float) -> float:
    """Part below x."""
    return float(part_below(np.log(x / median) / np.log(spread))) if x > 0 else 0.0


# by the key of the study file: quantile function, the part below a value, whether both ends are open
KINDS: dict[str, tuple[Callable[..., Array], Callable[..., float], bool]] = {
    "uniform": (uniform, below_uniform, False),
    "log_uniform": (log_uniform, below_log_uniform, False),
    "normal": (normal, below_normal, True),
    "log_normal": (log_normal, below_log_normal, True),
}


@dataclass(frozen=True)
class Distribution:
    """A kind with its two numbers, truncated to (low, high); or some values that are equally likely (kind `values`)."""

    kind: str
    numbers: tuple[float, ...]
    low: float = -np.inf
    high: float = np.inf

    @property
    def levels(self) -> tuple[float, ...]:
        """The values, if there are only some."""
        return self.numbers if self.kind == "values" else ()

    @property
    def span(self) -> tuple[float, float]:
        """Parts of the whole distribution that are below its two ends."""
        _, below, _ = KINDS[self.kind]
        first = below(self.low, *self.numbers) if np.isfinite(self.low) else 0.0
        last = below(self.high, *self.numbers) if np.isfinite(self.high) else 1.0
        return max(first, 0.0), min(last, 1.0)

    @property
    def ends(self) -> tuple[float, float]:
        """Parts between which a design takes values that wants both ends: not the infinite ones."""
        if self.levels:
            return 0.0, 1.0
        is_open = KINDS[self.kind][2]
        return (
            TAIL if is_open and not np.isfinite(self.low) else 0.0,
            1.0 - TAIL if is_open and not np.isfinite(self.high) else 1.0,
        )

    def values(self, parts: Array) -> Array:
        """Values at parts (0 to 1) of the truncated distribution."""
        if self.levels:
            index = np.minimum((np.asarray(parts) * len(self.numbers)).astype(int), len(self.numbers) - 1)
            return np.asarray(np.asarray(self.numbers)[index])
        first, last = self.span
        quantiles = KINDS[self.kind][0](first + (last - first) * np.asarray(parts), *self.numbers)
        return np.asarray(np.clip(quantiles, self.low, self.high))


def wrong_numbers(kind: str, numbers: list[float], low: float, high: float) -> str:
    """What is wrong with the numbers of a distribution."""
    if kind == "values":
        return "" if numbers else "has no values. Give some."
    first, second = numbers
    if kind in ("uniform", "log_uniform") and not first < second:
        return f"{kind} from {first:g} to {second:g} is empty. Swap them."
    if kind == "log_uniform" and first <= 0:
        return f"{kind} begins at {first:g}, which has no logarithm. Begin above zero."
    if kind == "normal" and second <= 0:
        return f"standard deviation {second:g} is not above zero. Correct it."
    if kind == "log_normal" and (first <= 0 or second <= 1):
        return (
            f"log_normal needs a median above 0 and a geometric standard deviation above 1, not {first:g}, {second:g}."
        )
    if not low < high:
        return f"from {low:g} is not below to {high:g}. Swap them."
    start, end = Distribution(kind, (first, second), low, high).span
    return "" if end - start > 1e-9 else "nothing of the distribution is between `from` and `to`. Widen them."
