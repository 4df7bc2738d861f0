"""How metrics are distributed over the cases, how often expectations hold, and how sure that is."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from twin import clock
from twin.study.design import SAMPLED, Study, is_cut
from twin.study.execution.case_engine import DONE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.arrays import Array
    from twin.results import Expectation, Metric
    from twin.study.execution.case_table import CaseTable, LimitExcess

EXTREMES = {0.0: "smallest", 1.0: "largest"}  # names of the outermost quantiles
FAMILY_LEVEL = 0.05  # probability that any of the named causes is none


@dataclass(frozen=True)
class Quantile:
    """A quantile with its confidence interval, SI; NaN where there are too few cases for an end."""

    part: float
    value: float
    low: float
    high: float


def resolved_part(part: float, count: int) -> float:
    """Return the part of a quantile, 0 or 1 where it is beyond the outermost of so many values: 5 % of fewer than 20."""
    return float(round(part)) if min(part, 1.0 - part) * count < 1.0 else part


@dataclass(frozen=True)
class MetricDistribution:
    """A metric of a variant over all samples, SI. `least` and `most`: numbers of the cases at its ends."""

    metric: str
    variant: str
    count: int
    without: int
    mean: float
    deviation: float
    quantiles: tuple[Quantile, ...]
    least: tuple[int, float]
    most: tuple[int, float]

    @property
    def worst(self) -> int:
        """Number of the case with the largest magnitude."""
        return max(self.least, self.most, key=lambda end: abs(end[1]))[0]


@dataclass(frozen=True)
class PassRate:
    """How often an expectation holds, with Wilson's interval. `failing`: numbers of some cases where it does not."""

    name: str
    variant: str
    met_count: int
    count: int
    low: float
    high: float
    failing: tuple[int, ...] = ()

    @property
    def part(self) -> float:
        """Part of the cases in which it holds."""
        return self.met_count / self.count if self.count else float("nan")


@dataclass(frozen=True)
class LeftOut:
    """A metric without a value, or an expectation that is not judged: `kind`, in some `variants` (none: in all), `why`."""

    name: str
    kind: str
    variants: tuple[str, ...]
    why: str


def largest_p_value(p_values: Iterable[float], level: float = FAMILY_LEVEL) -> float:
    """Return the largest p value that Holm's method (Scand. J. Stat. 6, 1979) accepts as an effect; -1 if none. NaN is no test."""
    ordered = sorted(value for value in p_values if value >= 0.0)
    accepted, count = -1.0, len(ordered)
    for rank, value in enumerate(ordered):
        if value > level / (count - rank):
            break
        accepted = value
    return accepted


def quantile(values: Array, part: float, confidence: float) -> Quantile:
    """A quantile with an interval between two order statistics: whatever the distribution is."""
    if not len(values):
        return Quantile(part, np.nan, np.nan, np.nan)
    interval = stats.quantile_test(values, p=part).confidence_interval(confidence)
    return Quantile(part, float(np.quantile(values, part)), float(interval.low), float(interval.high))


def wilson(met: int, count: int, confidence: float) -> tuple[float, float]:
    """Wilson's interval of a probability, J. Am. Stat. Assoc. 22, 1927: never outside of 0 to 1."""
    if not count:
        return 0.0, 1.0
    interval = stats.binomtest(met, count).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def metric_distributions(cases: CaseTable) -> list[MetricDistribution]:
    """Every metric of every variant, over the samples."""
    study = cases.study
    numbers = np.array([request.number for request in cases.requests])
    distributions = []
    for metric, variant, own in cases.by_metric():
        values = cases.metric(metric.name)[own]
        good = np.isfinite(values)
        if not good.any():
            continue
        finite_values, named = values[good], numbers[own][good]
        ends = [(int(named[i]), float(finite_values[i])) for i in (finite_values.argmin(), finite_values.argmax())]
        distributions.append(
            MetricDistribution(
                metric.name,
                variant,
                len(finite_values),
                len(values) - len(finite_values),
                float(finite_values.mean()),
                float(finite_values.std(ddof=1)) if len(finite_values) > 1 else float("nan"),
                tuple(quantile(finite_values, part, study.keys.confidence) for part in study.keys.quantiles),
                *ends,
            )
        )
    return distributions


def shares(cases: CaseTable) -> list[PassRate]:
    """How often each expectation holds in each variant; an order of variants sample by sample."""
    study, holds = cases.study, cases.holds
    confidence = study.keys.confidence
    left_out_metrics = {entry.name for entry in metrics_left_out(cases)}
    pass_rates = []
    for k, expectation in enumerate(study.scenario.expectations):
        name = expectation_name(expectation, k)
        if expectation.ordered and set(expectation.ordered) <= set(study.variants):
            if expectation.metric in left_out_metrics:
                continue
            met, failing, count = in_order(cases, expectation)
            pass_rates.append(
                PassRate(name, ", ".join(expectation.ordered), met, count, *wilson(met, count, confidence), failing)
            )
            continue
        for variant in study.variants:
            own = cases.where(SAMPLED, variant)
            judged = [(cases.requests[i].number, holds[i][k]) for i in own if holds[i][k] is not None]
            done = [i for i in own if cases.rows[i].status == DONE]
            if not judged or (done and all(holds[i][k] is None for i in done)):
                continue  # the expectation is not of this variant, even if a case without an end holds nothing
            met = sum(bool(verdict) for _, verdict in judged)
            failing = tuple(number for number, verdict in judged if not verdict)
            pass_rates.append(PassRate(name, variant, met, len(judged), *wilson(met, len(judged), confidence), failing))
    return pass_rates


def metrics_left_out(cases: CaseTable) -> list[LeftOut]:
    """Metrics whose window the cases do not reach, or whose analysis has no result in any case."""
    study, analyses = cases.study, {analysis.name for analysis in cases.study.scenario.analyses}
    has_done = any(row.status == DONE for row in cases.rows)
    entries = []
    for name, metric in study.scenario.metrics.items():
        own = analyses & {signal.name.partition(".")[0] for signal in metric.signal.signals}
        if cut := cut_entry(study, metric, name, "metric", metric.variants):
            entries.append(cut)
        elif own and has_done and not np.isfinite(cases.metric(name)).any():
            entries.append(LeftOut(name, "metric", (), f"no case has a result of the analysis {min(own)}"))
    return entries


def left_out(cases: CaseTable) -> list[LeftOut]:
    """Metrics that have no value because the cases are too short, and expectations that are not judged for that reason."""
    study, metrics = cases.study, metrics_left_out(cases)
    reasons = {metric.name: metric for metric in metrics}
    entries = [metric for metric in metrics if metric.name in study.metrics]
    for k, each in enumerate(study.scenario.expectations):
        name = expectation_name(each, k)
        is_other = each.ends or each.mean or each.nominal or not set(each.ordered) <= set(study.variants)
        if is_other or (each.variants and not set(each.variants) & set(study.variants)):
            continue
        if each.metric in reasons:
            variants = reasons[each.metric].variants if not each.variants else ()
            entries.append(LeftOut(name, "expectation", variants, reasons[each.metric].why))
        elif each.metric is None and (cut := cut_entry(study, each, name, "expectation", each.variants)):
            entries.append(cut)
    return entries


def cut_entry(
    study: Study, judged: Metric | Expectation, name: str, kind: str, variants: Sequence[str]
) -> LeftOut | None:
    """Return the entry of what is judged in a window that cases of some `variants` (none: all) do not reach; else None."""
    own = [variant for variant in study.variants if variant in (variants or study.variants)]
    cut = tuple(variant for variant in own if is_cut(study.scenario, variant, judged))
    if not cut or judged.window.stop_ns is None:
        return None
    end = clock.text(max(case.stop_ns for case in study.scenario.variants if case.variant in cut))
    why = f"the cases end at {end}, before the end of the window, {clock.text(judged.window.stop_ns)}"
    return LeftOut(name, kind, () if len(cut) == len(own) else cut, why)


def expectation_name(expectation: Expectation, index: int) -> str:
    """Return the name of an expectation; without one, its metric or signal and its number."""
    return expectation.name or f"{expectation.metric or getattr(expectation.signal, 'text', '')} {index + 1}"


def excesses_of_rate(cases: CaseTable, rate: PassRate) -> list[LimitExcess]:
    """Return by how much each case of a pass rate's variant is beyond a limit of its expectation."""
    expectations = enumerate(cases.study.scenario.expectations)
    k = next(k for k, each in expectations if expectation_name(each, k) == rate.name)
    return list(filter(None, (cases.limit_excess(i, k) for i in cases.where(SAMPLED, rate.variant))))


def worst_of_rate(cases: CaseTable, rate: PassRate) -> LimitExcess | None:
    """Return the case of a pass rate's variant that is farthest beyond a limit of its expectation, or nearest to it."""
    return max(excesses_of_rate(cases, rate), default=None)


def varying_rates(cases: CaseTable, rates: Sequence[PassRate]) -> list[PassRate]:
    """Return the pass rates whose margin differs between cases: a flag that is at its limit in all of them is close to nothing."""
    margins: dict[str, set[float]] = {}
    for rate in rates:
        margins.setdefault(rate.name, set()).update(entry.margin for entry in excesses_of_rate(cases, rate))
    return [rate for rate in rates if len(margins[rate.name]) > 1]


def in_order(cases: CaseTable, expectation: Expectation) -> tuple[int, tuple[int, ...], int]:
    """In how many samples an order of variants holds, the first case of those in which it does not, and samples in all."""
    metric = cases.study.scenario.metrics[expectation.metric or ""]
    values = cases.metric(metric.name)
    together: dict[tuple[int, int], dict[str, tuple[int, float]]] = {}
    for i in cases.where(SAMPLED):
        request = cases.requests[i]
        together.setdefault((request.sample, request.seed), {})[request.variant] = request.number, float(values[i])
    met, failing, count = 0, [], 0
    for own in together.values():
        if not set(expectation.ordered) <= own.keys():
            continue
        count += 1
        pairs = itertools.pairwise([own[variant][1] for variant in expectation.ordered])
        if all(above(expectation, before, after) for before, after in pairs):
            met += 1
        else:
            failing.append(own[expectation.ordered[0]][0])
    return met, tuple(failing), count


def above(expectation: Expectation, before: float, after: float) -> bool:
    """Whether two neighbors are in the expected order by its margin; a value that is not there is not."""
    gap = expectation.gap(before, after)
    return gap > 0.0 or (gap == 0.0 and bool(expectation.margin or expectation.margin_part))


def failures(cases: CaseTable) -> int:
    """Cases that did not come to their end."""
    return sum(row.status != DONE for row in cases.rows)
