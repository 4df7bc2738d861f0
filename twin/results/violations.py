"""Where expectations failed: which samples of which cases, so that a plot can mark them."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results.metrics import Evaluation, Expectation, Figure, Metric, Plot, subject
from twin.results.signals import Signals, Window, within

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from twin.results.expression import Expression

    Tables = Mapping[tuple[str, int], Signals]

PLACES: dict[str, Callable[[Any], Any]] = {  # of the metrics that are the value at one instant
    "max_abs": lambda x: np.argmax(np.abs(x)),
    "min":     np.argmin,
    "max":     np.argmax,
    "final":   lambda x: len(x) - 1,
}  # fmt: skip


@dataclass(frozen=True)
class Failure:
    """A failed expectation. `low`, `high` [SI]: limits of every sample, or of the one that `reduce` takes.

    `cases`: each with the time of that one sample [s], None if it is not one.
    """

    name: str
    told: str
    signal: Expression
    window: Window
    cases: dict[tuple[str, int], float | None]
    unit: str = ""
    low: float | None = None
    high: float | None = None
    reduce: str = ""

    @property
    def variants(self) -> tuple[str, ...]:
        """Those that failed."""
        return tuple(dict.fromkeys(variant for variant, _ in self.cases))

    @property
    def limits(self) -> list[float]:
        """Those that every sample had to keep."""
        return [one for one in (self.low, self.high) if one is not None]

    @property
    def over_time(self) -> bool:
        """Whether it is a metric of many samples: then none of them is the one that failed."""
        return bool(self.reduce) and self.reduce not in PLACES

    def judges(self, signal: Expression) -> bool:
        """Whether an expression is the one that failed, however it is spaced."""
        return ast.dump(signal.tree) == ast.dump(self.signal.tree)

    def bad(self, case: tuple[str, int], time: Any, value: Any) -> Any:
        """Which samples of a case failed, (n,): those outside of the limits, or the one that a metric is."""
        if not self.reduce:
            return within(np.asarray(time), self.window) & outside(value, self.low, self.high)
        found, place = np.zeros(len(time), bool), self.cases[case]
        if place is not None and len(time) and time[0] <= place <= time[-1]:
            found[np.argmin(np.abs(np.asarray(time) - place))] = True
        return found

    def seen(self, plot: Plot, tables: Tables) -> bool:
        """Whether a plot over time shows a sample that failed; of a metric of many samples, whether it shows any."""
        for curve in plot.curves:
            if curve.x is not None or not self.judges(curve.signal):
                continue
            for case in self.cases:
                if plot.variants and case[0] not in plot.variants:
                    continue
                for time, value in tables[case].pieces(self.signal, plot.window):
                    if self.over_time or self.bad(case, time, value).any():
                        return True
        return False


def outside(value: Any, low: float | None, high: float | None) -> Any:
    """Which values keep a limit not; what is not a number keeps none."""
    found = ~np.isfinite(value)
    if low is not None:
        found = found | (value < low)
    if high is not None:
        found = found | (value > high)
    return found


def failures(expectations: Iterable[Expectation], evaluation: Evaluation, tables: Tables) -> list[Failure]:
    """What failed, of signals or of metrics over them; how hardware ended a run is no matter of a plot."""
    found = []
    for one, outcome in zip(expectations, evaluation.outcomes, strict=False):
        if outcome.verdict != "fail" or one.ends:
            continue
        failure = of_signal(one, tables) if one.signal is not None else of_metric(one, evaluation.figures, tables)
        if failure is not None and failure.cases:
            found.append(failure)
    return found


def of_signal(one: Expectation, tables: Tables) -> Failure | None:
    """The cases with a sample outside of the limits."""
    assert one.signal is not None
    what, expected, name = subject(one)
    cases = dict.fromkeys(
        case
        for case, signals in tables.items()
        if signals.complete
        and (not one.variants or case[0] in one.variants)
        and any(outside(value, one.at_least, one.at_most).any() for _, value in signals.pieces(one.signal, one.window))
    )
    told = f"{what} {expected}{one.window.text}"
    return Failure(name, told, one.signal, one.window, cases, one.unit, one.at_least, one.at_most)


def instant(signals: Signals, metric: Metric) -> float | None:
    """When a metric has its value [s]; None if that is not one sample."""
    if metric.reduce not in PLACES:
        return None
    take = PLACES[metric.reduce]
    found = [
        (time[take(value)], value[take(value)])
        for time, value in signals.pieces(metric.signal, metric.window)
        if len(value)
    ]
    return float(found[take(np.array([value for _, value in found]))][0]) if found else None


def of_metric(one: Expectation, figures: Iterable[Figure], tables: Tables) -> Failure | None:
    """The cases whose metric is outside of the limits; all that an order or a mean is over."""
    own = [figure for figure in figures if figure.metric.name == one.metric]
    wanted = one.ordered or one.variants
    chosen = [figure for figure in own if not wanted or figure.variant in wanted]
    if not chosen:
        return None
    metric = chosen[0].metric
    together = bool(one.ordered) or one.mean
    cases = {
        (figure.variant, seed): instant(tables[figure.variant, seed], metric)
        for figure in chosen
        for seed, value in figure.values.items()
        if together or outside(np.nan if value is None else value, one.at_least, one.at_most)
    }
    order = f"{one.metric}: {(' > ' if one.descending else ' < ').join(one.ordered)}"
    what, expected, name = (one.metric or "", order, order) if one.ordered else subject(one)
    told = order if one.ordered else f"{what} {expected}"
    told += f"; {metric.reduce.replace('_', ' ')} of {metric.signal.text}{metric.window.text}"
    low, high = (one.at_least, one.at_most) if metric.reduce in ("min", "max", "final") else (None, None)
    return Failure(
        one.name or name, told, metric.signal, metric.window, cases, one.unit or metric.unit, low, high, metric.reduce
    )
