"""Violations of expectations: the samples and cases concerned, to be marked in plots."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results.evaluation.limit_failures import describe_limits
from twin.results.evaluation.metrics import Evaluation, Expectation, Metric, MetricResult, Plot
from twin.results.evaluation.ordering import failing_pairs
from twin.results.evaluation.reduction import is_outside, limit_excess, sample_limits, selected_time
from twin.results.recording.signals import Signals, Window, window_mask

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.results.evaluation.expression import Expression

    Tables = Mapping[tuple[str, int], Signals]

MAX_SPANS = 400  # of one expectation in one case: more cannot be distinguished


@dataclass(frozen=True)
class Violation:
    """Failed expectation. `low`, `high` [SI]: limits of every sample, or of the sample that `reduce` selects.

    `cases`: each with the time of that sample, or of the first violating sample [s]; None of a metric of many samples.
    `worst`: the same cases with the time of the worst sample [s], the worst case first.
    `metric`: the one that it limits. `span` [s]: all samples of a case up to its time violate it, for so long.
    """

    name: str
    text: str
    signal: Expression
    window: Window
    cases: dict[tuple[str, int], float | None]
    unit: str = ""
    low: float | None = None
    high: float | None = None
    reduce: str = ""
    over_time: bool = False  # a metric of many samples, or several metrics: no single sample violates it
    metric: str = ""
    span: float = 0.0
    worst: dict[tuple[str, int], float | None] = field(default_factory=dict)

    @property
    def variants(self) -> tuple[str, ...]:
        """Variants with a violation."""
        return tuple(dict.fromkeys(variant for variant, _ in self.cases))

    @property
    def start(self) -> tuple[tuple[str, int], float | None]:
        """The worst case, and the time of its worst sample."""
        case = next(iter(self.worst or self.cases))
        return case, (self.cases if self.reduce else self.worst or self.cases)[case]

    @property
    def limits(self) -> list[float]:
        """Limits of every sample."""
        return [limit for limit in (self.low, self.high) if limit is not None]

    def concerns(self, signal: Expression) -> bool:
        """Whether an expression is the violated one, regardless of spaces."""
        return ast.dump(signal.tree) == ast.dump(self.signal.tree)

    def violating_samples(self, case: tuple[str, int], time: Any, value: Any) -> Any:
        """Return a mask of a case's violating samples, (n,): outside of the limits, or the sample of the metric."""
        mask, instant = np.zeros(len(time), bool), self.cases[case]
        if self.span and instant is not None:
            return (np.asarray(time) > instant - self.span) & (np.asarray(time) <= instant)
        if not self.reduce:
            return window_mask(np.asarray(time), self.window) & is_outside(value, self.low, self.high)
        if instant is not None and len(time) and time[0] <= instant <= time[-1]:
            mask[np.argmin(np.abs(np.asarray(time) - instant))] = True
        return mask

    def is_shown_in(self, plot: Plot, tables: Tables) -> bool:
        """Whether a plot over time shows a violating sample."""
        for curve in plot.curves:
            if curve.x is not None or not self.concerns(curve.signal):
                continue
            for case in self.cases:
                if plot.variants and case[0] not in plot.variants:
                    continue
                for time, value in tables[case].evaluate_parts(self.signal, plot.window):
                    if self.violating_samples(case, time, value).any():
                        return True
        return False


def consecutive_spans(time: Any, mask: Any) -> list[tuple[float, float]]:
    """Return spans of consecutive failed samples; of very many, the nearest are merged."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    begins, ends = time[edges[::2]], time[edges[1::2] - 1]
    if len(begins) > MAX_SPANS:
        gaps = begins[1:] - ends[:-1]
        largest_gaps = np.sort(np.argpartition(gaps, -(MAX_SPANS - 1))[-(MAX_SPANS - 1) :])
        begins, ends = begins[np.append(0, largest_gaps + 1)], ends[np.append(largest_gaps, len(ends) - 1)]
    return [(float(begin), float(end)) for begin, end in zip(begins, ends, strict=True)]


def find_violations(expectations: Iterable[Expectation], evaluation: Evaluation, tables: Tables) -> list[Violation]:
    """List the violations of signals and of metrics; terminations by hardware are not shown in plots."""
    violations = []
    for expectation, expectation_result in zip(expectations, evaluation.expectation_results, strict=False):
        if expectation_result.verdict != "fail" or expectation.ends:
            continue
        violation = (
            signal_violation(expectation, tables)
            if expectation.signal is not None
            else metric_violation(expectation, evaluation.metric_results, tables)
        )
        if violation is not None and violation.cases:
            violations.append(violation)
    return violations


def signal_violation(expectation: Expectation, tables: Tables) -> Violation | None:
    """Find the cases with a sample outside of the limits."""
    assert expectation.signal is not None
    what, expected, name = describe_limits(expectation)
    cases: dict[tuple[str, int], float | None] = {}
    worst: dict[tuple[str, int], tuple[float, float]] = {}
    for case, signals in tables.items():
        if not signals.complete or (expectation.variants and case[0] not in expectation.variants):
            continue
        for time, value in signals.evaluate_parts(expectation.signal, expectation.window):
            outside = is_outside(value, expectation.at_least, expectation.at_most)
            if outside.any():
                cases.setdefault(case, float(time[np.argmax(outside)]))
                excess = limit_excess(value, expectation.at_least, expectation.at_most)
                sample = float(np.max(excess)), float(time[np.argmax(excess)])
                worst[case] = max(worst.get(case, sample), sample, key=lambda each: each[0])
    text = f"{what} {expected}{expectation.window.text}"
    return Violation(
        name,
        text,
        expectation.signal,
        expectation.window,
        cases,
        expectation.unit,
        expectation.at_least,
        expectation.at_most,
        worst={case: worst[case][1] for case in sorted(cases, key=lambda case: -worst[case][0])},
    )


def extreme_violation(expectation: Expectation, metric: Metric, tables: Tables) -> Violation | None:
    """Find the cases with a sample outside of the limits of their extreme; None if those of every sample do not follow."""
    low, high = sample_limits(metric.reduce, expectation.at_least, expectation.at_most)
    if low is None and high is None:
        return None
    variants = expectation.variants or metric.variants
    unit = expectation.unit or metric.unit
    samples = replace(expectation, signal=metric.signal, window=metric.window, variants=variants, unit=unit)
    return signal_violation(replace(samples, at_least=low, at_most=high), tables)


def worst_seeds_first(tables: Tables, violations: Iterable[Violation]) -> Tables:
    """Return the tables with the seed first in each variant that reports show: the worst of its first violation, of samples first."""
    seeds: dict[str, int] = {}
    for violation in sorted(violations, key=lambda each: (bool(each.reduce), each.over_time)):
        for variant, seed in violation.worst or violation.cases:
            seeds.setdefault(variant, seed)
    variants = list(dict.fromkeys(variant for variant, _ in tables))
    order = sorted(tables, key=lambda case: (variants.index(case[0]), case[1] != seeds.get(case[0])))
    return {case: tables[case] for case in order}


def metric_violation(expectation: Expectation, results: Iterable[MetricResult], tables: Tables) -> Violation | None:
    """Find the cases whose metric is outside of the limits; all cases of a mean, and of the second variant of a pair out of order."""
    selected = [result for result in results if expectation.judges(result)]
    if expectation.ordered:
        of_variant = {result.variant: result for result in selected}
        in_order = [of_variant[variant] for variant in expectation.ordered if variant in of_variant]
        failing = [after for _, after in failing_pairs(expectation, in_order)]  # whose limit is the mean before
        selected = [result for result in selected if result in failing]
    if not selected:
        return None
    metric = selected[0].metric
    is_combined = bool(expectation.ordered) or expectation.mean
    cases = {
        (result.variant, seed): selected_time(
            metric.reduce, tables[result.variant, seed].evaluate_parts(metric.signal, metric.window)
        )
        for result in selected
        for seed, value in result.values.items()
        if is_combined or is_outside(np.nan if value is None else value, expectation.at_least, expectation.at_most)
    }
    values = {(result.variant, seed): value for result in selected for seed, value in result.values.items()}
    limits = expectation.at_least, expectation.at_most
    ranked = cases if is_combined else sorted(cases, key=lambda case: -float(limit_excess(values[case], *limits)))
    order = f"{expectation.metric}: {(' > ' if expectation.descending else ' < ').join(expectation.ordered)}"
    what, expected, name = (
        (expectation.metric or "", order, order) if expectation.ordered else describe_limits(expectation)
    )
    text = order if expectation.ordered else f"{what} {expected}"
    text += f"; {metric.reduce.replace('_', ' ')} of {metric.signal.text}{metric.window.text}"
    low, high = (
        (expectation.at_least, expectation.at_most) if metric.reduce in ("min", "max", "final") else (None, None)
    )
    every_sample = None if is_combined else extreme_violation(expectation, metric, tables)
    if every_sample and set(every_sample.cases) == set(cases):
        return replace(every_sample, name=expectation.name or name, text=text, metric=metric.name)
    return Violation(
        expectation.name or name,
        text,
        metric.signal,
        metric.window,
        cases,
        expectation.unit or metric.unit,
        low,
        high,
        metric.reduce,
        expectation.is_aggregate(metric),
        metric.name,
        worst={case: cases[case] for case in ranked},
    )
