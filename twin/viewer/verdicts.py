"""Expectations with failed spans and plots of a run, from its scenario; components need not be installed."""

from __future__ import annotations

import ast
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import ScenarioError, TwinError, UnknownNameError
from twin.results import (
    MetricResult,
    Signals,
    Window,
    consecutive_spans,
    dimension,
    evaluate,
    expression,
    find_violations,
    metric_formats,
    si_conversion,
    source_analyses,
    trace_to_inputs,
)
from twin.scenario import lint
from twin.viewer import following

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.results import Expectation, Expression, Metric, Plot, Violation
    from twin.scenario import ScenarioSpec
    from twin.viewer.page_data import MetricOfRun
    from twin.viewer.runs import OpenRun

    Key = tuple[str, int]

LEVELS = ("mean", "min", "max", "final", "rms")  # reductions whose value can be drawn in the plot of the signal


@dataclass(frozen=True)
class ExpectationView:
    """An expectation. `low`, `high`: limits in the display unit of `signal`; `spans`: failed spans [s], by case.

    `signal` is a normalized expression for comparisons; empty if the expectation has no signal. `failed_at`: when its
    signal first fails [s]; None for a metric, whose value is of a window. `sources`: the recorded signals from which an
    analysis computes `signal`; the spans are then the windows of these whose result fails.
    """

    name: str
    verdict: str
    detail: str
    signal: str = ""
    low: float | None = None
    high: float | None = None
    begin: float | None = None
    end: float | None = None
    variants: tuple[str, ...] = ()
    spans: dict[Key, list[tuple[float, float]]] | None = None
    failed_at: float | None = None
    sources: tuple[str, ...] = ()


class Verdicts:
    """Expectations and plots of a run. `problem`: why there are none."""

    def __init__(self, viewed: OpenRun) -> None:
        self.viewed = viewed
        self.scenario: ScenarioSpec | None = None
        self.problem = ""
        try:
            self.scenario, _ = lint(viewed.scenario_file, imports=False)
        except TwinError as error:
            self.problem = (
                f"{viewed.scenario_file}: cannot be read; events and limits are not shown. {error.problems[0]}"
            )

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of the signals that are judged by metrics only, as the metrics show them; by normalized expression."""
        judged = self.scenario.expectations if self.scenario else ()
        own = {ast.unparse(expectation.signal.tree) for expectation in judged if expectation.signal}
        results = self.results()
        formats = metric_formats(results)
        signals = {ast.unparse(result.metric.signal.tree): result.metric for result in reversed(results)}
        return {signal: formats[metric.name].unit for signal, metric in signals.items() if signal not in own}

    def seeds(self, variant: str) -> dict[int, None]:
        """Return the seeds with which a variant was run."""
        return {case["seed"]: None for case in self.viewed.summary["cases"] if case["variant"] == variant}

    def results(self) -> list[MetricResult]:
        """Return the metrics of the summary that the scenario defines, SI."""
        definitions = self.scenario.metrics if self.scenario else {}
        return [
            metric_result(definitions[name], variant, figures)
            for name, metric in self.viewed.summary["metrics"].items()
            if name in definitions
            for variant, figures in metric["variants"].items()
        ]

    def expectations(self) -> list[ExpectationView]:
        """Return all expectations in the order of the summary; failed ones are located in the signals."""
        outcomes = self.viewed.summary["expectations"]
        wanted = self.scenario.expectations if self.scenario else ()
        operation = self.viewed.summary.get(
            "operation", {}
        )  # of an operator's session, whose own requirements come last
        own = len(operation.get("warnings", ())) + ("targets" in operation)
        outcomes, added = outcomes[: len(outcomes) - own], outcomes[len(outcomes) - own :]
        warnings = [*(None,) * ("targets" in operation), *operation.get("warnings", ())]
        of_session = [self._of_session(*pair) for pair in zip(added, warnings, strict=True)]
        if len(wanted) != len(outcomes):  # another version of the scenario, or that of an operator's commands
            return [*(ExpectationView(each["name"], each["verdict"], each["detail"]) for each in outcomes), *of_session]
        bad = [
            expectation for expectation, outcome in zip(wanted, outcomes, strict=True) if outcome["verdict"] == "fail"
        ]
        failures = iter(self._failures(bad))  # names need not be unique
        judged = [
            self._judged(expectation, outcome, next(failures) if outcome["verdict"] == "fail" else None)
            for expectation, outcome in zip(wanted, outcomes, strict=True)
        ]
        return [*judged, *of_session]

    def metrics(self, compared: Mapping[tuple[str, str], MetricOfRun]) -> list[dict[str, Any]]:
        """Return the metrics by name and variant with their values as texts, and the signal and window of each."""
        entries = dict[str, dict[str, Any]]()
        for own in compared.values():
            metric, style = own.result.metric, own.style
            begin, end = seconds(metric.window)
            signal = ast.unparse(metric.signal.tree) if self._has(metric.signal) else ""
            entry = entries.setdefault(
                metric.name,
                {
                    "name": metric.name,
                    "description": metric.description,
                    "definition": f"{metric.reduce.replace('_', ' ')} of {metric.signal.text}{metric.window.text}",
                    "signal": signal,
                    "sources": self.analyzed(signal) if signal else [],
                    "reduce": metric.reduce,
                    "begin": begin,
                    "end": end,
                    "unit": style.label,
                    "tolerance": None if metric.tolerance is None else f"± {100 * metric.tolerance:g} %",
                    "rows": [],
                },
            )
            level = own.result.mean if metric.reduce in LEVELS else None
            entry["rows"].append(own.row() | {"level": self._shown(metric.signal, level)})
        return list(entries.values())

    def _judged(
        self, expectation: Expectation, outcome: Mapping[str, Any], failure: Violation | None
    ) -> ExpectationView:
        summary = (outcome["name"], outcome["verdict"], outcome["detail"])
        metric = self.scenario.metrics.get(expectation.metric) if self.scenario and expectation.metric else None
        signal = expectation.signal or (metric.signal if metric else None)
        if signal is None or not self._has(signal):
            return ExpectationView(*summary)
        window = expectation.window if expectation.signal is not None else metric.window if metric else Window()
        low, high = (expectation.at_least, expectation.at_most) if expectation.signal is not None else (None, None)
        if failure is not None:
            low, high = failure.low, failure.high
        begin, end = seconds(window)
        inputs = [] if failure is None else self._inputs(failure)
        spans = {} if failure is None else self._spans(*inputs[:1] or [failure])
        return ExpectationView(
            *summary,
            ast.unparse(signal.tree),
            self._shown(signal, low),
            self._shown(signal, high),
            begin,
            end,
            expectation.variants,
            None if failure is None else spans,
            min((own[0][0] for own in spans.values() if expectation.signal), default=None),
            tuple(ast.unparse(own.signal.tree) for own in inputs),
        )

    def _of_session(self, outcome: Mapping[str, Any], warning: Mapping[str, Any] | None) -> ExpectationView:
        """Return a requirement of an operator's session; one of a warning has its limit, and when it was shown."""
        summary = (outcome["name"], outcome["verdict"], outcome["detail"])
        if warning is None or not self._has(signal := expression.parse(warning["signal"])):
            return ExpectationView(*summary)
        factor, offset = si_conversion(warning["unit"], is_difference=False)
        high = self._shown(signal, factor * warning["limit"] + offset) or 0.0
        case = next(iter(self.viewed.recording.cases))  # a session has one
        samples = self.viewed.samples(case, signal.text)
        values = samples.shown(samples.y)
        is_outside = (np.abs(values) if high > 0.0 else values) > high
        is_outside &= samples.time <= (warning.get("end") or np.inf)  # later is not judged
        spans = {case: consecutive_spans(samples.time, is_outside)} if is_outside.any() else {}
        low = -high if high > 0.0 and values.min(initial=0.0) < 0.0 else None
        return ExpectationView(*summary, ast.unparse(signal.tree), low, high, spans=spans)

    def _inputs(self, failure: Violation) -> list[Violation]:
        """Return where a failed metric of an analysis comes from, as the report does: its worst window of each recorded input."""
        analyses = source_analyses(self.scenario.analyses if self.scenario else (), failure.signal)
        inputs = [source for analysis in analyses for source in analysis.inputs.values() if self._has(source)]
        try:
            traced = trace_to_inputs(failure, analyses, self._tables([failure.signal, *inputs])) if inputs else []
        except TwinError:  # the function of the analysis is not on this machine
            return []
        return [own for own in traced if own.span and self._has(own.signal)]

    def analyzed(self, signal: str) -> list[str]:
        """Return the recorded signals from which analyses compute a signal: a value of a window alone shows no cause."""
        analyses = source_analyses(self.scenario.analyses if self.scenario else (), expression.parse(signal))
        inputs = [source for analysis in analyses for source in analysis.inputs.values()]
        return [ast.unparse(source.tree) for source in inputs if self._has(source)]

    def _has(self, signal: Expression) -> bool:
        return all(operand.name in self.viewed.variables for operand in signal.signals)

    def _shown(self, signal: Expression, value: float | None) -> float | None:
        """Convert a limit [SI] to the display unit of a signal."""
        if value is None:
            return None
        factor, offset = si_conversion(self.viewed.unit(signal), dimension.is_difference(signal))
        return (value - offset) / factor

    def _failures(self, bad: list[Expectation]) -> list[Violation | None]:
        """Locate each failed expectation, None if that is not possible; reads signals only if there are any."""
        if not bad or self.scenario is None:
            return []
        metrics = [
            {name: metric for name, metric in self.scenario.metrics.items() if name == expectation.metric}
            for expectation in bad
        ]
        wanted = [
            *(expectation.signal for expectation in bad if expectation.signal),
            *(metric.signal for own in metrics for metric in own.values()),
        ]
        tables = self._tables(wanted)
        violations_of_each = (
            find_violations([expectation], evaluate(own, [expectation], tables), tables)
            for expectation, own in zip(bad, metrics, strict=True)
        )
        return [next(iter(violations), None) for violations in violations_of_each]

    def _tables(self, wanted: Iterable[Expression]) -> dict[Key, Signals]:
        recording, variables = self.viewed.recording, self.viewed.variables
        names = dict.fromkeys(
            operand.name for signal in wanted for operand in signal.signals if operand.name in variables
        )
        complete = {
            (case_summary["variant"], case_summary["seed"]): case_summary["complete"]
            for case_summary in self.viewed.summary["cases"]
        }
        return {
            case: Signals(
                recording.column(case, "time"),
                {
                    name: recording.values(case, name)
                    for name in names
                    if recording.has(case, variables[name].columns[0])
                },
                {name: variables[name].unit for name in names},
                complete.get(case, False),
            )
            for case in recording.cases
        }

    def _spans(self, failure: Violation) -> dict[Key, list[tuple[float, float]]]:
        """Return the failed spans of each case; of a metric over time, its window."""
        spans = {}
        for case in failure.cases:
            pair = self._tables([failure.signal])[case].evaluate(failure.signal, failure.window)
            if pair is None or not len(pair[0]):
                continue
            time, value = pair
            if failure.over_time:
                spans[case] = [(float(time[0]), float(time[-1]))]
            else:
                spans[case] = consecutive_spans(time, failure.violating_samples(case, time, value))
        return spans

    def plots(self) -> list[dict[str, Any]]:
        """Return the scenario's plots with recorded signals; of a followed rig its own plots."""
        if following.is_followed(self.viewed):
            return following.plots(self.viewed)
        plots = self.scenario.plots if self.scenario else ()
        return [data for plot in plots for part in split_by_axis(plot) if (data := self._plot(part))]

    def _plot(self, plot: Plot) -> dict[str, Any] | None:
        curves = [curve for curve in plot.curves if self._has(curve.signal) and (curve.x is None or self._has(curve.x))]
        try:
            for curve in curves:
                self.viewed.parse(curve.signal.text)
            lines = [self._shown(curves[0].signal, value) for value in plot.lines] if curves else []
            band = [self._shown(curves[0].signal, value) for value in plot.band] if curves and plot.band else []
        except (ScenarioError, UnknownNameError):
            return None
        if not curves:
            return None
        across = curves[0].x
        return {
            "title": plot.title,
            "signals": [curve.signal.text for curve in curves],
            "labels": [curve.label for curve in curves],
            "x": across.text if across is not None else "",
            "per_variant": plot.per_variant,
            "lines": lines,
            "band": band,
            "window": seconds(plot.window),
            "variants": list(plot.variants),
            "bands": {},
            "fan": "",
            "first": self.scenario is not None
            and len(self.scenario.console) > 0,  # titles and labels as in the console
            "range": None,
        }


def split_by_axis(plot: Plot) -> list[Plot]:
    """Split a plot whose curves have different horizontal axes: a pane of the viewer has one."""
    across = list(dict.fromkeys(curve.x for curve in plot.curves))
    if len(across) < 2:
        return [plot]
    return [
        replace(
            plot,
            title=f"{plot.title}, over {x.text if x else 'time'}",
            curves=tuple(curve for curve in plot.curves if curve.x == x),
        )
        for x in across
    ]


def metric_result(metric: Metric, variant: str, figures: Mapping[str, Any]) -> MetricResult:
    """Return a metric of one variant from a summary, whose figures are in the metric's unit."""
    factor, offset = si_conversion(metric.unit, metric.is_difference)

    def to_si(value: float | None) -> float | None:
        return None if value is None else factor * value + offset

    values = {int(seed): to_si(value) for seed, value in figures["values"].items()}
    return MetricResult(metric, variant, values, to_si(figures["paper"]), figures["verdict"])


def seconds(window: Window) -> tuple[float | None, float | None]:
    """Return a window [s]."""
    begin, end = (None if edge is None else clock.seconds(edge) for edge in (window.start_ns, window.stop_ns))
    return begin, end


def normalize(text: str) -> str:
    """Return an expression in normalized form, or the text unchanged if it is not an expression."""
    try:
        return ast.unparse(expression.parse(text).tree)
    except ScenarioError:
        return text
