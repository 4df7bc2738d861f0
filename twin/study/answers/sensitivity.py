"""What drives a metric: Sobol indices or Morris' effects where the samples are made for them, else rank correlations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from twin.installed import import_optional
from twin.study.design import SAMPLED, problem

if TYPE_CHECKING:
    from twin.study.design import Study
    from twin.study.execution.case_table import CaseTable

    Array = np.ndarray[Any, Any]

RESAMPLES = 200
FEWEST = 8  # samples from which ranks tell anything
Z = 1.959963984540054  # of 95 %


@dataclass(frozen=True)
class Effect:
    """How a factor drives a metric, each measure with half the width of its interval.

    `first` and `total`: Sobol indices; of Morris mean absolute effect and deviation of effects, SI; else Spearman's rank
    correlation, and nothing. Of one factor at a time: the metric's change at each value.
    """

    factor: str
    first: float
    first_half: float
    total: float = float("nan")
    total_half: float = float("nan")


@dataclass(frozen=True)
class MetricSensitivity:
    """What drives a metric of a variant, the strongest first. `kind`: sobol, morris or rank."""

    metric: str
    variant: str
    kind: str
    effects: tuple[Effect, ...]
    note: str = ""


@dataclass(frozen=True)
class Change:
    """A metric with one factor at another value, and as in the scenario, SI."""

    metric: str
    variant: str
    factor: str
    value: float
    number: int
    now: float
    before: float


def drivers(cases: CaseTable) -> list[MetricSensitivity]:
    """What drives each metric of each variant."""
    study = cases.study
    if not study.factors or study.design.method == "one_at_a_time":
        return []
    results = []
    for metric in study.metrics.values():
        values = cases.metric(metric.name)
        for variant in study.variants:
            case_indices = cases.where(SAMPLED, variant)
            if (metric.variants and variant not in metric.variants) or len(case_indices) < FEWEST:
                continue
            metric_sensitivity = driven(
                study, metric.name, variant, cases.values[case_indices][:, : len(study.factors)], values[case_indices]
            )
            if metric_sensitivity is not None:
                results.append(metric_sensitivity)
    return results


def driven(study: Study, metric: str, variant: str, inputs: Array, output: Array) -> MetricSensitivity | None:
    """What drives one metric of a variant; None if it is the same everywhere."""
    good = np.isfinite(output)
    if good.sum() < FEWEST or np.ptp(output[good]) == 0.0:
        return None
    kind = study.design.method
    note = ""
    if kind in ("sensitivity", "morris"):
        expected_count = len(study.design.values) * len(study.seeds(1))
        if len(output) != expected_count:
            return None  # interrupted: the scheme is not complete
        if not good.all():
            note = f"{(~good).sum()} cases without a value count as the median."
            output = np.where(good, output, np.median(output[good]))
        output = output.reshape(len(study.design.values), -1).mean(axis=1)
        return MetricSensitivity(metric, variant, *(sobol if kind == "sensitivity" else morris)(study, output), note)
    effects = [ranked(factor.name, inputs[good, k], output[good]) for k, factor in enumerate(study.factors)]
    return MetricSensitivity(metric, variant, "rank", by_size(effects))


def by_size(effects: list[Effect]) -> tuple[Effect, ...]:
    """The strongest first."""
    return tuple(sorted(effects, key=lambda effect: -abs(effect.first if np.isnan(effect.total) else effect.total)))


def ranked(name: str, values: Array, output: Array) -> Effect:
    """Spearman's rank correlation, with Fisher's interval (Bonett and Wright, Psychometrika 65, 2000)."""
    if np.ptp(values) == 0.0:
        return Effect(name, 0.0, float("nan"))
    rho = float(stats.spearmanr(values, output).statistic)
    half = Z * np.sqrt((1 + rho * rho / 2) / max(len(values) - 3, 1)) * (1 - rho * rho)
    return Effect(name, rho, float(half))


def sobol(study: Study, output: Array) -> tuple[str, tuple[Effect, ...]]:
    """First order and total indices of Sobol, by Saltelli's estimators."""
    salib = import_optional("SALib.analyze.sobol", "study", "samples: method: sensitivity")
    scale = output.std() or 1.0  # the estimators are exact for a mean of zero
    indices = salib.analyze(
        problem(study.factors),
        (output - output.mean()) / scale,
        calc_second_order=False,
        num_resamples=RESAMPLES,
        seed=study.keys.samples.seed,
    )
    names = [factor.name for factor in study.factors]
    rows = zip(names, indices["S1"], indices["S1_conf"], indices["ST"], indices["ST_conf"], strict=True)
    return "sobol", by_size([Effect(name, *map(float, row)) for name, *row in rows])


def morris(study: Study, output: Array) -> tuple[str, tuple[Effect, ...]]:
    """Mean absolute elementary effect, and the deviation of effects, over the whole range of each factor."""
    salib = import_optional("SALib.analyze.morris", "study", "samples: method: morris")
    indices = salib.analyze(
        problem(study.factors),
        study.design.parts,
        output,
        num_levels=4,
        num_resamples=RESAMPLES,
        seed=study.keys.samples.seed,
    )
    names = [factor.name for factor in study.factors]
    rows = zip(names, indices["mu_star"], indices["mu_star_conf"], indices["sigma"], strict=True)
    effects = [Effect(name, float(mean), float(half), float(sigma)) for name, mean, half, sigma in rows]
    return "morris", tuple(sorted(effects, key=lambda effect: -effect.first))


def changes(cases: CaseTable) -> list[Change]:
    """What each value does to each metric, where one factor varies at a time."""
    study = cases.study
    if study.design.method != "one_at_a_time":
        return []
    values = cases.values
    rows = []
    for metric in study.metrics.values():
        table = cases.metric(metric.name)
        for variant in study.variants:
            if metric.variants and variant not in metric.variants:
                continue
            case_indices = cases.where(SAMPLED, variant)
            first = [i for i in case_indices if cases.requests[i].sample == 1]
            before = float(np.mean(table[first])) if first else float("nan")
            for i in case_indices:
                if cases.requests[i].sample == 1:
                    continue
                (k,) = np.flatnonzero(np.isfinite(values[i, : len(study.factors)]))
                factor, number = study.factors[int(k)], cases.requests[i].number
                rows.append(
                    Change(metric.name, variant, factor.name, float(values[i, k]), number, float(table[i]), before)
                )
    return rows
