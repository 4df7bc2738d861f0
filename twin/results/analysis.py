"""Analyses: functions of recorded signals whose results are signals too, under the analysis's name.

    analyses:
      bouc_wen: {function: "fmus.bouc_wen_compensator.identify:analysis", inputs: {x_in: tracker.x, x_out: tracker.y}}

The function receives the inputs as arrays in SI by keyword, and returns a dict: a number, or an array as long as its
inputs, for each name of its attribute `outputs` (name -> unit). Metrics, plots and signals.parquet then contain
`bouc_wen.alpha_x` like a member's variable. An empty dict, as for a run that is too short: there are no such signals, and
what is expected of them is not judged. A function that counts rows instead of seconds has an attribute
`row_interval` [s]; a scenario that records at another interval is refused. A function that takes its first row for a
certain time has `first_row` [s]; a scenario or analysis that begins at another time is refused. A function whose results
are of the last seconds before each row has `window_length` [s]; a report marks the window whose result fails.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import catalog
from twin.coupling import MemberVariable
from twin.errors import ScenarioError, TwinError, nearest
from twin.results.evaluation.reduction import window_end
from twin.results.recording.signals import FULL_RUN, Window, window_mask

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from types import ModuleType

    from twin.results.evaluation.expression import Expression
    from twin.results.evaluation.violations import Violation
    from twin.results.recording.signals import Signals

    Tables = Mapping[tuple[str, int], Signals]


def callable_names(module: ModuleType) -> list[str]:
    """Return the names of a module's public callables."""
    return [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]


@dataclass(frozen=True)
class Analysis:
    """Analysis of a scenario file. No `variants`: all that have its inputs."""

    name: str
    function: str
    inputs: dict[str, Expression]
    window: Window = FULL_RUN
    variants: tuple[str, ...] = ()
    where: str = field(default="", compare=False)

    def load(self) -> Callable[..., dict[str, Any]]:
        """Import the function."""
        path, _, name = self.function.partition(":")
        if not path or not name:
            raise ScenarioError(f"{self.where}: analysis {self.function!r}: write `module:function`.")
        try:
            module = catalog.module(path, self.function)
        except TwinError as error:
            raise ScenarioError(f"{self.where}: {error}") from None
        function: Callable[..., dict[str, Any]] | None = getattr(module, name, None)
        if function is None:
            raise ScenarioError(
                f"{self.where}: {path} has no function {name!r}. {nearest(name, callable_names(module))}"
            )
        if not isinstance(getattr(function, "outputs", None), dict):
            raise ScenarioError(f"{self.where}: {self.function} needs an attribute `outputs`, a dict of name -> unit.")
        return function

    @property
    def window_length(self) -> float:
        """Duration before each row of which its results are [s]; 0 if they are of the entire run."""
        return float(getattr(self.load(), "window_length", 0.0))

    def variables(self) -> dict[str, MemberVariable]:
        """Return the outputs of the analysis as variables of a member."""
        outputs: dict[str, str] = self.load().outputs  # type: ignore[attr-defined]
        return {
            name: MemberVariable(name, "output", "discrete", "Float64", np.dtype(np.float64), (), unit)
            for name, unit in outputs.items()
        }

    def rows_problem(self, start_ns: clock.Time, interval_ns: clock.Time) -> str:
        """Return why rows from `start_ns` at `interval_ns` [ns] cannot be analyzed; empty if they can."""
        function = self.load()
        interval, start = getattr(function, "row_interval", None), getattr(function, "first_row", None)
        start_ns = max(start_ns, self.window.start_ns or start_ns)
        remove = f"or remove it: `analyses: {{{self.name}: null}}`."
        if interval is not None and (needed := round(interval * clock.NANOSECONDS)) != interval_ns:
            expected = clock.text(needed)
            return (
                f"{self.where}: {self.function} expects rows every {expected}, and the record has one every"
                f" {clock.text(interval_ns)}. Set `record: {{every: {expected}}}`, {remove}"
            )
        if start is not None and (needed := round(start * clock.NANOSECONDS)) != start_ns:
            return (
                f"{self.where}: {self.function} expects its first row at {clock.text(needed)}, and gets it at"
                f" {clock.text(start_ns)}. Change start_time or the analysis's `from`, {remove}"
            )
        return ""

    def apply(self, signals: Signals) -> Signals:
        """Return the signals with those of the analysis, which are NaN outside of its window."""
        inputs = {name: analysis_input(signals, expression, self.window) for name, expression in self.inputs.items()}
        arrays = {name: values for name, values in inputs.items() if values is not None}
        if len(arrays) < len(self.inputs):
            return signals
        try:
            results = self.load()(**arrays)
        except TwinError:
            raise
        except Exception as error:  # a user's function may raise anything
            raise TwinError(f"{self.where}: {self.function} failed: {type(error).__name__}: {error}") from error
        if not results:
            return signals
        mask = window_mask(np.asarray(signals.time), self.window)
        values, units, lengths = dict(signals.values), dict(signals.units), dict(signals.window_lengths)
        for name, variable in self.variables().items():
            column = np.full(len(mask), np.nan)
            column[mask] = results[name]
            values[f"{self.name}.{name}"] = column
            units[f"{self.name}.{name}"] = variable.unit
            lengths[f"{self.name}.{name}"] = self.window_length
        return replace(signals, values=values, units=units, window_lengths=lengths)


def source_analyses(analyses: Iterable[Analysis], signal: Expression) -> list[Analysis]:
    """Return the analyses that compute the signals of an expression."""
    names = {operand.name.partition(".")[0] for operand in signal.signals}
    return [analysis for analysis in analyses if analysis.name in names]


def trace_to_inputs(violation: Violation, analyses: Sequence[Analysis], tables: Tables) -> list[Violation]:
    """Return where a violated metric of an analysis comes from: its worst window of each input; else the violation itself."""
    sources = source_analyses(analyses, violation.signal) if violation.metric else []
    if not sources:
        return [violation]
    ends: dict[tuple[str, int], float | None] = {}
    first_end = np.inf  # of the first window: it has the value of all rows before
    for case, instant in (violation.worst or violation.cases).items():
        parts = list(tables[case].evaluate_parts(violation.signal, violation.window))
        if instant is not None and parts:
            ends[case] = window_end(parts, instant)
            times = [time[np.isfinite(value)] for time, value in parts]
            first_end = min(first_end, window_end(parts, next(time[0] for time in times if len(time))))
    units = next(iter(tables.values())).units
    return [
        replace(
            violation,
            signal=signal,
            window=Window(round(max(first_end - analysis.window_length, 0.0) * clock.NANOSECONDS)),
            cases=ends,
            worst=ends,
            unit=units.get(signal.single.name, "") if signal.single else "",
            low=None,
            high=None,
            span=analysis.window_length,
        )
        for analysis in sources
        for signal in analysis.inputs.values()
        if analysis.window_length and ends
    ]


def analysis_input(signals: Signals, expression: Expression, window: Window) -> Any:
    """Return an input of an analysis: a value for each sample, (n, ...) for an array's name; None: not recorded."""
    if (pair := signals.evaluate(expression, window)) is not None:
        return pair[1]
    arrays = signals.to_si({expression.single.name}) if expression.single and not expression.single.index else {}
    return next((values[window_mask(np.asarray(signals.time), window)] for values in arrays.values()), None)
