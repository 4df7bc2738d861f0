"""The plots of a report: those of the scenario, and of what failed without being in any of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.results import Curve, Plot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results import Event, Failure, Signals

    Tables = Mapping[tuple[str, int], Signals]

PANELS = 6  # variants in a plot of a failure; the matrix tells of the others


def drawn(
    plots: Iterable[Plot], tables: Tables, events: Sequence[Event], failures: Sequence[Failure]
) -> list[dict[str, str]]:
    """Title, svg and note of each plot; without plots every recorded signal is drawn."""
    from twin.results import plotting

    own = list(plots) or plotting.default_plots(tables)
    found = []
    for number, plot in enumerate([*own, *unseen(own, tables, failures)]):
        svg = plotting.draw(plot, tables, events, str(number), failures)
        found.append({"title": plot.title, "svg": svg, "note": note(plot, tables, events, failures)})
    return found


def unseen(plots: Sequence[Plot], tables: Tables, failures: Iterable[Failure]) -> list[Plot]:
    """A plot for each failed expression that no plot shows where it failed; one for all that failed of it."""
    found: list[Plot] = []
    for one in failures:
        if any(one.seen(plot, tables) for plot in [*plots, *found]):
            continue
        variants = one.variants[:PANELS]
        curve = Curve(one.signal, one.signal.text)
        found.append(
            Plot(f"Failed: {one.name}", (curve,), unit=one.unit, per_variant=len(variants) > 1, variants=variants)
        )
    return found


def within(plot: Plot, time: float) -> bool:
    """Whether a time [s] lies in the part of the run that a plot shows."""
    start, stop = plot.window.start_ns, plot.window.stop_ns
    return (start is None or clock.seconds(start) < time) and (stop is None or time < clock.seconds(stop))


def note(plot: Plot, tables: Tables, events: Iterable[Event], failures: Iterable[Failure]) -> str:
    """What the eye cannot know about a plot."""
    parts = []
    if plot.band:
        parts.append(f"band: {' to '.join(plot.shown(value) for value in plot.band)}")
    if plot.lines:
        parts.append("dashed: " + ", ".join(plot.shown(value) for value in plot.lines))
    if plot.curves[0].x is None and any(within(plot, one.time) for one in events):
        parts.append("dotted: events")
    seeds = list(dict.fromkeys(seed for _, seed in tables))
    if len(seeds) > 1:
        parts.append(f"seed {seeds[0]}, the others faint behind it")
    failed = [one for one in failures if one.seen(plot, tables)]
    if failed:
        parts.append("red: not " + "; not ".join(one.told for one in failed))
    missing = len(failed[0].variants) - PANELS if failed and plot.title == f"Failed: {failed[0].name}" else 0
    if missing > 0:
        parts.append(f"and {missing} more variants, not drawn")
    return "; ".join(parts)
