"""Plots of a report as SVG text. Matplotlib is imported when a plot is drawn, here and in `twin.scene.picture` alone."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.errors import ScenarioError
from twin.results import dimension, expression, plot_annotations
from twin.results.figure_files import as_svg
from twin.results.metrics import Curve, Plot
from twin.results.signals import coherent

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.signals import Signals
    from twin.results.violations import Failure

    Tables = Mapping[tuple[str, int], Signals]

COLORS = ("#0b62a4", "#d1495b", "#2a9d6f", "#8e5ea2", "#e08e0b", "#4f6d7a", "#4aa3df", "#a0522d")
STYLES = ("-", "--", "-.", ":")
MARKS = ("o", "x", "^", "s", "+", "d")
POINTS = 1400  # about twice the pixels across a panel: more cannot be seen
WIDTH = 9.4  # [inch]
LEGEND = 130  # letters beside each other in it

STYLE: dict[str, Any] = {
    "font.family": ["sans-serif"], "font.sans-serif": ["Inter", "Helvetica Neue", "Arial", "DejaVu Sans"],
    "font.size": 9.5, "svg.fonttype": "none", "axes.spines.top": False, "axes.spines.right": False,
    "axes.edgecolor": "#9aa5b1", "axes.labelcolor": "#3e4c59", "axes.linewidth": 0.8, "axes.titlesize": 10,
    "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.titlecolor": "#1f2933",
    "xtick.color": "#7b8794", "ytick.color": "#7b8794", "xtick.labelcolor": "#3e4c59", "ytick.labelcolor": "#3e4c59",
    "axes.grid": True, "grid.color": "#e4e7eb", "grid.linewidth": 0.7, "axes.axisbelow": True,
    "legend.frameon": False, "legend.fontsize": 9, "lines.linewidth": 1.2, "path.simplify_threshold": 0.2,
    "text.parse_math": False,  # names and titles come from files: a $ is a $
}  # fmt: skip


def envelope(x: Any, y: Any, points: int = POINTS) -> tuple[Any, Any]:
    """A line of at most `points` samples with the same smallest and largest value in every part: no peak is lost."""
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


def thinned(x: Any, y: Any, points: int = POINTS) -> tuple[Any, Any]:
    """A loop with evenly fewer samples: three times as many, since it turns more often than a line over time."""
    stride = -(-len(x) // (3 * points)) or 1
    return x[::stride], y[::stride]


def spots(x: Any, y: Any) -> tuple[Any, Any]:
    """The samples that are numbers."""
    there = np.isfinite(x) & np.isfinite(y)
    return x[there], y[there]


def in_unit(values: Any, unit: str, is_difference: bool = False) -> Any:
    """SI values in the unit they are shown in."""
    factor, offset = coherent(unit, is_difference)
    return (values - offset) / factor


def kind(curve: Curve, tables: Tables) -> str:
    """What a curve over time shows if not real numbers: `b` for a Boolean, `i` for a whole number."""
    signal = curve.signal.single
    if signal is None or curve.x is not None:
        return ""
    found = {of.values[signal.name].dtype.kind for of in tables.values() if signal.name in of.values}
    return "b" if found == {"b"} else "i" if found and found <= set("biu") else ""


def whole(axis: Any, kinds: set[str]) -> None:
    """Ticks at whole numbers where nothing else is drawn, and both values of Booleans, also of those that stay."""
    from matplotlib.ticker import MaxNLocator

    if kinds == {"b"}:
        axis.set_ylim(-0.1, 1.1)
        axis.set_yticks([0, 1])
    elif kinds and "" not in kinds:
        low, high = axis.get_ylim()
        axis.set_ylim(min(low, np.ceil(low) - 0.5), max(high, np.floor(high) + 0.5))
        axis.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def axis_label(label: str, unit: str) -> str:
    """`force [N]`."""
    unit = units.shown(unit)
    return f"{label} [{unit}]" if label and unit else label or unit


def default_plots(tables: Tables, limit: int = 8) -> list[Plot]:
    """Plots of a scenario that names none: the signals of each member with one unit together, shown as the first is."""
    groups: dict[tuple[str, str], list[Curve]] = {}
    displayed = {name: unit for signals in tables.values() for name, unit in signals.display_units.items()}
    for signals in tables.values():
        for name, values in signals.values.items():
            if values.ndim > 1:
                continue
            try:
                curve = Curve(expression.parse(name), name.partition(".")[2])
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
        for (member, unit), curves in list(groups.items())[:limit]
    ]


def draw(
    plot: Plot,
    tables: Tables,
    events: Sequence[plot_annotations.Event] = (),
    salt: str = "",
    failures: Sequence[Failure] = (),
) -> str:
    """One plot as an SVG element; nothing if none of its signals was recorded. `failures`: what to mark of them."""
    import matplotlib as mpl

    with mpl.rc_context({**STYLE, "svg.hashsalt": f"{plot.title}{salt}"}):
        drawn = figure([plot], tables, events, failures=failures)
        return as_svg(drawn) if drawn else ""


def figure(
    plots: Sequence[Plot],
    tables: Tables,
    events: Sequence[plot_annotations.Event] = (),
    titled: bool = False,
    failures: Sequence[Failure] = (),
) -> Any:
    """Plots below each other as one figure of matplotlib; None if none of their signals was recorded."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    found = [(plot, panels) for plot in plots if (panels := panels_of(plot, tables))]
    if not found:
        return None
    heights = [rows(plot, panels) * row_height(plot, panels) + 0.75 for plot, panels in found]
    with mpl.rc_context(STYLE):
        drawn: Any = Figure((WIDTH, sum(heights)), layout="constrained")
        parts: Any = [drawn] if len(found) == 1 else drawn.subfigures(len(found), 1, height_ratios=heights)
        for part, (plot, panels) in zip(parts, found, strict=True):
            paint(part, plot, panels, tables, events, failures)
            if titled and plot.title:
                part.suptitle(plot.title, x=0.01, horizontalalignment="left", fontsize=11, fontweight="bold")
    drawn._repr_svg_ = partial(displayed, drawn)
    return drawn


def displayed(drawn: Any) -> str:
    """A figure as a notebook shows it, which knows those of matplotlib only where pyplot was imported."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        return as_svg(drawn)


def panels_of(plot: Plot, tables: Tables) -> list[list[str]]:
    """The variants in each panel of a plot; nothing if none of its signals was recorded."""
    chosen = {case: signals for case, signals in tables.items() if not plot.variants or case[0] in plot.variants}
    variants = [name for name in dict.fromkeys(variant for variant, _ in chosen) if drawable(plot, chosen, name)]
    return [[name] for name in variants] if plot.per_variant else [variants] if variants else []


def loops(plot: Plot) -> bool:
    """Whether a plot shows signals over others instead of over time."""
    return any(curve.x is not None for curve in plot.curves)


def columns(plot: Plot, panels: list[list[str]]) -> int:
    """Panels beside each other."""
    return min(len(panels), 3) if loops(plot) else 1 if len(panels) <= 6 else 2


def rows(plot: Plot, panels: list[list[str]]) -> int:
    """Panels below each other."""
    return -(-len(panels) // columns(plot, panels))


def row_height(plot: Plot, panels: list[list[str]]) -> float:
    """Height of a panel [inch]."""
    return 3.2 if loops(plot) else 1.65 if len(panels) > 1 else 2.9


def paint(
    part: Any,
    plot: Plot,
    panels: list[list[str]],
    tables: Tables,
    events: Sequence[plot_annotations.Event],
    failures: Sequence[Failure],
) -> None:
    """Draw a plot into a figure or a part of one."""
    chosen = {case: signals for case, signals in tables.items() if not plot.variants or case[0] in plot.variants}
    grid = part.subplots(rows(plot, panels), columns(plot, panels), sharex=True, sharey=True, squeeze=False)
    axes = list(grid.ravel())
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, names in zip(axes, panels, strict=False):
        panel(axis, plot, {case: signals for case, signals in chosen.items() if case[0] in names}, names, failures)
        if len(panels) > 1:
            axis.set_title(names[0])
        if not loops(plot):
            mark(axis, plot)
    kinds = {kind(curve, chosen) for curve in plot.curves}
    if not plot.band and not plot.lines and not plot.unit:
        whole(axes[0], kinds)
    finish(part, grid, plot, loops(plot), kinds)
    if not loops(plot):
        letters = 72.0 * 0.75 * row_height(plot, panels)  # room for names of events [pt]
        scale = in_unit(1.0, plot.x_unit, is_difference=True)
        for axis, names in zip(axes, panels, strict=False):
            limit(axis, plot, names, failures, scale)
            plot_annotations.events(axis, events, names, scale, letters)


def histogram(values: Any, label: str, salt: str = "") -> str:
    """How often which value occurred, as an SVG element; rare ones are seen too."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, "text.parse_math": True, "svg.hashsalt": f"{label}{salt}"}):
        figure = Figure((WIDTH, 2.9), layout="constrained")
        axis = figure.subplots()
        axis.hist(values, bins=100, color=COLORS[0], log=True)
        axis.set_xlabel(label)
        axis.set_ylabel("count")
        return as_svg(figure)


def bars(values: Mapping[str, float], label: str) -> str:
    """Named values as an SVG element, in their order."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, "svg.hashsalt": label}):
        figure = Figure((WIDTH, 0.6 + 0.26 * len(values)), layout="constrained")
        axis = figure.subplots()
        axis.barh(list(values), list(values.values()), color=COLORS[0], height=0.7)
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.set_xlabel(label)
        return as_svg(figure)


def drawable(plot: Plot, tables: Tables, variant: str) -> bool:
    """Whether a variant recorded something of the plot."""
    own = [signals for (name, _), signals in tables.items() if name == variant]
    return any(line(curve, plot, signals) is not None for curve in plot.curves for signals in own[:1])


def line(curve: Curve, plot: Plot, signals: Signals) -> tuple[Any, Any] | None:
    """Points of a curve in SI, or None if its signals were not recorded; of what is large, those that can be seen."""
    parts = [found for part in signals.parts() if (found := points_of(curve, plot, part)) is not None]
    if len(parts) > 1:
        parts = [(envelope if curve.x is None else thinned)(*part) for part in parts]
        return np.concatenate([x for x, _ in parts]), np.concatenate([y for _, y in parts])
    return parts[0] if parts else None


def points_of(curve: Curve, plot: Plot, signals: Signals) -> tuple[Any, Any] | None:
    """Points of a curve in SI, or None if its signals were not recorded or there are none."""
    found = signals.evaluate(curve.signal, plot.window)
    if found is None or not len(found[0]):
        return None
    if curve.x is None:
        return found[0], np.where(np.isfinite(found[1]), found[1], np.nan)
    across = signals.evaluate(curve.x, plot.window)
    return None if across is None else (across[1], found[1])


def placed(points: tuple[Any, Any], curve: Curve, plot: Plot, most: int) -> tuple[Any, Any]:
    """Points of a curve in the units of the axes, no more than can be seen."""
    x = in_unit(points[0], plot.x_unit, curve.x is None or dimension.is_difference(curve.x))
    y = in_unit(points[1], plot.unit, dimension.is_difference(curve.signal))
    return spots(x, y) if plot.points else (envelope if curve.x is None else thinned)(x, y, most)


def panel(axis: Any, plot: Plot, tables: Tables, names: Sequence[str], failures: Sequence[Failure] = ()) -> None:
    """Draw one panel: the first seed in full, the others faint behind it, what failed upon them."""
    several = len(names) > 1
    single = len(plot.curves) == 1
    seen: set[str] = set()
    for (variant, seed), signals in tables.items():
        is_first = variant not in seen
        seen.add(variant)
        for number, curve in enumerate(plot.curves):
            points = line(curve, plot, signals)
            if points is None:
                continue
            x, y = placed(points, curve, plot, POINTS if is_first else POINTS // 3)
            color = COLORS[(names.index(variant) if several and single else number) % len(COLORS)]
            label = (variant if single else f"{variant}: {curve.label}") if several else curve.label
            style = STYLES[names.index(variant) % len(STYLES)] if several and not single else "-"
            if plot.points:
                style = MARKS[number % len(MARKS)]
            axis.plot(
                x,
                y,
                style,
                drawstyle="steps-post" if kind(curve, tables) else "default",
                color=color,
                label=label if is_first else None,
                alpha=1.0 if is_first else 0.22,
                linewidth=1.2 if is_first else 0.7,
                markersize=4,
                markerfacecolor="none",
                zorder=3 if is_first else 2,
            )
            for values in (
                plot_annotations.bad(failures, curve.signal, (variant, seed), points) if curve.x is None else ()
            ):
                plot_annotations.failed(axis, *placed((points[0], values), curve, plot, POINTS))


def mark(axis: Any, plot: Plot) -> None:
    """Band and lines."""
    if plot.band:
        low, high = (in_unit(edge, plot.unit, plot.is_difference) for edge in plot.band)
        axis.axhspan(low, high, color="#2a9d6f", alpha=0.10, linewidth=0, zorder=0)
    for value in plot.lines:
        height = in_unit(value, plot.unit, plot.is_difference)
        axis.axhline(height, color="#3e4c59", linewidth=0.9, linestyle=(0, (5, 4)), zorder=1)


def limit(axis: Any, plot: Plot, names: Sequence[str], failures: Iterable[Failure], scale: float) -> None:
    """The limits of what failed."""
    for one in failures:
        if set(one.variants) & set(names) and any(one.judges(curve.signal) for curve in plot.curves):
            heights = [in_unit(value, plot.unit, plot.is_difference) for value in one.limits]
            plot_annotations.limits(axis, one, scale, heights)


def finish(figure: Any, grid: Any, plot: Plot, is_loop: bool, kinds: set[str]) -> None:
    """Labels and legend."""
    x_label = axis_label(plot.x_label or (plot.curves[0].x.text if plot.curves[0].x else "time"), plot.x_unit or "s")
    if is_loop and not plot.x_unit:
        x_label = plot.x_label or x_label.removesuffix(" [s]")
    for axis in grid[-1]:
        axis.set_xlabel(x_label)
    several = "0: false, 1: true" if kinds == {"b"} else plot_annotations.quantity(plot.unit)
    label = axis_label(plot.label or (plot.curves[0].label if len(plot.curves) == 1 else several), plot.unit)
    if len(grid) > 2:
        figure.supylabel(label, fontsize=9.5, color="#3e4c59")
    else:
        for row in grid:
            row[0].set_ylabel(label)
    axis = grid[0][0]
    if not is_loop:
        axis.margins(x=0)
    handles, labels = axis.get_legend_handles_labels()
    if len(labels) > 1:
        fitting = max(LEGEND // (max(map(len, labels)) + 6), 1)
        figure.legend(handles, labels, loc="outside upper right", ncols=min(len(labels), 4, fitting))
