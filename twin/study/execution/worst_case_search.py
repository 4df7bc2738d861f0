"""The worst case within the factors' distributions, by differential evolution: chance rarely meets it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin.scenario import member_seed
from twin.study.design import Study, StudyRequest, latin_hypercube, valued

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.study.execution.case_engine import Row
    from twin.study.execution.study_runner import PendingCases

WORST = "worst"
FAILED_VALUE = 1e100  # what a case without a value counts: nothing is worse, and squares of it do not overflow
MEMBERS = (8, 40)  # of a generation, at least and at most
GENERATIONS = 8  # at least, as long as `evaluations` allows


@dataclass
class WorstCase:
    """The worst case: its number, what the metric is there (SI), and the worst of the samples beside it."""

    metric: str
    variant: str
    goal: str
    number: int
    value: float
    values: tuple[float, ...]
    sampled: float
    evaluations: int
    last: int

    @property
    def remark(self) -> str:
        """Advice if one of the samples is worse than what the search found; else empty."""
        sign = -1.0 if self.goal == "max" else 1.0
        is_worse = np.isfinite(self.value) and sign * self.sampled < sign * self.value
        return ", which is worse: raise `evaluations` or `inside`" if is_worse else ""


def search_worst(study: Study, cases: PendingCases, number: int) -> WorstCase:
    """Look for the worst case; numbers go on from `number`. Every evaluation has the same seed."""
    from scipy.optimize import differential_evolution

    keys = study.keys.worst
    assert keys is not None
    variant = keys.variant or study.variants[0]
    column = list(study.scenario.metrics).index(keys.metric)
    sign = -1.0 if keys.goal == "max" else 1.0
    seed = member_seed(keys.seed, f"{study.name}, worst")
    edge = (1.0 - keys.inside) / 2.0
    size = min(max(keys.evaluations // GENERATIONS, MEMBERS[0]), MEMBERS[1])
    generations = max(1, keys.evaluations // size)
    tried: list[tuple[float, StudyRequest]] = []

    def value(row: Row) -> float:
        metric = row.metrics[column] if row.metrics else None
        return -FAILED_VALUE if metric is None else sign * metric

    def evaluate(parts: Array) -> Array:
        values = valued(parts.T, study.factors, study.correlation)
        first = number + len(tried) + 1
        nothing = (float("nan"),) * len(study.knobs)
        requests = [
            StudyRequest(first + i, WORST, len(tried) + i + 1, variant, seed, tuple(map(float, row)), nothing)
            for i, row in enumerate(values)
        ]
        rows = cases.run(requests, WORST)
        results = [value(row) for row in rows]
        tried.extend(zip(results, requests, strict=True))
        return np.array(results)

    generator = np.random.default_rng(keys.seed)
    begin = edge + (1.0 - 2.0 * edge) * latin_hypercube(size, study.factors, generator)
    differential_evolution(
        evaluate,
        [(edge, 1.0 - edge)] * len(study.factors),
        maxiter=generations - 1,
        init=begin,
        polish=False,
        rng=generator,
        vectorized=True,
        updating="deferred",
        tol=0.0,
    )
    best, request = min(tried, key=lambda item: item[0])
    initial_values = [sign * row for row in sampled(study, cases, variant, column)]
    return WorstCase(
        keys.metric,
        variant,
        keys.goal,
        request.number,
        np.nan if abs(best) >= FAILED_VALUE else sign * best,
        request.values,
        sign * min(initial_values) if initial_values else np.nan,
        len(tried),
        number + len(tried),
    )


def sampled(study: Study, cases: PendingCases, variant: str, column: int) -> list[float]:
    """The metric in the samples of a variant."""
    rows = [cases.completed_row(request) for request in study.requests() if request.variant == variant]
    return [value for row in rows if row.metrics and (value := row.metrics[column]) is not None]
