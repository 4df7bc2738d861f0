"""Plots of recorded signals: of finished runs and of simulations."""

from __future__ import annotations

import fnmatch
from abc import abstractmethod
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from twin import clock
from twin.errors import ScenarioError, TwinError, UnknownNameError, quote_names
from twin.face import notebook
from twin.face.conversions import as_list, nanoseconds
from twin.face.interactive import add_still_picture, interactive_figure, is_plotly_installed
from twin.face.progress import in_notebook
from twin.face.signal_names import array_of, describe_unknown, find_variable, flatten, names_of
from twin.files import split_unit
from twin.results import Plot, PlotCurve, Window, dimension, expression, plotting

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from twin.results import EventLine, Expression, RecordedVariable, Signals

OPERATORS = "+-*/(<>="  # signs that an expression has, and few names


def in_window(plot: Plot, start: float | str | None, stop: float | str | None) -> Plot:
    """Return a plot from `start` to `stop`, each that of the plot if None."""
    begin = plot.window.start_ns if start is None else nanoseconds(start, "start")
    end = plot.window.stop_ns if stop is None else nanoseconds(stop, "stop")
    if begin is not None and end is not None and begin >= end:
        raise TwinError(
            f"start: {clock.text(begin)} is not before {clock.text(end)}. Give an earlier start, or a later stop."
        )
    return replace(plot, window=Window(begin, end))


class PlotSource(NamedTuple):
    """Cases to plot. `declared`: recorded by any variant. `internal`: memory of components, which patterns leave out."""

    variants: Sequence[str]
    seeds: Sequence[int]
    declared: Mapping[str, RecordedVariable]
    recorded: Mapping[str, RecordedVariable]
    internal: Collection[str]
    plots: Sequence[Plot]
    event_lines: Sequence[EventLine]
    cases: Callable[[list[str]], Mapping[tuple[str, int], Signals]]  # with some recorded signals, by variant and seed


class SignalPlots:
    """Recorded signals of cases, and their plots."""

    _where: str  # in messages

    @property
    @abstractmethod
    def _source(self) -> PlotSource: ...

    def _find_recorded(self, name: str) -> RecordedVariable:
        return find_variable(name, self._source.recorded, self._where)

    def _parsed(self, text: str, candidates: Iterable[str]) -> Expression:
        """Return an expression of recorded signals; UnknownNameError or TwinError if it is none."""
        try:
            parsed = expression.parse(text)
        except ScenarioError as error:
            is_expression = any(sign in text.rstrip("*") for sign in OPERATORS)
            reason = f", and {str(error).rstrip('.')}" if is_expression else ""
            raise UnknownNameError(
                f"{self._where}: {describe_unknown(text, self._source.recorded, candidates, reason)}"
            ) from None
        for signal in parsed.signals:
            self._find_recorded(str(signal))
        if problem := parsed.array_problem({name: self._source.recorded[name].shape for name in names_of(parsed)}):
            raise TwinError(f"{self._where}: {problem}")
        return parsed

    def _names_of(self, text: str, names: Iterable[str]) -> list[str]:
        """Return the names with a pattern, without internal states unless there are only such; else the text itself."""
        is_name = text in self._source.recorded or array_of(text, self._source.recorded) is not None
        matches = [] if is_name else fnmatch.filter(names, text)
        return [name for name in matches if name not in self._source.internal] or matches or [text]

    def plot(
        self,
        *what: str | Sequence[str],
        variants: str | Sequence[str] = (),
        seeds: int | Sequence[int] = (),
        start: float | str | None = None,
        stop: float | str | None = None,
        xy: tuple[str, str] | None = None,
        other: SignalPlots | None = None,
        interactive: bool | None = None,
    ) -> Any:
        """Return a figure: plots of the scenario by title, or any signals, one panel for each unit.

        Signals may be patterns, such as `sensor.*`, or expressions, such as `abs(sensor.force - controller.setpoint)`. Without
        names: all plots. `start`, `stop`: times, such as `"12 s"`, instead of those of the plots. `xy`: a signal and the one over
        which it is plotted, horizontal first, as in a scenario. `other`: a second run or simulation, dashed. Of several seeds the
        mean and the range. `interactive`: as a figure of plotly instead of Matplotlib; by default in notebooks if it is installed.
        """
        plots = [in_window(plot, start, stop) for plot in self._chosen_plots(flatten(what), xy)]
        expressions = [
            operand for plot in plots for curve in plot.curves for operand in (curve.signal, curve.x) if operand
        ]
        names = dict.fromkeys(
            signal.name for operand in expressions for signal in operand.signals if signal.name in self._source.recorded
        )
        chosen: dict[tuple[str, int], Signals] = {}
        run_variants = dict.fromkeys(self._source.variants)
        for signals, mark in ((self, ""), (other, plotting.OTHER_RUN)):
            if signals is None:
                continue
            run_variants |= dict.fromkeys(signals._source.variants)
            chosen |= {
                (variant + mark, seed): table
                for (variant, seed), table in signals._source.cases(
                    [name for name in names if name in signals._source.recorded]
                ).items()
                if variant in (as_list(variants) or signals._source.variants)
                and seed in (as_list(seeds) or signals._source.seeds)
            }
        names_of_cases = (*self._source.variants, *self._source.seeds)
        unknown = [name for name in (*as_list(variants), *as_list(seeds)) if name not in names_of_cases]
        if not chosen or unknown:
            quoted = ", ".join(quote_names(self._source.variants))
            remedy = f"There are variants {quoted}; seeds {', '.join(map(str, self._source.seeds))}."
            which = f"{unknown[0]!r}" if unknown else "these variants and seeds"
            raise TwinError(f"{self._where}: nothing was run with {which}. {remedy}")
        arguments = (plots, chosen, self._source.event_lines, tuple(run_variants))
        if interactive is None:
            interactive = in_notebook() and is_plotly_installed()
        draw = interactive_figure if interactive else plotting.plot_figure
        if (figure := draw(*arguments)) is None:
            during = "" if start is None and stop is None else " and at these times"
            raise TwinError(
                f"{self._where}: none of the signals was recorded in these variants{during}. Choose others."
            )
        if not interactive:
            figure._repr_html_ = partial(notebook.figure, figure)
        elif in_notebook():
            add_still_picture(figure, partial(plotting.plot_figure, *arguments))
        return figure

    def _chosen_plots(self, what: Sequence[str], xy: Sequence[str] | None) -> list[Plot]:
        """Return the scenario's plots with these titles, those of signals and `xy`; by default all, or some signals without any."""
        own = {plot.title: plot for plot in self._source.plots}
        plots = [self._in_unit(own[title]) for title in (what or own) if title in own and (what or not xy)]
        if xy:
            if isinstance(xy, str) or len(xy) != 2:
                raise TwinError(
                    f'xy: {xy!r} is not two signals. Give, for example, ("heart.position", "sensor.force").'
                )
            (x_unit, across), (unit, up) = (self._with_unit(text, list(self._source.recorded)) for text in xy)
            curve = PlotCurve(up, up.text, across)
            plots.append(Plot("", (curve,), curve.label, unit, x_unit=x_unit, per_variant=True))
        scalars = [name for name in self._source.recorded if not self._source.recorded[name].shape]
        signals = [
            name
            for text in what
            if text not in own
            for name in self._names_of(text, scalars if fnmatch.filter(scalars, text) else self._source.recorded)
        ]
        plots += self._of_signals(list(dict.fromkeys(signals)), own)
        return plots or self._of_signals(scalars[:4], own)  # a scenario without plots

    def _of_signals(self, texts: list[str], titles: dict[str, Plot]) -> list[Plot]:
        """Return plots of signals, one for each unit."""
        groups: dict[str, list[PlotCurve]] = {}
        for text in texts:
            unit, parsed = self._with_unit(text, [*titles, *self._source.recorded])
            groups.setdefault(unit, []).append(PlotCurve(parsed, parsed.text))
        return [
            Plot(
                curves[0].label if len(curves) == 1 and curves[0].signal.single is None else "",
                tuple(curves),
                label=curves[0].label if len(curves) == 1 else "",
                unit=unit,
                per_variant=len(curves) > 1,
            )
            for unit, curves in groups.items()
        ]

    def _with_unit(self, text: str, candidates: Sequence[str]) -> tuple[str, Expression]:
        """Return the unit of an expression and itself: that of `sensor.force [mN]`, else its display unit."""
        base, symbol = split_unit(text)
        parsed = self._parsed(base, candidates)
        if symbol and not self._measure(parsed).converts_to(symbol, is_scaled=False):
            raise TwinError(f"{base} {self._measure(parsed).text}, which does not convert to {symbol}.")
        return symbol or self._unit(parsed), parsed

    def _in_unit(self, plot: Plot) -> Plot:
        """Return a plot in the unit of its first signal if it has none and all signals have one dimension."""
        units = {self._unit(curve.signal) for curve in plot.curves}
        across = {self._unit(curve.x) for curve in plot.curves if curve.x is not None}
        return replace(
            plot,
            unit=plot.unit or (units.pop() if len(units) == 1 else ""),
            x_unit=plot.x_unit or (across.pop() if len(across) == 1 else ""),
        )

    def _unit(self, parsed: Expression) -> str:
        """Return the display unit of an expression; ScenarioError if dimensions do not match."""
        variables = {name: self._source.declared[name] for name in names_of(parsed) if name in self._source.declared}
        return dimension.preferred_unit(
            self._measure(parsed),
            {name: variable.unit for name, variable in variables.items()},
            {name: variable.display_unit for name, variable in variables.items()},
        )

    def _measure(self, parsed: Expression) -> dimension.Measure:
        """Return the dimension of an expression; ScenarioError if those of its signals do not match."""
        units: dict[str, str | None] = {
            name: self._source.declared[name].unit for name in names_of(parsed) if name in self._source.declared
        }
        return dimension.expression_measure(parsed, units)
