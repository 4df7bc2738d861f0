"""Metrics over recorded signals, reference values of the paper, and acceptance criteria.

Everything is in coherent SI units; a metric's own unit is applied for output.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from twin.results.evaluation import dimension
from twin.results.evaluation.coverage import (
    describe_case,
    describe_cut,
    describe_cut_expectation,
    describe_judged,
    describe_late,
    describe_unjudged,
    judged_variants,
    list_names,
    variants_of,
)
from twin.results.evaluation.hardware_termination import HardwareTermination, check_termination
from twin.results.evaluation.limit_failures import (
    CaseRange,
    describe_failure,
    describe_limits,
    extreme_samples,
    in_windows,
    list_cases,
    violating_samples,
    with_statistic,
)
from twin.results.evaluation.metric_format import display_units
from twin.results.evaluation.ordering import check_order
from twin.results.evaluation.reduction import INSTANT_INDEX, extreme_times, is_outside, reduce_samples
from twin.results.recording.signals import FULL_RUN, Signals, Window, format_value

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from twin.results.evaluation.expression import Expression

NEUTRAL_REDUCTIONS = ("mean", "final")  # no seed of them is the worst one
DIFFERENCE_REDUCTIONS = ("std", "peak_to_peak")  # differences, whatever the signal is


@dataclass(frozen=True)
class Metric:
    """One number per run. `paper`: published value of each variant; `tolerance`: 0.2 is ± 20 %; no `variants`: all."""

    name: str
    signal: Expression
    reduce: str
    window: Window = FULL_RUN
    unit: str = ""
    paper: dict[str, float] = field(default_factory=dict)
    tolerance: float | None = None
    variants: tuple[str, ...] = ()
    description: str = ""
    where: str = field(default="", compare=False)
    codes: dict[int, str] = field(default_factory=dict)  # names of the values of a code, such as a state

    def named(self, value: float | None, text: str) -> str:
        """Return the text of a value with the name of the code that it is: `8 done`."""
        return f"{text} {self.codes[int(value)]}" if value in self.codes and value is not None else text

    @property
    def is_difference(self) -> bool:
        """Whether the offset of the unit does not matter, as in 2 degC more."""
        return self.reduce in DIFFERENCE_REDUCTIONS or dimension.is_difference(self.signal)

    @property
    def has_worst(self) -> bool:
        """Whether one of the seeds is the worst."""
        return self.reduce not in NEUTRAL_REDUCTIONS

    def shown(self, value: float | None, scale: float = 0.0) -> str:
        """Format a value of the metric in its unit."""
        return format_value(value, self.unit, scale, self.is_difference)


@dataclass(frozen=True)
class Expectation:
    """Acceptance criterion: limits of a metric, of every sample of a signal, or an order of variants."""

    name: str
    metric: str | None = None
    signal: Expression | None = None
    variants: tuple[str, ...] = ()
    at_least: float | None = None
    at_most: float | None = None
    ordered: tuple[str, ...] = ()
    descending: bool = True
    window: Window = FULL_RUN
    unit: str = ""
    mean: bool = False  # of a metric: the mean over all variants and seeds is judged, not each run
    where: str = field(default="", compare=False)
    ends: str = ""  # stopped or completed: how the hardware ends a run, everything at rest
    is_difference: bool = False  # what is judged: the unit's offset does not matter
    margin: float = 0.0  # of an order: by how much at least each must differ from the one before; SI
    margin_part: float = 0.0  # the same as part of the one before
    nominal: bool = False  # judged with the scenario's own parameters alone
    excluded: tuple[str, ...] = ()  # variants that `except` names; `variants` are then all others
    unlisted: tuple[str, ...] = ()  # variants of the extending file, which an inherited list cannot name

    def gap(self, before: float, after: float) -> float:
        """Return the difference of two values in the expected direction, minus the margin."""
        difference = before - after if self.descending else after - before
        return difference - self.margin - self.margin_part * abs(before)

    def bound(self, before: float) -> float:
        """Return the limit of the value after another one of an order."""
        return before + (-1.0 if self.descending else 1.0) * (self.margin + self.margin_part * abs(before))

    def judges(self, result: MetricResult) -> bool:
        """Whether a metric of a variant is judged."""
        names = self.ordered or self.variants
        return result.metric.name == self.metric and (not names or result.variant in names)

    def is_aggregate(self, metric: Metric) -> bool:
        """Whether no single sample violates it: an order, a mean of runs, or a metric of many samples."""
        return bool(self.ordered) or self.mean or metric.reduce not in INSTANT_INDEX

    def shown(self, value: float | None, scale: float = 0.0) -> str:
        """Format a value in the unit of the limits."""
        return format_value(value, self.unit, scale, self.is_difference)


@dataclass(frozen=True)
class PlotCurve:
    """Curve of a plot; `x` is given for loops such as force over position."""

    signal: Expression
    label: str
    x: Expression | None = None


@dataclass(frozen=True)
class Plot:
    """Plot of the report. `per_variant`: one panel for each variant, else one panel with the curves of all variants.

    `points`: a marker for each sample instead of a line, as for measurements at rest.
    """

    title: str
    curves: tuple[PlotCurve, ...]
    label: str = ""
    unit: str = ""
    x_label: str = ""
    x_unit: str = ""
    window: Window = FULL_RUN
    per_variant: bool = False
    band: tuple[float, float] | None = None
    lines: tuple[float, ...] = ()
    variants: tuple[str, ...] = ()
    where: str = field(default="", compare=False)
    points: bool = False

    @property
    def expressions(self) -> list[Expression]:
        """All expressions of its curves."""
        return [part for curve in self.curves for part in (curve.x, curve.signal) if part is not None]

    @property
    def is_difference(self) -> bool:
        """Whether the offset of the unit does not matter, as in 2 degC more."""
        return all(dimension.is_difference(curve.signal) for curve in self.curves)

    def shown(self, value: float) -> str:
        """Format a value on the axis."""
        return format_value(value, self.unit, is_difference=self.is_difference)


@dataclass(frozen=True)
class MetricResult:
    """One metric of one variant: its value for each seed, and the paper's. SI; None: not a finite number.

    `verdict`: pass, fail, info (without reference), other (not at the paper's settings), cut (the run ends before its window),
    none (no value: fails).
    """

    metric: Metric
    variant: str
    values: dict[int, float | None]
    paper: float | None
    verdict: str = "info"
    scale: float = 0.0  # size of the numbers that the values were made of

    @property
    def mean(self) -> float | None:
        """Mean over seeds; None if a seed has no value."""
        values = [value for value in self.values.values() if value is not None]
        return float(np.mean(values)) if values and len(values) == len(self.values) else None

    @property
    def worst(self) -> float | None:
        """Smallest value of the seeds for `min`, largest for `max`, else the largest magnitude."""
        values = [value for value in self.values.values() if value is not None]
        if not values or len(values) < len(self.values):
            return None
        return {"min": min(values), "max": max(values)}.get(self.metric.reduce, max(values, key=abs))

    @property
    def ratio(self) -> float | None:
        """Mean over the paper's value."""
        return self.mean / self.paper if self.mean is not None and self.paper else None


@dataclass(frozen=True)
class ExpectationResult:
    """Result of one expectation: pass, fail, or skipped if its variants were not run, or not to the end of its window.

    `detail`: one line; of a failure the worst values, the limits, the time and the cases. `more`: what was left out there.
    `cases`: variant, seed, value and time of each that fails, the worst first. `is_outside`: it is skipped, as it is of
    the scenario's own parameters, but its values lie outside of the limits.
    """

    name: str
    verdict: str
    detail: str
    more: str = ""
    cases: tuple[tuple[str, int, str, str], ...] = ()
    is_outside: bool = False


@dataclass(frozen=True)
class Evaluation:
    """All metrics and expectation results of a run."""

    metric_results: tuple[MetricResult, ...] = ()
    expectation_results: tuple[ExpectationResult, ...] = ()
    paper_applies: bool = True
    unjudged: tuple[str, ...] = ()  # sentences on variants that were run and not judged

    @property
    def passed(self) -> bool:
        """Whether all acceptance criteria are met."""
        verdicts = {result.verdict for result in self.metric_results} | {
            result.verdict for result in self.expectation_results
        }
        return not {"fail", "none"} & verdicts


def evaluate(
    metrics: Mapping[str, Metric],
    expectations: Iterable[Expectation],
    tables: Mapping[tuple[str, int], Signals],
    paper_applies: bool = True,
    terminations: Mapping[tuple[str, int], HardwareTermination] = MappingProxyType({}),
    has_ended: bool = True,
    unchanged: Collection[str] = (),
) -> Evaluation:
    """Evaluate metrics and expectations; `tables`: (variant, seed) -> signals. Incomplete cases are ignored.

    `has_ended`: whether nothing will be added; then a run that ends before a window passes no expectation in it. `unchanged`:
    variants with the paper's settings although `paper_applies` is false.
    """
    complete = {case: signals for case, signals in tables.items() if signals.complete}
    run = variants_of(complete)
    stopped = any(ending.time_ns is not None for ending in terminations.values())  # by drives: that fails
    unstopped = complete if has_ended and not stopped else {}
    comparable = run if paper_applies else unchanged
    results = [
        with_verdict(compute_metric(metric, variant, complete), complete, variant in comparable, has_ended, unstopped)
        for metric in metrics.values()
        for variant in run
        if not metric.variants or variant in metric.variants
    ]
    present = tuple(result for result in results if result.values)
    expectations = tuple(in_display_units(expectations, metrics))
    expectation_results = []
    for expectation in expectations:
        if late := describe_late(metrics.get(expectation.metric or "", expectation).window, unstopped):
            result = ExpectationResult(describe_limits(expectation)[2], "skipped", late)
        elif expectation.ends:
            result = ExpectationResult(*check_termination(expectation, complete, terminations))
        else:
            result = check_expectation(expectation, present, complete)
            is_passed = has_ended and result.verdict == "pass"
            if is_passed and (cut := describe_cut_expectation(expectation, metrics, complete)):
                result = replace(result, verdict="skipped", detail=cut)
        if result.verdict != "skipped":
            suffix = describe_judged(expectation, judged_variants(expectation, present, complete), run)
            result = replace(result, more=f"{result.more} {suffix}".strip())
            if expectation.nominal and not {*run} & {*(expectation.variants or run)} <= {*comparable}:
                result = without_verdict(result)
        expectation_results.append(result)
    unjudged = describe_unjudged(expectations, present, complete) if has_ended else ()
    return Evaluation(present, tuple(expectation_results), paper_applies, unjudged)


def without_verdict(result: ExpectationResult) -> ExpectationResult:
    """Return the result of a requirement of the scenario's own parameters for a run that changes them: its values alone."""
    detail, is_outside = result.detail, result.verdict == "fail"
    if is_outside:
        detail = detail.replace("; fails in ", "; outside in ")
        detail = f"Outside of its limits for nominal values: {detail}"
    detail += " Not judged: this run changes the scenario's own parameters."
    return ExpectationResult(result.name, "skipped", detail, result.more, is_outside=is_outside)


def in_display_units(expectations: Iterable[Expectation], metrics: Mapping[str, Metric]) -> Iterator[Expectation]:
    """Iterate over the expectations, those of metrics in the unit of the metric in tables; their names do not change."""
    units = display_units({name: metric.unit for name, metric in metrics.items()})
    for expectation in expectations:
        unit = units.get(expectation.metric or "") or expectation.unit
        if unit == expectation.unit:
            yield expectation
        else:
            name = expectation.name or ("" if expectation.ordered else describe_limits(expectation)[2])
            yield replace(expectation, unit=unit, name=name)


def compute_metric(metric: Metric, variant: str, tables: Mapping[tuple[str, int], Signals]) -> MetricResult:
    """Compute a metric of a variant; without values if the variant has no such signal."""
    values: dict[int, float | None] = {}
    scale = 0.0
    for (name, seed), signals in tables.items():
        if name != variant or not signals.has(metric.signal):
            continue
        value = reduce_samples(
            metric.reduce, (samples for _, samples in signals.evaluate_parts(metric.signal, metric.window))
        )
        values[seed] = value if np.isfinite(value) else None
        scale = max(scale, signals.scale(metric.signal) if np.isfinite(value) else 0.0)
    return MetricResult(metric, variant, values, metric.paper.get(variant), scale=scale)


def with_verdict(
    result: MetricResult,
    tables: Mapping[tuple[str, int], Signals],
    paper_applies: bool,
    has_ended: bool,
    unstopped: Mapping[tuple[str, int], Signals],
) -> MetricResult:
    """Add the verdict: whether the mean over seeds is within the tolerance of the paper's value. `unstopped`: runs that no drive stopped."""
    metric, verdict = result.metric, "info"
    if result.mean is None:
        verdict = "cut" if describe_late(metric.window, unstopped) else "none"
    elif has_ended and describe_cut(metric.window, metric.signal, (result.variant,), tables):
        verdict = "cut"
    elif result.paper is not None and not paper_applies:
        verdict = "other"
    elif result.paper is not None and metric.tolerance is not None:
        # the last digit of a decimal tolerance must not decide: 1.2 times 0.1 is not exactly 0.12
        allowed = metric.tolerance * abs(result.paper) * (1 + 1e-9)
        verdict = "pass" if abs(result.mean - result.paper) <= allowed else "fail"
    return replace(result, verdict=verdict)


def check_expectation(
    expectation: Expectation, metric_results: Iterable[MetricResult], tables: Mapping[tuple[str, int], Signals]
) -> ExpectationResult:
    """Check an expectation. A case that has its signal but no sample in the window fails."""
    results = {result.variant: result for result in metric_results if result.metric.name == expectation.metric}
    if expectation.ordered:
        return ExpectationResult(*check_order(expectation, results))
    ranges: list[CaseRange] = []
    scale = max((result.scale for result in results.values()), default=0.0)
    for (variant, seed), signals in tables.items():
        if expectation.variants and variant not in expectation.variants:
            continue
        case = (variant, seed)
        if expectation.signal is None:
            value = results[variant].values.get(seed) if variant in results else None
            if variant in results:
                metric, own = results[variant].metric, np.nan if value is None else value
                is_bad = is_outside(own, expectation.at_least, expectation.at_most)
                parts = list(signals.evaluate_parts(metric.signal, metric.window)) if is_bad else []
                times = extreme_times(metric.reduce, expectation.at_least, expectation.at_most, parts)
                row = in_windows(CaseRange(case, own, own, times[0], *times), metric.signal, metric.window, signals)
                ranges.append(with_statistic(row, metric.reduce, parts))
        elif signals.has(expectation.signal):
            extremes = [
                extreme_samples(part, expectation)
                for part in signals.evaluate_parts(expectation.signal, expectation.window)
            ]
            if not any(map(len, extremes)):
                return no_samples_result(expectation, describe_case(case), not extremes)
            scale = max(scale, signals.scale(expectation.signal))
            times, values = np.concatenate(extremes).T
            low, high = int(np.argmin(values)), int(np.argmax(values))
            outside = times[is_outside(values, expectation.at_least, expectation.at_most)]
            row = CaseRange(case, values[low], values[high], times[low], times[high], min(outside, default=None))
            ranges.append(in_windows(row, expectation.signal, expectation.window, signals))
    if expectation.mean and ranges:
        mean = float(np.mean([row.low for row in ranges]))
        ranges = [CaseRange(None, mean, mean)]
    return check_limits(expectation, ranges, list(tables), scale)


def no_samples_result(expectation: Expectation, case: str, is_array: bool) -> ExpectationResult:
    """Result of an expectation that cannot be evaluated for a case although its signal was recorded."""
    what, expected, name = describe_limits(expectation)
    reason = "is no single value" if is_array else f"has no sample{expectation.window.text.replace(',', '')}"
    advice = "Name its elements." if is_array else "Change `from` and `to`, or record more often."
    return ExpectationResult(name, "fail", f"{what} {reason} in {case}; expected {expected}. {advice}")


def check_limits(
    expectation: Expectation, ranges: list[CaseRange], run: Sequence[tuple[str, int]], scale: float = 0.0
) -> ExpectationResult:
    """Check the limits for every case. `run`: all cases; `scale`: as in `format_value`."""
    what, expected, name = describe_limits(expectation)
    if not ranges:
        of_variants = f" of {list_names(expectation.variants, 'or')}" if expectation.variants else ""
        return ExpectationResult(
            name, "skipped", f"Not judged: this run has no complete case{of_variants} with {what}."
        )

    def shown(value: float) -> str:
        return "not a number" if np.isnan(value) else expectation.shown(value, scale)

    failing = [row for row in ranges if violating_samples(expectation, row)]
    if not failing:
        span = " to ".join(
            dict.fromkeys((shown(min(row.low for row in ranges)), shown(max(row.high for row in ranges))))
        )
        return ExpectationResult(name, "pass", f"{what} was {span}; expected {expected}.")
    detail, more = describe_failure(expectation, failing, run, shown)
    return ExpectationResult(name, "fail", detail, more, list_cases(expectation, failing, shown))
