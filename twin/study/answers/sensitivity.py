"""What drives a metric: Sobol indices or Morris' effects where the samples are made for them, else rank correlations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from twin.installed import import_optional
from twin.study.design import Study, problem

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.study.execution.case_table import CaseTable

RESAMPLES = 200
FEWEST = 8  # samples from which ranks tell anything
NO_INTERVAL = (float("nan"), float("nan"))


@dataclass(frozen=True)
class Effect:
    """How a factor drives a metric, each measure with its interval of the study's confidence.

    `first` and `total`: Sobol indices; of Morris mean absolute effect and deviation of effects, SI; else Spearman's rank
    correlation, and nothing. `p_value`: of the hypothesis of no effect, on `total` of Sobol, else on `first`.
    """

    factor: str
    first: float
    first_interval: tuple[float, float] = NO_INTERVAL
    total: float = float("nan")
    total_interval: tuple[float, float] = NO_INTERVAL
    p_value: float = float("nan")
    is_from_median: bool = False  # of the factor's distance from its median instead of its value: both ends act alike

    @property
    def label(self) -> str:
        """The factor, and that its distance from the median counts."""
        return f"{self.factor}{', distance from median' * self.is_from_median}"


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
    """A metric with one factor at another value, and as in the scenario with the same seed, SI."""

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
    for metric, variant, own in cases.by_metric():
        if len(own) >= FEWEST:
            inputs = cases.values[own][:, : len(study.factors)]
            results.append(metric_sensitivity(study, metric.name, variant, inputs, cases.metric(metric.name)[own]))
    return [result for result in results if result is not None]


def metric_sensitivity(
    study: Study, metric: str, variant: str, inputs: Array, output: Array
) -> MetricSensitivity | None:
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
    seeds = len(study.seeds(1))
    effects = [
        stronger_correlation(factor.name, inputs[good, k], output[good], study.keys.confidence, seeds)
        for k, factor in enumerate(study.factors)
    ]
    return MetricSensitivity(metric, variant, "rank", by_size(effects))


def by_size(effects: list[Effect]) -> tuple[Effect, ...]:
    """The strongest first."""
    return tuple(sorted(effects, key=lambda effect: -abs(effect.first if np.isnan(effect.total) else effect.total)))


def half_width(confidence: float) -> float:
    """Return half the width of a two-sided interval of a normal distribution, in standard deviations."""
    return float(stats.norm.ppf((1 + confidence) / 2))


def distance_from_median(values: Array) -> Array:
    """Distance of each value's rank from the middle rank."""
    distance: Array = np.abs(stats.rankdata(values) - (len(values) + 1) / 2)
    return distance


def stronger_correlation(name: str, values: Array, output: Array, confidence: float, seeds: int) -> Effect:
    """The stronger one of the rank correlations with a factor and with its distance from the median; two tests (Bonferroni).

    A rank correlation alone misses a metric that grows to both sides.
    """
    effects = [
        rank_correlation(name, values, output, confidence, seeds),
        replace(rank_correlation(name, distance_from_median(values), output, confidence, seeds), is_from_median=True),
    ]
    strongest = max(effects, key=lambda effect: abs(effect.first))
    return replace(strongest, p_value=float(np.minimum(1.0, 2 * strongest.p_value)))  # NaN stays: no test


def rank_correlation(name: str, values: Array, output: Array, confidence: float = 0.95, seeds: int = 1) -> Effect:
    """Spearman's rank correlation, with the interval of Fisher's z (Bonett and Wright, Psychometrika 65, 2000).

    `seeds`: cases of each sample, which are not independent. The inner end of a correlation of 1 is that of the next smaller one, which two neighboring ranks in reverse order give.
    """
    count = len(values) // seeds
    if np.ptp(values) == 0.0:
        return Effect(name, 0.0)
    rho = float(stats.spearmanr(values, output).statistic)
    if count < 4:
        return Effect(name, rho, (-1.0, 1.0), p_value=1.0)
    largest = 1 - 12 / (count * (count * count - 1))
    z, deviation = np.arctanh(np.clip(rho, -largest, largest)), np.sqrt((1 + rho * rho / 2) / (count - 3))
    half = half_width(confidence) * deviation
    low, high = np.tanh([z - half, z + half])
    interval = (-1.0 if rho < -largest else float(low), 1.0 if rho > largest else float(high))
    return Effect(name, rho, interval, p_value=2 * float(stats.norm.sf(abs(z) / deviation)))


def interval(value: float, half: float) -> tuple[float, float]:
    """Interval of a value, with half its width."""
    return value - half, value + half


def p_value(value: float, half: float, confidence: float) -> float:
    """Two-sided p value of a normal estimate with half the width of its interval."""
    if half == 0.0:
        return float(value == 0.0)
    return 2 * float(stats.norm.sf(half_width(confidence) * abs(value) / half))


def sobol(study: Study, output: Array) -> tuple[str, tuple[Effect, ...]]:
    """First order and total indices of Sobol, by Saltelli's estimators."""
    salib = import_optional("SALib.analyze.sobol", "study", "samples: method: sensitivity")
    scale = output.std() or 1.0  # the estimators are exact for a mean of zero
    indices = salib.analyze(
        problem(study.factors),
        (output - output.mean()) / scale,
        calc_second_order=False,
        num_resamples=RESAMPLES,
        conf_level=study.keys.confidence,
        seed=study.keys.samples.seed,
    )
    names = [factor.name for factor in study.factors]
    rows = zip(names, *(indices[key].tolist() for key in ("S1", "S1_conf", "ST", "ST_conf")), strict=True)
    effects = [
        Effect(
            name,
            first,
            interval(first, first_half),
            total,
            interval(total, half),
            p_value(total, half, study.keys.confidence),
        )
        for name, first, first_half, total, half in rows
    ]
    return "sobol", by_size(effects)


def morris(study: Study, output: Array) -> tuple[str, tuple[Effect, ...]]:
    """Mean absolute elementary effect, and the deviation of effects, over the whole range of each factor."""
    salib = import_optional("SALib.analyze.morris", "study", "samples: method: morris")
    indices = salib.analyze(
        problem(study.factors),
        study.design.parts,
        output,
        num_levels=4,
        num_resamples=RESAMPLES,
        conf_level=study.keys.confidence,
        seed=study.keys.samples.seed,
    )
    names = [factor.name for factor in study.factors]
    rows = zip(names, *(np.asarray(indices[key]).tolist() for key in ("mu_star", "mu_star_conf", "sigma")), strict=True)
    effects = [
        Effect(name, mean, interval(mean, half), sigma, p_value=p_value(mean, half, study.keys.confidence))
        for name, mean, half, sigma in rows
    ]
    return "morris", tuple(sorted(effects, key=lambda effect: -effect.first))


def changes(cases: CaseTable) -> list[Change]:
    """What each value does to each metric, where one factor varies at a time."""
    study = cases.study
    if study.design.method != "one_at_a_time":
        return []
    values = cases.values
    rows = []
    for metric, variant, own in cases.by_metric():
        table, requests = cases.metric(metric.name), cases.requests
        before = {requests[i].seed: float(table[i]) for i in own if requests[i].sample == 1}
        for i in own:
            if requests[i].sample == 1:
                continue
            (k,) = np.flatnonzero(np.isfinite(values[i, : len(study.factors)]))
            name, request, value = study.factors[int(k)].name, requests[i], float(values[i, k])
            nominal = before.get(request.seed, float("nan"))
            rows.append(Change(metric.name, variant, name, value, request.number, float(table[i]), nominal))
    return rows
