"""Plots of a report: those of the scenario, and those of violations that none of these shows."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from twin import clock
from twin.results import Plot, PlotCurve, Window, join_numbers, list_names, plot_annotations, plotting
from twin.run import report_curves
from twin.run.cases import noop
from twin.run.report_figure import ReportFigure

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from twin.results import EventLine, Signals, Violation
    from twin.web import PackedArrays

    Tables = Mapping[tuple[str, int], Signals]

HERE = Path(__file__).parent
MAX_PANELS = 6  # variants in a plot of a violation; the matrix shows the others


def draw_plots(
    plots: Iterable[Plot],
    tables: Tables,
    events: Sequence[EventLine],
    violations: Sequence[Violation],
    arrays: PackedArrays,
    folder: str,
    codes: Mapping[str, Mapping[int, str]] = MappingProxyType({}),
    progress: Callable[[float], object] = noop,
) -> list[ReportFigure]:
    """Draw the plots, those of violations that no other shows first; without plots every recorded signal is drawn.

    `codes`: names of the values of signals, by their texts. `progress`: gets the completed fraction of the report.
    """
    scenario_plots = list(plots) or plotting.default_plots(tables)
    all_plots = [*plots_of_unshown_violations(scenario_plots, tables, violations), *scenario_plots]
    points = report_curves.points_per_curve(all_plots, tables)
    figures = []
    for number, plot in enumerate(all_plots):
        progress(0.5 + 0.5 * number / len(all_plots))  # scenes are drawn before, in as much time
        shown = [violation for violation in violations if violation.is_shown_in(plot, tables)]
        numbered = events_in_plot(plot, tables, events)
        numbers = [replace(event, name=str(key)) for key, event in numbered.items()]
        charts = report_curves.plot_charts(plot, tables, violations, arrays, points, codes)
        spacing = max((pane.get("thinned", 0.0) for panes in charts for pane in panes), default=0.0)
        notes = [plot_note(plot, tables, shown), code_note(plot, codes)]
        thinned = (
            f"thinned to {float(f'{1e3 * spacing:.2g}'):g} ms or less, with all extremes; twin view has all samples"
        )
        notes.append(thinned * bool(spacing))
        figures.append(
            ReportFigure(
                plot.title,
                plotting.plot_svg(plot, tables, numbers, str(number), violations),
                "; ".join(filter(None, notes)),
                charts,
                report_curves.event_marks({n: each for n, each in numbered.items() if is_in_window(plot, each.time)}),
                numbered,
                view_command(plot, folder),
                urlencode([("signal", name) for name in viewed_signals(plot)]),
                tuple(violation.name for violation in shown),
            )
        )
    return figures


def view_command(plot: Plot, folder: str) -> str:
    """Return the command that opens the signals of a plot in the viewer."""
    signals = [f'"{name}"' if re.search(r"[^\w.]", name) else name for name in viewed_signals(plot)]
    return " ".join(["twin view", folder, *(f"--signal {name}" for name in signals)])


def viewed_signals(plot: Plot) -> list[str]:
    """Return the signals and expressions of a plot, each once."""
    names = [curve.signal.text for curve in plot.curves] + [curve.x.text for curve in plot.curves if curve.x]
    return list(dict.fromkeys(names))


def plots_of_unshown_violations(plots: Sequence[Plot], tables: Tables, violations: Iterable[Violation]) -> list[Plot]:
    """Return a plot for each violated expression whose violation no other plot shows; one for all its violations."""
    extra_plots: list[Plot] = []
    for violation in violations:
        if any(violation.is_shown_in(plot, tables) for plot in [*plots, *extra_plots]):
            continue
        variants = violation.variants[:MAX_PANELS]
        curve = PlotCurve(violation.signal, violation.signal.text)
        extra_plots.append(
            Plot(
                f"Failed: {violation.name}" + (f", worst {violation.span:g} s" if violation.span else ""),
                (curve,),
                unit=violation.unit,
                per_variant=len(variants) > 1,
                window=violation.window if violation.span else Window(),
                variants=variants,
            )
        )
    return extra_plots


def is_in_window(plot: Plot, time: float) -> bool:
    """Whether a time [s] lies in the window of a plot."""
    start, stop = plot.window.start_ns, plot.window.stop_ns
    return (start is None or clock.seconds(start) < time) and (stop is None or time < clock.seconds(stop))


def events_in_plot(plot: Plot, tables: Tables, events: Iterable[EventLine]) -> dict[int, EventLine]:
    """Return the events that a plot over time shows, by their numbers in the table of all events, counted from 1.

    Also those of some variants before it begins: what failed stays so.
    """
    if plotting.is_loop_plot(plot):
        return {}
    selected, stop = plotting.selected_tables(plot, tables), plot.window.stop_ns
    return {
        number: event
        for number, event in enumerate(events, 1)
        if (is_in_window(plot, event.time) or (event.variants and (stop is None or event.time < clock.seconds(stop))))
        and plot_annotations.reaches(event, selected)
    }


def plot_note(plot: Plot, tables: Tables, shown_violations: Sequence[Violation]) -> str:
    """Describe the annotations of a plot."""
    parts = []
    if plot.band:
        edges = " to ".join(plot.shown(value) for value in plot.band)
        parts.append(f"band: {edges}")
    if plot.lines:
        parts.append("dashed: " + ", ".join(plot.shown(value) for value in plot.lines))
    seeds = list(dict.fromkeys(seed for _, seed in tables))
    if len(seeds) > 1:
        line_seeds = dict(reversed(list(plotting.selected_tables(plot, tables))))
        of_lines = set(line_seeds.values())
        line = f"seed {min(of_lines)}" if len(of_lines) == 1 else "the seed in the title, the worst of a failure"
        light = f"range of seeds {join_numbers(seeds)}"
        if plotting.is_loop_plot(plot) and not plot.points:
            others = [seed for seed in seeds if seed not in of_lines]
            names = f"seed{'s' * (len(others) > 1)} {join_numbers(others)}" if others else "the other seeds"
            light = f"on paper only, {names}"
        parts.append(f"line: {line}; light: {light}")
    if shown_violations:
        parts.append("red: " + "; ".join(violation_note(violation, plot) for violation in shown_violations))
    missing = (
        len(shown_violations[0].variants) - MAX_PANELS
        if shown_violations and plot.title.startswith(f"Failed: {shown_violations[0].name}")
        else 0
    )
    if missing > 0:
        parts.append(f"and {missing} more variants, not drawn")
    return "; ".join(parts)


def code_note(plot: Plot, codes: Mapping[str, Mapping[int, str]]) -> str:
    """Return the names of the values of a plot's signals that are codes: `0 idle, 1 position`."""
    names = [codes[curve.signal.text] for curve in plot.curves if curve.signal.text in codes]
    return "; ".join(", ".join(f"{value} {name}" for value, name in each.items()) for each in names)


def violation_note(violation: Violation, plot: Plot) -> str:
    """Return what is violated and in which variants of the plot: `violates safe: a.force at most 1 N, in PI`."""
    is_own = plot.title == f"Failed: {violation.name}"  # its title and those of its panes say name and variants
    name = "" if is_own or violation.text.startswith(violation.name) else f"{violation.name}: "
    variants = [variant for variant in violation.variants if not plot.variants or variant in plot.variants]
    verb = f"the worst {violation.span:g} s, which violate" if violation.span else "violates"
    return f"{verb} {name}{violation.text}" + f", in {list_names(variants)}" * (not is_own)
