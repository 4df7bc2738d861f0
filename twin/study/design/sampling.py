"""Distributions of factors by their quantile functions, and samples of them: a table of parts of one, and of values."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import ScenarioError
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.arrays import Array
    from twin.study.design.factor import Factor

TAIL = 0.01  # part that is left out at an open end where a design wants both ends of a factor


def score(u: Array) -> Array:
    """Normal scores of parts of one. Imported when needed: the processes that run cases draw nothing."""
    from scipy import special

    return np.asarray(special.ndtri(u))


def part_below(z: Any) -> Array:
    """Parts of one of normal scores."""
    from scipy import special

    return np.asarray(special.ndtr(z))


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
    def is_normal(self) -> bool:
        """Whether values or their logarithms are normal, with open ends; else they are uniform."""
        return self.kind.endswith("normal")

    @property
    def is_log(self) -> bool:
        """Whether logarithms are distributed so."""
        return self.kind.startswith("log")

    @property
    def width(self) -> float:
        """Standard deviation or distance of the ends; of logarithms as a ratio."""
        first, second = self.numbers
        if self.is_normal:
            return second
        return second / first if self.is_log else second - first

    def below(self, value: float) -> float:
        """Part of the whole distribution below a value."""
        first = self.numbers[0]
        if self.is_log and value <= 0:
            return 0.0
        distance = np.log(value / first) / np.log(self.width) if self.is_log else (value - first) / self.width
        return float(part_below(distance) if self.is_normal else distance)

    @property
    def span(self) -> tuple[float, float]:
        """Parts of the whole distribution that are below its two ends."""
        first = self.below(self.low) if np.isfinite(self.low) else 0.0
        last = self.below(self.high) if np.isfinite(self.high) else 1.0
        return max(first, 0.0), min(last, 1.0)

    @property
    def ends(self) -> tuple[float, float]:
        """Parts between which a design takes values that wants both ends: not the infinite ones."""
        return (
            TAIL if self.is_normal and not np.isfinite(self.low) else 0.0,
            1.0 - TAIL if self.is_normal and not np.isfinite(self.high) else 1.0,
        )

    def values(self, parts: Array) -> Array:
        """Values at parts (0 to 1) of the truncated distribution."""
        parts = np.asarray(parts)
        if self.levels:
            index = np.minimum((parts * len(self.numbers)).astype(int), len(self.numbers) - 1)
            return np.asarray(np.asarray(self.numbers)[index])
        first, last = self.span
        parts = first + (last - first) * parts
        distances = score(parts) if self.is_normal else parts
        begin = self.numbers[0]
        quantiles = begin * self.width**distances if self.is_log else begin + self.width * distances
        return np.asarray(np.clip(quantiles, self.low, self.high))


def wrong_numbers(kind: str, numbers: list[float], low: float, high: float, texts: Sequence[object]) -> str:
    """What is wrong with the numbers of a distribution. `texts`: as the file states them, the numbers, then `low` and `high`."""
    if kind == "values":
        return "" if numbers else "has no values. Give some."
    (first, second), (first_text, second_text, low_text, high_text) = numbers, texts
    if kind in ("uniform", "log_uniform") and not first < second:
        return f"{kind} from {first_text} to {second_text} is empty. Swap them."
    if kind == "log_uniform" and first <= 0:
        return f"{kind} begins at {first_text}, which has no logarithm. Begin above zero."
    if kind == "normal" and second <= 0:
        return f"standard deviation {second_text} is not above zero. Correct it."
    if kind == "log_normal" and (first <= 0 or second <= 1):
        return f"log_normal needs a median above 0 and a geometric standard deviation above 1, not {first_text}, {second_text}."
    if not low < high:
        return f"from {low_text} is not below to {high_text}. Swap them."
    start, end = Distribution(kind, (first, second), low, high).span
    return "" if end - start > 1e-9 else "nothing of the distribution is between `from` and `to`. Widen them."


@dataclass(frozen=True)
class Design:
    """Samples: `parts` (n, k) of the factors' distributions, before they are correlated, and `values` (n, k), NaN where a
    factor stays as the scenario has it.
    """

    method: str
    parts: Array
    values: Array


def latin_hypercube(count: int, factors: Sequence[Factor], seed: int | np.random.Generator) -> Array:
    """One sample in each of `count` slices of every factor."""
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(len(factors), rng=np.random.default_rng(seed)).random(count))


def sobol(count: int, factors: Sequence[Factor], seed: int) -> Array:
    """The first points of a scrambled Sobol sequence; best where `count` is a power of two."""
    from scipy.stats import qmc

    power = max(0, int(count - 1).bit_length())
    return np.asarray(qmc.Sobol(len(factors), rng=np.random.default_rng(seed)).random_base2(power))[:count]


def draw_samples(count: int, factors: Sequence[Factor], seed: int) -> Array:
    """Draw independent uniform samples, shape (count, factors)."""
    return np.random.default_rng(seed).random((count, len(factors)))


def sensitivity(count: int, factors: Sequence[Factor], seed: int) -> Array:
    """Saltelli's scheme for Sobol indices: count * (factors + 2) samples."""
    salib = import_optional("SALib.sample.sobol", "study", "samples: method: sensitivity")

    if count & (count - 1):
        raise ScenarioError(
            f"samples: count {count} is no power of two, as Sobol's sequence needs it. Use {1 << count.bit_length()}."
        )
    # bounds stand for the parts of each distribution; second order indices would double the cases
    return np.asarray(salib.sample(problem(factors), count, calc_second_order=False, seed=seed))


def morris(count: int, factors: Sequence[Factor], seed: int) -> Array:
    """Trajectories on four levels of each factor: count * (factors + 1) samples."""
    salib = import_optional("SALib.sample.morris", "study", "samples: method: morris")

    return np.asarray(salib.sample(problem(factors), count, num_levels=4, seed=seed))


def problem(factors: Sequence[Factor]) -> dict[str, Any]:
    """The factors as SALib knows them: by the parts of their distributions."""
    bounds = [list(factor.distribution.ends) for factor in factors]
    return {"num_vars": len(factors), "names": [factor.name for factor in factors], "bounds": bounds}


SAMPLERS: dict[str, Callable[[int, Sequence[Factor], int], Array]] = {
    "latin_hypercube": latin_hypercube,
    "sobol": sobol,
    "random": draw_samples,
    "sensitivity": sensitivity,
    "morris": morris,
}
INDEPENDENT = ("sensitivity", "morris")  # what they tell of a factor needs it to vary alone
LISTED = ("grid", "one_at_a_time")


def design(method: str, count: int, seed: int, factors: Sequence[Factor], correlation: Array | None = None) -> Design:
    """The samples of a study; the same for the same seed."""
    if not factors:
        return Design(method, np.zeros((count, 0)), np.zeros((count, 0)))
    if method in LISTED:
        values = grid(factors) if method == "grid" else one_at_a_time(factors)
        return Design(method, np.full(values.shape, np.nan), values)
    parts = SAMPLERS[method](count, factors, seed)
    return Design(method, parts, valued(parts, factors, correlation))


def valued(parts: Array, factors: Sequence[Factor], correlation: Array | None = None) -> Array:
    """Values of the factors at independent parts of one; `correlation` is that of their normal scores."""
    if correlation is not None:
        parts = part_below(score(np.clip(parts, 1e-12, 1 - 1e-12)) @ np.linalg.cholesky(correlation).T)
    return np.stack([factor.distribution.values(parts[:, i]) for i, factor in enumerate(factors)], axis=1)


def grid(factors: Sequence[Factor]) -> Array:
    """Every value of each factor with every value of all others."""
    return np.array(list(itertools.product(*(factor.distribution.levels for factor in factors))), np.float64)


def one_at_a_time(factors: Sequence[Factor]) -> Array:
    """First all as in the scenario, then each value of each factor, all others as in the scenario."""
    rows = [np.full(len(factors), np.nan)]
    for i, factor in enumerate(factors):
        for value in factor.distribution.levels:
            rows.append(np.where(np.arange(len(factors)) == i, value, np.nan))
    return np.array(rows)
