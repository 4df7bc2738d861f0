"""Plots of a report as SVG. Matplotlib is imported on first use, only here and in `twin.scene.picture`.

Over 400 lines: one figure, from its panels to its labels.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.errors import ScenarioError
from twin.results import figure_files, plot_annotations
from twin.results.evaluation import dimension, expression
from twin.results.evaluation.coverage import join_numbers
from twin.results.evaluation.metrics import Plot, PlotCurve
from twin.results.recording.signals import si_conversion
from twin.results.resampling import resample

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.evaluation.violations import Violation
    from twin.results.recording.signals import Signals

    Tables = Mapping[tuple[str, int], Signals]

COLORS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#b8579a",
    "#a08500",
    "#4b9fd1",
    "#7a5cc0",
    "#6b7075",
)  # `--line-0` to `--line-7` of twin.web
LINE_STYLES = ("-", "--", "-.", ":")
MARKERS = ("o", "x", "^", "s", "+", "d")
OTHER_RUN = " (other run)"  # after the names of a second run's variants, which are dashed
MAX_POINTS = 1400  # about twice the pixels across a panel: more are invisible
STYLE, WIDTH = figure_files.STYLE, figure_files.WIDTH
LEGEND_LETTERS = 130  # letters in a row of the legend
LETTER_WIDTH = 0.075  # of a label of an axis [inch]
DEFAULT_PLOTS = 8  # at most, of a scenario without `plots`


def envelope(x: Any, y: Any, points: int = MAX_POINTS) -> tuple[Any, Any]:
    """Reduce a line to at most `points` samples that keep the extremes of every part, so that no peak is lost."""
    if len(x) <= points:
        return x, y
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int)[:-1]
    low = np.fmin.reduceat(y, edges)
    high = np.fmax.reduceat(y, edges)
    # the order within a part, so that a rising edge does not look like a falling one
    first = y[edges]
    rising = first - low <= high - first
    pairs = np.where(rising[:, None], np.stack([low, high], 1), np.stack([high, low], 1))
    ends = np.append(edges[1:], len(x)) - 1
    return np.stack([x[edges], (x[edges] + x[ends]) / 2], 1).ravel(), pairs.ravel()


def thin_loop(x: Any, y: Any, points: int = MAX_POINTS) -> tuple[Any, Any]:
    """Reduce a loop to evenly spaced samples: three times as many, since it turns more often than a line over time."""
    stride = -(-len(x) // (3 * points)) or 1
    return x[::stride], y[::stride]


def finite_points(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the samples with finite coordinates."""
    there = np.isfinite(x) & np.isfinite(y)
    return x[there], y[there]


def to_unit(values: Any, unit: str, is_difference: bool = False) -> Any:
    """Convert SI values to a display unit."""
    factor, offset = si_conversion(unit, is_difference)
    return (values - offset) / factor


def curve_kind(curve: PlotCurve, tables: Tables) -> str:
    """Return the kind of a curve over time: `b` for Booleans, `i` for integers, else empty."""
    signal = curve.signal.single
    if signal is None or curve.x is not None:
        return ""
    kinds = {signals.values[signal.name].dtype.kind for signals in tables.values() if signal.name in signals.values}
    return "b" if kinds == {"b"} else "i" if kinds and kinds <= set("biu") else ""


def set_integer_ticks(axis: Any, kinds: set[str]) -> None:
    """Set ticks at integers if all curves are integers, and at both values of Booleans, even if constant."""
    from matplotlib.ticker import MaxNLocator

    if kinds == {"b"}:
        axis.set_ylim(-0.1, 1.1)
        axis.set_yticks([0, 1])
    elif kinds and "" not in kinds:
        low, high = axis.get_ylim()
        axis.set_ylim(min(low, np.ceil(low) - 0.5), max(high, np.floor(high) + 0.5))
        axis.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def axis_label(label: str, unit: str) -> str:
    """Format the label of an axis: `force [N]`."""
    unit = units.label(unit)
    return f"{label} [{unit}]" if label and unit else label or unit


def default_plots(tables: Tables) -> list[Plot]:
    """Return plots for a scenario without `plots`: signals of each member grouped by unit, in the first one's display unit."""
    groups: dict[tuple[str, str], list[PlotCurve]] = {}
    displayed = {name: unit for signals in tables.values() for name, unit in signals.display_units.items()}
    for signals in tables.values():
        for name, values in signals.values.items():
            if values.ndim > 1:
                continue
            try:
                curve = PlotCurve(expression.parse(name), name.partition(".")[2])
            except ScenarioError:  # an FMU's name that is no expression, such as der(x)
                continue
            group = groups.setdefault((name.partition(".")[0], signals.units.get(name, "")), [])
            if curve not in group and len(group) < 4:
                group.append(curve)
    several = len({variant for variant, _ in tables}) > 1
    return [
        Plot(
            member,
            tuple(curves),
            label=curves[0].label if len(curves) == 1 else "",
            unit=displayed.get(curves[0].signal.text, unit),
            per_variant=several,
        )
        for (member, unit), curves in list(groups.items())[:DEFAULT_PLOTS]
    ]


def plot_svg(
    plot: Plot,
    tables: Tables,
    events: Sequence[plot_annotations.EventLine] = (),
    salt: str = "",
    violations: Sequence[Violation] = (),
) -> str:
    """Draw one plot as an SVG element; empty if none of its signals was recorded. `violations`: marked in it."""
    import matplotlib as mpl

    with mpl.rc_context({**STYLE, "svg.hashsalt": f"{plot.title}{salt}"}):
        figure = plot_figure([plot], tables, events, violations=violations)
        return figure_files.figure_to_svg(figure) if figure else ""


def plot_figure(
    plots: Sequence[Plot],
    tables: Tables,
    events: Sequence[plot_annotations.EventLine] = (),
    run_variants: Sequence[str] = (),
    violations: Sequence[Violation] = (),
) -> Any:
    """Draw plots below each other as one figure of matplotlib; None if none of their signals was recorded.

    `run_variants`: all of the run, for a figure without a page around it: titles, and colors and seeds as in the viewer.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    visible_plots = [(plot, panels) for plot in plots if (panels := plot_panels(plot, tables))]
    if not visible_plots:
        return None
    heights = [panel_rows(plot, panels) * row_height(plot, panels) + 0.75 for plot, panels in visible_plots]
    with mpl.rc_context(STYLE):
        figure: Any = Figure((WIDTH, sum(heights)), layout="constrained")
        parts: Any = (
            [figure] if len(visible_plots) == 1 else figure.subfigures(len(visible_plots), 1, height_ratios=heights)
        )
        for part, (plot, panels) in zip(parts, visible_plots, strict=True):
            draw_plot(part, plot, panels, tables, events, violations, run_variants)
            if run_variants:
                title = figure_title(plot, panels, tables)
                part.suptitle(title, x=0.01, horizontalalignment="left", fontsize=11, fontweight="bold")
        if len(visible_plots) > 1 and not any(panel_columns(plot, panels) > 1 for plot, panels in visible_plots):
            align_panels(figure, parts, [plot for plot, _ in visible_plots])
    figure._repr_svg_ = partial(notebook_svg, figure)
    return figure


def figure_title(plot: Plot, panels: list[list[str]], tables: Tables) -> str:
    """Return title, variant if it is one, and seeds of a plot: `Force: PI, mean and range of seeds 1-3`."""
    seeds = list(dict.fromkeys(seed for _, seed in selected_tables(plot, tables)))
    text = f"seed{'s' * (len(seeds) > 1)} {join_numbers(seeds)}"
    if len(seeds) > 1:
        text = f"mean and range of {text}" if is_averaged(plot) else f"{text} (seed {seeds[0]} bold)"
    cases = ", ".join([*(panels[0] if panels == [panels[0][:1]] else ()), text])
    return f"{plot.title}: {cases}" if plot.title else cases


def align_panels(figure: Any, parts: Sequence[Any], plots: Sequence[Plot]) -> None:
    """Let all panels of a figure begin and end below each other; over the same time, they share the axis and its label.

    Panels of one plot already share the axis of its first panel, and an axis can be shared only once.
    """
    figure.draw_without_rendering()  # the layout, which aligns panels of one plot only
    axes = [axis for axis in figure.axes if axis.get_visible()]
    boxes = [axis.get_position() for axis in axes]
    figure.set_layout_engine("none")
    left, right = max(box.x0 for box in boxes), min(box.x1 for box in boxes)
    for axis, box in zip(axes, boxes, strict=True):
        axis.set_position((left, box.y0, right - left, box.height))
    if any(map(is_loop_plot, plots)) or len({(plot.x_unit, plot.window) for plot in plots}) > 1:
        return
    limits = [axis.get_xlim() for axis in axes]
    first, *others = (part.axes[0] for part in parts)
    for axis in others:
        axis.sharex(first)
    first.set_xlim(min(low for low, _ in limits), max(high for _, high in limits))
    for axis in axes[:-1]:
        axis.tick_params(labelbottom=False)
        axis.set_xlabel("")


def notebook_svg(figure: Any) -> str:
    """Return the SVG of a figure for notebooks, which otherwise show figures only after an import of pyplot."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        return figure_files.figure_to_svg(figure)


def plot_panels(plot: Plot, tables: Tables) -> list[list[str]]:
    """Return the variants in each panel of a plot; empty if none of its signals was recorded."""
    selected = selected_tables(plot, tables)
    variants = [name for name in dict.fromkeys(variant for variant, _ in selected) if has_curves(plot, selected, name)]
    if not plot.per_variant:
        return [variants] if variants else []
    panels: dict[str, list[str]] = {}
    for name in variants:
        panels.setdefault(name.removesuffix(OTHER_RUN), []).append(name)
    return list(panels.values())


def selected_tables(plot: Plot, tables: Tables) -> Tables:
    """Return the cases of a plot's variants."""
    own = plot.variants
    return {case: item for case, item in tables.items() if not own or case[0].removesuffix(OTHER_RUN) in own}


def is_averaged(plot: Plot) -> bool:
    """Whether seeds have a mean: those of curves over time."""
    return not plot.points and not is_loop_plot(plot)


def is_loop_plot(plot: Plot) -> bool:
    """Whether a plot shows signals over others instead of over time."""
    return any(curve.x is not None for curve in plot.curves)


def panel_columns(plot: Plot, panels: list[list[str]]) -> int:
    """Number of panels side by side."""
    return min(len(panels), 3) if is_loop_plot(plot) else 1 if len(panels) <= 6 else 2


def panel_rows(plot: Plot, panels: list[list[str]]) -> int:
    """Number of panels below each other."""
    return -(-len(panels) // panel_columns(plot, panels))


def row_height(plot: Plot, panels: list[list[str]]) -> float:
    """Height of a panel [inch]."""
    return 3.2 if is_loop_plot(plot) else 2.9 if len(panels) < 2 else 1.65 if len(panels) < 4 else 0.92


def draw_plot(
    part: Any,
    plot: Plot,
    panels: list[list[str]],
    tables: Tables,
    events: Sequence[plot_annotations.EventLine],
    violations: Sequence[Violation],
    run_variants: Sequence[str],
) -> None:
    """Draw a plot into a figure or subfigure."""
    selected = selected_tables(plot, tables)
    grid = part.subplots(panel_rows(plot, panels), panel_columns(plot, panels), sharex=True, sharey=True, squeeze=False)
    axes = list(grid.ravel())
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, names in zip(axes, panels, strict=False):
        own = {case: signals for case, signals in selected.items() if case[0] in names}
        draw_panel(axis, plot, own, names, violations, run_variants)
        if len(panels) > 1:
            axis.set_title(names[0])
        if not is_loop_plot(plot):
            draw_band_and_lines(axis, plot)
    kinds = {curve_kind(curve, selected) for curve in plot.curves}
    if not plot.band and not plot.lines and not plot.unit:
        set_integer_ticks(axes[0], kinds)
    add_labels(part, grid, plot, kinds, "lower" if run_variants else "upper")
    if not is_loop_plot(plot):
        letters = 72.0 * 0.75 * row_height(plot, panels)  # room for names of events [pt]
        scale = to_unit(1.0, plot.x_unit, is_difference=True)
        for axis, names in zip(axes, panels, strict=False):
            draw_violated_limits(axis, plot, names, violations, scale)
            own = {case: signals for case, signals in selected.items() if case[0] in names}
            plot_annotations.draw_events(
                axis, [event for event in events if plot_annotations.reaches(event, own)], names, scale, letters
            )


def histogram(values: Any, label: str) -> str:
    """Draw the frequencies of values as an SVG element; the logarithmic scale shows rare ones too."""

    def draw(grid: Any) -> None:
        axis = grid[0, 0]
        axis.hist(values, bins=100, color=COLORS[0], log=True)
        axis.set_xlabel(label)
        axis.set_ylabel("count")

    return figure_files.render_svg((WIDTH, 2.9), label, draw, {"text.parse_math": True})


def bar_chart(values: Mapping[str, float], label: str) -> str:
    """Draw named values as an SVG element, in their order."""

    def draw(grid: Any) -> None:
        axis = grid[0, 0]
        axis.barh(list(values), list(values.values()), color=COLORS[0], height=0.7)
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.set_xlabel(label)

    return figure_files.render_svg((WIDTH, 0.6 + 0.26 * len(values)), label, draw)


def has_curves(plot: Plot, tables: Tables, variant: str) -> bool:
    """Whether a variant recorded a curve of the plot."""
    recordings = [signals for (name, _), signals in tables.items() if name == variant]
    return any(curve_points(curve, plot, signals) is not None for curve in plot.curves for signals in recordings[:1])


def curve_points(curve: PlotCurve, plot: Plot, signals: Signals) -> tuple[Any, Any] | None:
    """Return the points of a curve in SI, or None if its signals were not recorded; reduced for a large recording."""
    parts = [points for part in signals.parts() if (points := evaluate_curve(curve, plot, part)) is not None]
    if len(parts) > 1:
        parts = [(envelope if curve.x is None else thin_loop)(*part) for part in parts]
        return np.concatenate([x for x, _ in parts]), np.concatenate([y for _, y in parts])
    return parts[0] if parts else None


def evaluate_curve(curve: PlotCurve, plot: Plot, signals: Signals) -> tuple[Any, Any] | None:
    """Return the points of a curve in SI, or None if its signals were not recorded or it is empty."""
    points = signals.evaluate(curve.signal, plot.window)
    if points is None or not len(points[0]):
        return None
    if curve.x is None:
        return points[0], np.where(np.isfinite(points[1]), points[1], np.nan)
    abscissa = signals.evaluate(curve.x, plot.window)
    return None if abscissa is None else (abscissa[1], points[1])


def to_axis_units(points: tuple[Any, Any], curve: PlotCurve, plot: Plot, max_points: int) -> tuple[Any, Any]:
    """Convert points of a curve to the units of the axes and reduce their number."""
    x = to_unit(points[0], plot.x_unit, curve.x is None or dimension.is_difference(curve.x))
    y = to_unit(points[1], plot.unit, dimension.is_difference(curve.signal))
    return finite_points(x, y) if plot.points else (envelope if curve.x is None else thin_loop)(x, y, max_points)


def mean_and_range(curve: PlotCurve, plot: Plot, tables: Tables, variant: str) -> tuple[Any, ...] | None:
    """Return times of a variant's first seed, and mean, lowest and highest value of several, without those that ended earlier."""
    recorded = [
        points
        for case, signals in tables.items()
        if case[0] == variant and (points := curve_points(curve, plot, signals)) is not None
    ]
    if len(recorded) < 2:
        return recorded[0] if recorded else None
    time, is_real = recorded[0][0], not curve_kind(curve, tables)
    values = np.stack([np.where(time <= x[-1], resample(time, x, y, is_real), np.nan) for x, y in recorded])
    with np.errstate(invalid="ignore"):
        mean = np.nansum(values, axis=0) / np.isfinite(values).sum(axis=0)
    return time, mean, np.fmin.reduce(values), np.fmax.reduce(values)


def curve_style(
    plot: Plot, names: Sequence[str], variant: str, number: int, run_variants: Sequence[str] = ()
) -> tuple[str, int, int]:
    """Return label, index of the color and index of the line style of a plot's curve in a panel of some variants.

    `run_variants`: all of the run, each of which keeps its color where one signal is plotted.
    """
    label, own = plot.curves[number].label, variant.removesuffix(OTHER_RUN)
    if run_variants and len(plot.curves) == 1:
        return variant, run_variants.index(own) % len(COLORS), int(own != variant)
    if {name.removesuffix(OTHER_RUN) for name in names} == {own}:
        return label + variant.removeprefix(own), number % len(COLORS), int(own != variant)
    variant_index = names.index(variant)
    if len(plot.curves) == 1:
        return variant, variant_index % len(COLORS), 0
    return f"{variant}: {label}", number % len(COLORS), variant_index % len(LINE_STYLES)


def draw_panel(
    axis: Any,
    plot: Plot,
    tables: Tables,
    names: Sequence[str],
    violations: Sequence[Violation] = (),
    run_variants: Sequence[str] = (),
) -> None:
    """Draw one panel: the first seed bold, the others faint (with `run_variants` mean and range), violations on top."""
    is_mean = bool(run_variants) and is_averaged(plot)
    plotted_variants: set[str] = set()
    for (variant, seed), signals in tables.items():
        is_first = variant not in plotted_variants
        plotted_variants.add(variant)
        for number, curve in enumerate(plot.curves if is_first or not is_mean else ()):
            curve_rows = mean_and_range(curve, plot, tables, variant) if is_mean else curve_points(curve, plot, signals)
            if curve_rows is None:
                continue
            points = curve_rows[:2]
            x, y = to_axis_units(points, curve, plot, MAX_POINTS if is_first else MAX_POINTS // 3)
            label, color_index, style_index = curve_style(plot, names, variant, number, run_variants)
            step = "post" if curve_kind(curve, tables) else None
            if edges := [to_axis_units((curve_rows[0], edge), curve, plot, MAX_POINTS)[1] for edge in curve_rows[2:]]:
                axis.fill_between(x, *edges, step=step, color=COLORS[color_index], alpha=0.2, linewidth=0)
            style = MARKERS[number % len(MARKERS)] if plot.points else LINE_STYLES[style_index]
            axis.plot(
                x,
                y,
                style,
                drawstyle="steps-post" if step else "default",
                color=COLORS[color_index],
                label=label if is_first else None,
                alpha=1.0 if is_first else 0.22,
                linewidth=1.2 if is_first else 0.7,
                markersize=4,
                markerfacecolor="none",
                zorder=3 if is_first else 2,
            )
            for values in (
                plot_annotations.violating_values(violations, curve.signal, (variant, seed), points)
                if curve.x is None
                else ()
            ):
                plot_annotations.draw_violation(axis, *to_axis_units((points[0], values), curve, plot, MAX_POINTS))


def draw_band_and_lines(axis: Any, plot: Plot) -> None:
    """Draw the band and the reference lines."""
    if plot.band:
        low, high = (to_unit(edge, plot.unit, plot.is_difference) for edge in plot.band)
        axis.axhspan(low, high, color="#2a9d6f", alpha=0.10, linewidth=0, zorder=0)
    for value in plot.lines:
        height = to_unit(value, plot.unit, plot.is_difference)
        axis.axhline(height, color="#3e4c59", linewidth=0.9, linestyle=(0, (5, 4)), zorder=1)


def draw_violated_limits(
    axis: Any, plot: Plot, names: Sequence[str], violations: Iterable[Violation], scale: float
) -> None:
    """Draw the limits of violated expectations."""
    for violation in violations:
        if set(violation.variants) & set(names) and any(violation.concerns(curve.signal) for curve in plot.curves):
            heights = [to_unit(value, plot.unit, plot.is_difference) for value in violation.limits]
            plot_annotations.draw_limits(axis, violation, scale, heights)


def add_labels(figure: Any, grid: Any, plot: Plot, kinds: set[str], side: str) -> None:
    """Add axis labels and the legend, on a `side` without a title."""
    is_loop = is_loop_plot(plot)
    x_label = axis_label(plot.x_label or (plot.curves[0].x.text if plot.curves[0].x else "time"), plot.x_unit or "s")
    if is_loop and not plot.x_unit:
        x_label = plot.x_label or x_label.removesuffix(" [s]")
    for axis in grid[-1]:
        axis.set_xlabel(x_label)
    several = "0: false, 1: true" if kinds == {"b"} else plot_annotations.quantity_name(plot.unit)
    own = plot.label or (plot.curves[0].label if len(plot.curves) == 1 else several)
    fits = LETTER_WIDTH * len(own) < 0.9 * sum(axis.get_window_extent().height for axis in grid[:, 0]) / figure.dpi
    label = axis_label(own if fits or not several else several, plot.unit)
    if len(grid) > 1:
        figure.supylabel(label, fontsize=9.5, color="#3e4c59")
    else:
        for row in grid:
            row[0].set_ylabel(label)
    axis = grid[0][0]
    if not is_loop:
        axis.margins(x=0)
    handles, labels = axis.get_legend_handles_labels()
    if len(labels) > 1:
        fitting = max(LEGEND_LETTERS // (max(map(len, labels)) + 6), 1)
        figure.legend(handles, labels, loc=f"outside {side} right", ncols=min(len(labels), 4, fitting))
