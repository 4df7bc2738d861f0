"""Clusters of failures: cases with the same broken expectations or the same message, and how they differ from the others."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from twin.study.answers.sensitivity import distance_from_median
from twin.study.answers.statistics import largest_p_value
from twin.study.design import SAMPLED
from twin.study.execution.case_engine import DONE

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.study.execution.case_table import CaseTable

NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")
MOST = 3  # factors that are named
FEWEST = 5  # cases from which one can tell what they have in common


@dataclass(frozen=True)
class DiscriminatingFactor:
    """A factor by which cases of a cluster differ: how well it separates (-0.5 to 0.5), medians inside and outside.

    `p_value`: of no difference (Mann and Whitney), of the value or of its distance from the median (`is_from_median`).
    """

    factor: str
    separation: float
    inside: float
    outside: float
    p_value: float
    is_from_median: bool = False

    @property
    def side(self) -> str:
        """Where the factor is in these cases: `high`, `low`, `far from its median` or `near its median`."""
        sides = ("near its median", "far from its median") if self.is_from_median else ("low", "high")
        return sides[self.separation > 0]


@dataclass(frozen=True)
class FailureCluster:
    """Cases that fail in the same way. `cases`: their numbers, the worst by its limit first; `example`: why that one failed."""

    variant: str
    what: str
    cases: tuple[int, ...]
    of: int
    example: str
    factors: tuple[DiscriminatingFactor, ...]


def clusters(cases: CaseTable) -> list[FailureCluster]:
    """Group the failed cases by their kind of failure, the most frequent first."""
    study = cases.study
    names = [
        expectation.name or expectation.metric or f"expectation {k + 1}"
        for k, expectation in enumerate(study.scenario.expectations)
    ]
    holds, values = cases.holds, cases.values
    indices_by_failure: dict[tuple[str, str], list[int]] = {}
    for i in cases.where(SAMPLED):
        row = cases.rows[i]
        if row.status != DONE:
            what = NUMBER.sub("#", row.why)[:160]
        elif broken := [name for name, verdict in zip(names, holds[i], strict=True) if verdict is False]:
            what = " and ".join(broken)
        else:
            continue
        indices_by_failure.setdefault((cases.requests[i].variant, what), []).append(i)
    groups = []
    for (variant, what), case_indices in indices_by_failure.items():
        own = cases.where(SAMPLED, variant)
        case_indices.sort(key=lambda i: -worst_excess(cases, i))
        numbers = tuple(cases.requests[i].number for i in case_indices)
        factors = discriminating_factors(study, values, case_indices, own)
        groups.append(FailureCluster(variant, what, numbers, len(own), cases.rows[case_indices[0]].why, factors))
    largest = largest_p_value(factor.p_value for group in groups for factor in group.factors)
    named = (
        replace(group, factors=tuple(factor for factor in group.factors if factor.p_value <= largest)[:MOST])
        for group in groups
    )
    return sorted(named, key=lambda group: -len(group.cases))


def worst_excess(cases: CaseTable, i: int) -> float:
    """Return by how much a failed case is beyond the limit that it misses most, as a part of the limit; 0 without one."""
    missed = (cases.limit_excess(i, k) for k, holds in enumerate(cases.holds[i]) if holds is False)
    return max((entry.excess for entry in missed if entry), default=0.0)


def discriminating_factors(
    study: Any, values: Array, case_indices: list[int], own: list[int]
) -> tuple[DiscriminatingFactor, ...]:
    """Factors by how much they differ between some cases and all others: how often one of them is above one of the others.

    The better one of two tests counts, of the factor and of its distance from the median (Bonferroni).
    """
    inside = np.array(case_indices)
    outside = np.array(sorted(set(own) - set(case_indices)), int)
    if len(inside) < FEWEST or len(outside) < FEWEST:
        return ()
    factors = []
    for k, factor in enumerate(study.factors):
        a, b = values[inside, k], values[outside, k]
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            continue
        medians, distance = (float(np.median(a)), float(np.median(b))), distance_from_median(np.concatenate((a, b)))
        tests = [stats.mannwhitneyu(a, b), stats.mannwhitneyu(distance[: len(a)], distance[len(a) :])]
        is_from_median = bool(tests[1].pvalue < tests[0].pvalue)
        test = tests[is_from_median]
        above, p_value = float(test.statistic) / (len(a) * len(b)) - 0.5, min(1.0, 2 * float(test.pvalue))
        factors.append(DiscriminatingFactor(factor.name, above, *medians, p_value, is_from_median))
    return tuple(sorted(factors, key=lambda factor: -abs(factor.separation)))
