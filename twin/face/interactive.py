"""Plots as interactive figures of plotly, for notebooks: zoom, values under the pointer, curves switched in the legend."""

from __future__ import annotations

import importlib.util
from math import inf
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.face import notebook
from twin.installed import import_optional
from twin.results import plot_annotations, plotting

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from twin.results import EventLine, Plot, Signals

    Tables = Mapping[tuple[str, int], Signals]

MAX_POINTS = 10_000  # of a curve: with more, the browser is slow
DASHES = ("solid", "dash", "dashdot", "dot")  # as the line styles of `plotting`
PANEL_HEIGHT, GAP, MARGIN = 200, 40, 140  # [px]


def is_plotly_installed() -> bool:
    """Return whether plotly is installed."""
    return importlib.util.find_spec("plotly") is not None


def interactive_figure(
    plots: Sequence[Plot], tables: Tables, events: Sequence[EventLine] = (), run_variants: Sequence[str] = ()
) -> Any:
    """Return plots below each other as one figure of plotly; None if none of their signals was recorded.

    `run_variants`: all of the run, each of which keeps its color.
    """
    import_optional("plotly", "plotly", "An interactive plot")
    from plotly.subplots import make_subplots

    panels = [(plot, names) for plot in plots for names in plotting.plot_panels(plot, tables)]
    if not panels:
        return None
    titles = [plotting.figure_title(plot, [names], tables) for plot, names in panels]
    is_shared = not any(plotting.is_loop_plot(plot) for plot in plots) and len({plot.x_unit for plot in plots}) == 1
    height = (PANEL_HEIGHT + GAP) * len(panels)
    figure: Any = make_subplots(
        len(panels), 1, shared_xaxes=is_shared, subplot_titles=titles, vertical_spacing=GAP / height
    )
    entries: set[str] = set()  # of the legend
    for row, (plot, names) in enumerate(panels, 1):
        figure.add_traces(list(traces(plot, names, tables, run_variants, entries)), rows=row, cols=1)
        add_marks(figure, plot, names, events, row)
        several = plot_annotations.quantity_name(plot.unit)
        label = plot.label or (plot.curves[0].label if len(plot.curves) == 1 else several)
        figure.update_yaxes(title_text=plotting.axis_label(label, plot.unit), row=row)
        if row == len(panels) or not is_shared:
            across = plot.curves[0].x
            label = plot.x_label or (across.text if across else "time")
            figure.update_xaxes(title_text=plotting.axis_label(label, plot.x_unit or "s" * (not across)), row=row)
    figure.update_layout(
        height=height + MARGIN,
        template="plotly_white",
        hovermode="x unified" if is_shared else "closest",
        legend={"orientation": "h", "yref": "container", "y": 1.0, "yanchor": "top"},
    )
    return figure


def add_still_picture(figure: Any, draw: Callable[[], Any]) -> None:
    """Let a notebook store a picture beside the data of plotly: for pages that it is exported to, which were blank.

    `draw`: of Matplotlib.
    """
    bundle = figure._repr_mimebundle_

    def both(*_: object, **__: object) -> dict[str, Any]:
        return {"text/html": notebook.figure(draw()), **bundle()}

    figure._repr_mimebundle_ = both
    figure._ipython_display_ = None  # which would store the data alone


def traces(
    plot: Plot, names: Sequence[str], tables: Tables, run_variants: Sequence[str], entries: set[str]
) -> Iterator[Any]:
    """Yield the curves of a panel: mean and range of the seeds, of loops the first bold; `entries`: names in the legend."""
    from plotly.graph_objects import Scatter

    plotted_variants: set[str] = set()
    is_mean, selected = plotting.is_averaged(plot), plotting.selected_tables(plot, tables)
    for (variant, seed), signals in selected.items():
        if variant not in names:
            continue
        is_first = variant not in plotted_variants
        plotted_variants.add(variant)
        for number, curve in enumerate(plot.curves if is_first or not is_mean else ()):
            curve_rows = (
                plotting.mean_and_range(curve, plot, selected, variant)
                if is_mean
                else plotting.curve_points(curve, plot, signals)
            )
            if curve_rows is None:
                continue
            x, y = plotting.to_axis_units(curve_rows[:2], curve, plot, MAX_POINTS)
            label, color_index, style_index = plotting.curve_style(plot, names, variant, number, run_variants)
            color = plotting.COLORS[color_index]
            shape = "hv" if plotting.curve_kind(curve, tables) else "linear"
            for edge, fill in zip(curve_rows[2:], (None, "tonexty"), strict=False):
                yield Scatter(
                    x=x,
                    y=plotting.to_axis_units((curve_rows[0], edge), curve, plot, MAX_POINTS)[1],
                    legendgroup=label,
                    showlegend=False,
                    hoverinfo="skip",
                    line={"color": color, "width": 0, "shape": shape},
                    fill=fill,
                    fillcolor=f"rgba{(*(int(color[i : i + 2], 16) for i in (1, 3, 5)), 0.2)}",
                )
            yield Scatter(
                x=x,
                y=y,
                name=label,
                legendgroup=label,
                showlegend=is_first and label not in entries,
                hovertemplate=f"%{{y:.4g}} {plot.unit}<extra>{label}{'' if is_mean else f', seed {seed}'}</extra>",
                mode="markers" if plot.points else "lines",
                line={
                    "color": color,
                    "dash": DASHES[style_index],
                    "width": 1.5 if is_first else 0.7,
                    "shape": shape,
                },
                marker={"color": color},
                opacity=1.0 if is_first else 0.3,
            )
            entries.add(label)


def add_marks(figure: Any, plot: Plot, names: Sequence[str], events: Sequence[EventLine], row: int) -> None:
    """Add the band, the reference lines and the events of a panel."""
    if plotting.is_loop_plot(plot):
        return
    if plot.band:
        low, high = (plotting.to_unit(edge, plot.unit, plot.is_difference) for edge in plot.band)
        figure.add_hrect(low, high, fillcolor="#2a9d6f", opacity=0.1, line_width=0, row=row, col=1)
    for value in plot.lines:
        height = plotting.to_unit(value, plot.unit, plot.is_difference)
        figure.add_hline(height, line={"color": "#3e4c59", "width": 1, "dash": "dash"}, row=row, col=1)
    first, last = plot.window.start_ns, plot.window.stop_ns
    low, high = -inf if first is None else clock.seconds(first), inf if last is None else clock.seconds(last)
    for event in events:
        if low <= event.time <= high and (not event.variants or set(event.variants) & set(names)):
            time = plotting.to_unit(event.time, plot.x_unit, is_difference=True)
            line = {"color": plot_annotations.EVENT_COLOR, "width": 1, "dash": "dot"}
            figure.add_vline(time, line=line, annotation_text=event.name, row=row, col=1)
