"""Where in their distributions the factors are, sample by sample: a table of parts of one, and of values."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import ScenarioError
from twin.installed import import_optional
from twin.study.design.distribution import part_below, score

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.study.design.factor import Factor

    Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Design:
    """Samples: `parts` (n, k) of the factors' distributions, before they are correlated, and `values` (n, k), NaN where a
    factor stays as the scenario has it.
    """

    method: str
    parts: Array
    values: Array


def latin_hypercube(count: int, factors: Sequence[Factor], seed: int) -> Array:
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
