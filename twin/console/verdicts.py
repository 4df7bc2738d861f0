"""Requirements and metrics of a scenario, judged on the rows of a session so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from twin import clock
from twin.errors import TwinError
from twin.live import OVER, RefusedError
from twin.results import Signals, evaluate, requirements_text
from twin.run import warning_result, warning_signals
from twin.scenario import lint

if TYPE_CHECKING:
    from pathlib import Path

    from twin.live import LiveSession
    from twin.results import Expectation, Expression, Metric, MetricResult

WAITING, NOT_JUDGED, METRIC = "waiting", "not judged", ""


@dataclass(frozen=True)
class Row:
    """A line of the list. `verdict`: pass, fail, waiting (it cannot be judged yet), not judged, or empty for a number alone."""

    verdict: str
    name: str
    detail: str
    is_metric: bool = False
    metric: Metric | None = None
    value: float | None = None  # of a metric [SI]
    reference: float | None = None  # of this variant [SI]
    is_targets: bool = False
    is_final: bool = True  # whether the window of a metric has ended
    is_warned: bool = False  # shown after the last target, when it is not judged
    is_outside: bool = False  # not judged, but outside of its limits for nominal values


class SessionVerdicts:
    """Judges what one variant with one seed can show; what compares variants or names signals that are not recorded is left out."""

    def __init__(self, path: Path, live: LiveSession) -> None:
        assert live.catalog is not None
        self.live, self.catalog = live, live.catalog
        scenario, _ = lint(path, imports=False)
        self.metrics = {
            name: replace(metric, unit=self._shown_unit(metric.unit, metric.signal))
            for name, metric in scenario.metrics.items()
            if self._applies(metric.variants) and self._recorded(metric.signal)
        }
        self.expectations = [
            replace(each, unit=self._shown_unit(each.unit, each.signal or self.metrics[each.metric or ""].signal))
            for each in scenario.expectations
            if self._can_judge(each)
        ]
        signals = [metric.signal for metric in self.metrics.values()]
        signals += [each.signal for each in self.expectations if each.signal is not None]
        self._names = list(dict.fromkeys(operand.name for signal in signals for operand in signal.signals))

    def _applies(self, variants: tuple[str, ...]) -> bool:
        return not variants or self.catalog.variant in variants

    def _shown_unit(self, unit: str, signal: Expression) -> str:
        """Return the unit of the charts where a number differs from it by milli alone: no N beside mN on one page."""
        shown = {self.catalog.signals[operand.name].display_unit for operand in signal.signals}
        return next((symbol for symbol in shown if unit == f"m{symbol}"), unit)

    def _recorded(self, signal: Expression) -> bool:
        signals = self.catalog.signals
        return all(operand.name in signals and signals[operand.name].recorded for operand in signal.signals)

    def _can_judge(self, expectation: Expectation) -> bool:
        if expectation.ordered or expectation.ends or not self._applies(expectation.variants):
            return False
        if expectation.signal is not None:
            return self._recorded(expectation.signal)
        return expectation.metric in self.metrics

    def rows(self, until: float = math.inf) -> list[Row]:
        """Judge the rows up to the end of the scenario, or of the session if an operator has controls: requirements, then metrics.

        All are listed from the start, so that the list does not grow. `until`: rows up to this time alone [s].
        """
        if not self._names:
            return []
        try:
            samples = self.live.read(self._names, None, min(until, self.catalog.judged_until))
        except RefusedError:
            return []
        now = float(samples.time[-1]) if len(samples.time) > 1 else -math.inf  # nothing has moved yet
        units = {name: self.catalog.signals[name].unit for name in self._names}
        tables = {(self.catalog.variant, self.catalog.seed): Signals(samples.time, samples.values, units)}
        end = now if self.live.state.phase in OVER else self.catalog.judged_until
        changed = is_changed(self.live, end)
        judged = [each for each in self.expectations if self._begin(each) <= now]
        metrics = {name: each for name, each in self.metrics.items() if begin(each) <= now}
        evaluation = evaluate(metrics, judged, tables, not changed, has_ended=now >= end)
        unfinished = {name for name, each in self.metrics.items() if now < min(end, metric_end(each))}
        results = {id(each): result for each, result in zip(judged, evaluation.expectation_results, strict=True)}
        reached = {result.metric.name: result for result in evaluation.metric_results}
        rows = []
        for each in self.expectations:
            if (result := results.get(id(each))) is not None:
                is_open = result.verdict == "fail" and each.signal is None and each.metric in unfinished
                verdict = WAITING if is_open else NOT_JUDGED if result.verdict == "skipped" else result.verdict
                rows.append(Row(verdict, result.name, result.detail, is_outside=result.is_outside))
            elif changed and each.nominal:
                rows.append(Row(NOT_JUDGED, each.name, "values were changed by hand"))
            else:
                rows.append(Row(WAITING, each.name, f"judged from {self._begin(each):g} s"))
        for name, metric in self.metrics.items():
            if name in reached:
                rows.append(metric_row(reached[name], name not in unfinished))
            elif begin(metric) > now:
                paper = metric.paper.get(self.catalog.variant)
                open_verdict = NOT_JUDGED if changed else WAITING
                verdict = open_verdict if paper is not None and metric.tolerance is not None else METRIC
                rows.append(Row(verdict, metric_name(metric), f"from {begin(metric):g} s", True, metric, None, paper))
        return rows

    def _begin(self, expectation: Expectation) -> float:
        """Time from which a requirement is judged [s]."""
        if expectation.signal is None and expectation.metric is not None:
            return begin(self.metrics[expectation.metric])
        return begin(expectation)


def is_changed(live: LiveSession, end: float = math.inf) -> bool:
    """Return whether the operator has set a value in this run before `end` [s]."""
    return any(time < end for time in live.changes.get(live.state.epoch, {}).values())


def metric_name(metric: Metric) -> str:
    """Return the name of a metric for people."""
    return metric.description or metric.name.replace("_", " ")


def metric_row(result: MetricResult, is_final: bool) -> Row:
    """Return the row of a metric; one that is not final may still come within its tolerance, and is not failed."""
    metric = result.metric
    reference = "" if result.paper is None else f"; reference {metric.shown(result.paper)}"
    verdict = {"pass": "pass", "fail": "fail" if is_final else WAITING, "none": "fail" if is_final else METRIC}
    verdict["other"] = METRIC if metric.tolerance is None else NOT_JUDGED
    detail = f"{metric.shown(result.mean, result.scale)}{reference}"
    name = metric_name(metric)
    verdict_now = verdict.get(result.verdict, METRIC)
    paper = None if result.verdict == "other" else result.paper  # at other settings it is not comparable
    return Row(verdict_now, name, detail, True, metric, result.mean, paper, is_final=is_final)


def warning_rows(live: LiveSession, end: float = math.inf, with_later: bool = True) -> list[Row]:
    """Return a row for each warning of the scenario: how long it was shown, and the largest value of its signal.

    Both count until now, or `end` of the score [s]; what was shown later is added unless `with_later` is False.
    """
    catalog = live.catalog
    if catalog is None or not catalog.warnings:
        return []
    try:
        samples = live.read(list(dict.fromkeys(name for each in catalog.warnings for name in warning_signals(each))))
    except TwinError:
        return []
    rows = []
    for warning in catalog.warnings if len(samples.time) else ():
        signal = catalog.signals[warning["signal"].partition("[")[0]]
        scale = signal.display_unit, signal.factor, signal.offset
        result = warning_result(
            samples.time, [samples.values[name] for name in warning_signals(warning)], warning, scale, end
        )
        verdict, later = "fail" if result["duration"] else "pass", result["afterwards"] * with_later
        is_warned = bool(later) and verdict == "pass"
        rows.append(Row(verdict, warning["text"], result["detail"] + later, is_warned=is_warned))
    return rows


def metric_end(metric: Metric) -> float:
    """Time from which a metric does not change [s]; infinite for that of a run's end."""
    return math.inf if metric.window.stop_ns is None else clock.seconds(metric.window.stop_ns)


def begin(judged: Metric | Expectation) -> float:
    """Return the begin of the window of a metric or requirement [s]."""
    start = judged.window.start_ns
    return 0.0 if start is None else clock.seconds(start)


def headline(rows: list[Row], has_ended: bool) -> str:
    """Return the result of all requirements in a sentence; empty if there are none. Metrics with a tolerance are requirements."""
    met, failed, still_open, left = (
        sum(row.verdict == verdict for row in rows) for verdict in ("pass", "fail", WAITING, NOT_JUDGED)
    )
    if has_ended:
        return requirements_text(met, met + failed, left + still_open, sum(row.is_outside for row in rows))
    if not met + failed + still_open:
        return ""
    return f"So far {met} met, {failed} failed{f', {still_open} open' * bool(still_open)}."
