"""Plots of a report: those of the scenario, and those of violations that none of these shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.results import Plot, PlotCurve

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results import EventLine, Signals, Violation

    Tables = Mapping[tuple[str, int], Signals]

MAX_PANELS = 6  # variants in a plot of a violation; the matrix shows the others


def draw_plots(
    plots: Iterable[Plot], tables: Tables, events: Sequence[EventLine], violations: Sequence[Violation]
) -> list[dict[str, str]]:
    """Draw title, svg and note of each plot; without plots every recorded signal is drawn."""
    from twin.results import plotting

    scenario_plots = list(plots) or plotting.default_plots(tables)
    figures = []
    for number, plot in enumerate([*scenario_plots, *plots_of_unshown_violations(scenario_plots, tables, violations)]):
        svg = plotting.plot_svg(plot, tables, events, str(number), violations)
        figures.append({"title": plot.title, "svg": svg, "note": plot_note(plot, tables, events, violations)})
    return figures


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
                f"Failed: {violation.name}",
                (curve,),
                unit=violation.unit,
                per_variant=len(variants) > 1,
                variants=variants,
            )
        )
    return extra_plots


def is_in_window(plot: Plot, time: float) -> bool:
    """Whether a time [s] lies in the window of a plot."""
    start, stop = plot.window.start_ns, plot.window.stop_ns
    return (start is None or clock.seconds(start) < time) and (stop is None or time < clock.seconds(stop))


def plot_note(plot: Plot, tables: Tables, events: Iterable[EventLine], violations: Iterable[Violation]) -> str:
    """Describe the annotations of a plot."""
    parts = []
    if plot.band:
        parts.append(f"band: {' to '.join(plot.shown(value) for value in plot.band)}")
    if plot.lines:
        parts.append("dashed: " + ", ".join(plot.shown(value) for value in plot.lines))
    if plot.curves[0].x is None and any(is_in_window(plot, item.time) for item in events):
        parts.append("dotted: events")
    seeds = list(dict.fromkeys(seed for _, seed in tables))
    if len(seeds) > 1:
        parts.append(
            f"bold: seed {seeds[0]}; faint: {'seed' if len(seeds) == 2 else 'seeds'} {', '.join(map(str, seeds[1:]))}"
        )
    shown_violations = [item for item in violations if item.is_shown_in(plot, tables)]
    if shown_violations:
        parts.append("red: not " + "; not ".join(item.text for item in shown_violations))
    missing = (
        len(shown_violations[0].variants) - MAX_PANELS
        if shown_violations and plot.title == f"Failed: {shown_violations[0].name}"
        else 0
    )
    if missing > 0:
        parts.append(f"and {missing} more variants, not drawn")
    return "; ".join(parts)
