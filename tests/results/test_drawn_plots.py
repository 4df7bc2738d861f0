"""What stands in a drawn plot: panels, curves with their data and styles, limits, violations, events, labels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from twin.results import (
    EventLine,
    Expectation,
    Metric,
    Plot,
    PlotCurve,
    Signals,
    Window,
    evaluate,
    find_violations,
    plot_annotations,
)
from twin.results.evaluation import expression
from twin.results.plotting import COLORS, LINE_STYLES, default_plots, draw_panel, plot_figure

S = 10**9
TIME = np.arange(5.0)
X, Y, ON = map(expression.parse, ("a.x", "a.y", "a.on"))
UNITS = {"a.x": "N", "a.y": "N"}


def signals(size: float = 1.0) -> Signals:
    return Signals(TIME, {"a.x": size * TIME, "a.y": -size * TIME, "a.on": TIME > 2}, UNITS)


TABLES = {("PI", 1): signals(1.0), ("PI", 2): signals(2.0), ("FF", 1): signals(3.0)}


def drawn(plot: Plot, tables: Any = TABLES, **options: Any) -> list[Any]:
    """Visible axes of a plot."""
    figure = plot_figure([plot], tables, **options)
    return [axis for axis in figure.axes if axis.get_visible()]


def look(line: Any) -> tuple[Any, ...]:
    """Last value, color, style, width, opacity and label of a line."""
    label = line.get_label()
    return (
        line.get_ydata()[-1],
        line.get_color(),
        line.get_linestyle(),
        line.get_linewidth(),
        line.get_alpha(),
        "" if label.startswith("_") else label,
    )


@pytest.mark.slow
def test_the_first_seed_is_bold_and_the_others_faint() -> None:
    """Of several variants in one panel each has a color; of several curves each has one, and variants have line styles."""
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"),), unit="mN"))
    assert [look(line) for line in axis.lines] == [
        (4000.0, COLORS[0], "-", 1.2, 1.0, "PI"),
        (8000.0, COLORS[0], "-", 0.7, 0.22, ""),
        (12000.0, COLORS[1], "-", 1.2, 1.0, "FF"),
    ]
    assert [line.get_zorder() for line in axis.lines] == [3, 2, 3]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("time [s]", "x [mN]")
    assert axis.get_xlim() == (0.0, 4.0)
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"), PlotCurve(Y, "y")), unit="N", variants=("PI", "FF")))
    assert [look(line)[1:3] + look(line)[5:] for line in axis.lines] == [
        (COLORS[0], "-", "PI: x"),
        (COLORS[1], "-", "PI: y"),
        (COLORS[0], "-", ""),
        (COLORS[1], "-", ""),
        (COLORS[0], "--", "FF: x"),
        (COLORS[1], "--", "FF: y"),
    ]
    assert axis.get_ylabel() == "force [N]"
    assert LINE_STYLES[:2] == ("-", "--")


def test_a_panel_for_each_variant() -> None:
    axes = drawn(Plot("P", (PlotCurve(X, "x"), PlotCurve(Y, "y")), unit="N", per_variant=True, x_unit="ms"))
    assert [axis.get_title(loc="left") for axis in axes] == ["PI", "FF"]
    assert [[look(line)[5] for line in axis.lines] for axis in axes] == [["x", "y", "", ""], ["x", "y"]]
    assert axes[1].lines[0].get_xdata()[-1] == 4000.0
    assert (axes[0].get_xlabel(), axes[1].get_xlabel()) == ("", "time [ms]")
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"),), variants=("FF",), per_variant=True))
    assert axis.get_title(loc="left") == ""
    assert plot_figure([Plot("P", (PlotCurve(expression.parse("a.z"), "z"),))], TABLES) is None


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("count", "over", "shape", "height"),
    [
        (1, None, (1, 1), 2.9),
        (2, None, (2, 1), 1.65),
        (5, None, (5, 1), 0.92),  # two such plots on a page
        (7, None, (4, 2), 0.92),  # up to six below each other
        (4, Y, (2, 3), 3.2),
    ],
)
def test_panels_are_arranged_by_their_number(count: int, over: Any, shape: tuple[int, int], height: float) -> None:
    tables = {(f"v{number}", 1): signals() for number in range(count)}
    plot = Plot("P", (PlotCurve(X, "x", over),), per_variant=True)
    figure = plot_figure([plot], tables)
    grid = figure.axes[0].get_gridspec()
    assert (grid.nrows, grid.ncols) == shape
    assert figure.get_figheight() == pytest.approx(shape[0] * height + 0.75)
    assert sum(axis.get_visible() for axis in figure.axes) == count
    labels = [axis.get_ylabel() for axis in figure.axes if axis.get_ylabel()]
    assert len(labels) == (shape[0] == 1)  # one for all rows
    assert (figure._supylabel is not None) is (shape[0] > 1)


def test_a_label_that_is_longer_than_its_axis_is_the_quantity() -> None:
    name = "a.x - " + " - ".join(["a.y"] * 20)
    tables = {("PI", 1): signals()}
    for text, label in ((name, "length [mm]"), ("a.x - a.y", "a.x - a.y [mm]")):
        (axis,) = plot_figure([Plot("P", (PlotCurve(expression.parse(text), text),), unit="mm")], tables).axes
        assert axis.get_ylabel() == label


def test_several_plots_stand_below_each_other_with_their_titles() -> None:
    plots = [Plot(title, (PlotCurve(X, "x"),), per_variant=title == "two") for title in ("one", "two")]
    plots.append(Plot("none", (PlotCurve(expression.parse("a.z"), "z"),)))
    figure = plot_figure(plots, TABLES, run_variants=("PI", "FF"))
    assert figure.get_figheight() == pytest.approx(2.9 + 0.75 + 2 * 1.65 + 0.75)
    assert [part._suptitle.get_text() for part in figure.subfigs] == [
        f"{title}: mean and range of seeds 1-2" for title in ("one", "two")
    ]
    assert plot_figure(plots, TABLES).subfigs[0]._suptitle is None


@every_case(
    ("plot", "x_label", "y_label"),
    [
        (Plot("P", (PlotCurve(X, "x", Y),), unit="N"), "a.y", "x [N]"),
        (Plot("P", (PlotCurve(X, "x", Y),), x_unit="mN", x_label="input", label="output"), "input [mN]", "output"),
        (Plot("P", (PlotCurve(X, "x", Y),), x_label="input"), "input", "x"),
        (Plot("P", (PlotCurve(X, "x"), PlotCurve(Y, "y"))), "time [s]", "value"),
        (Plot("P", (PlotCurve(ON, "on"), PlotCurve(ON, "again"))), "time [s]", "0: false, 1: true"),
    ],
)
def test_labels_of_axes(plot: Plot, x_label: str, y_label: str) -> None:
    (axis,) = drawn(plot)
    assert (axis.get_xlabel(), axis.get_ylabel()) == (x_label, y_label)


@pytest.mark.parametrize(("count", "columns"), [(1, None), (2, 2), (5, 4)])
def test_a_legend_where_there_are_several_curves(count: int, columns: int | None) -> None:
    curves = tuple(PlotCurve(X, f"curve {number}") for number in range(count))
    figure = plot_figure([Plot("P", curves)], {("PI", 1): signals()})
    assert [legend._ncols for legend in figure.legends] == ([columns] if columns else [])


def test_a_row_of_the_legend_fits_into_the_figure() -> None:
    long = tuple(PlotCurve(X, f"{number} " + 57 * "x") for number in range(3))
    figure = plot_figure([Plot("P", long)], {("PI", 1): signals()})
    assert figure.legends[0]._ncols == 2  # 130 letters in a row: two of 59 and 6


def test_a_band_reference_lines_and_points() -> None:
    """A band and lines in the unit of the axis; points where there are numbers."""
    plot = Plot("P", (PlotCurve(X, "x"),), unit="mN", band=(1.0, 2.0), lines=(0.5, 3.0))
    (axis,) = drawn(plot, {("PI", 1): signals()})
    (band,) = axis.patches
    assert (band.get_y(), band.get_y() + band.get_height()) == (1000.0, 2000.0)
    assert [line.get_ydata()[0] for line in axis.lines[1:]] == [500.0, 3000.0]
    gaps = {("PI", 1): Signals(TIME, {"a.x": np.array([0.0, np.nan, 2.0, np.inf, 4.0])}, UNITS)}
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"),), points=True), gaps)
    (line,) = axis.lines
    assert line.get_xdata().tolist() == [0.0, 2.0, 4.0]
    assert (line.get_marker(), line.get_linestyle(), line.get_drawstyle()) == ("o", "None", "default")
    (axis,) = drawn(Plot("P", (PlotCurve(ON, "on"),)), gaps | TABLES)
    assert axis.lines[0].get_drawstyle() == "steps-post"
    assert (axis.get_ylim(), axis.get_yticks().tolist()) == ((-0.1, 1.1), [0, 1])


def test_integers_have_room_for_their_ticks() -> None:
    """Half a number at least beside the smallest and the largest; ticks at whole numbers alone."""
    counts = {("A", 1): Signals(TIME, {"a.n": np.full(5, 3)}, {})}
    (axis,) = drawn(Plot("P", (PlotCurve(expression.parse("a.n"), "n"),)), counts)
    low, high = axis.get_ylim()
    assert low <= 2.5
    assert high >= 3.5
    assert [tick for tick in axis.get_yticks() if low <= tick <= high] == [3.0]


def test_violations_are_drawn_on_their_curve_with_limits_and_rings() -> None:
    limits = [Expectation("", signal=X, at_most=2.5, window=Window(1 * S, 4 * S)), Expectation("", "m", at_most=3.5)]
    metrics = {"m": Metric("m", X, "peak_to_peak", Window(None, 3 * S))}
    tables = {("PI", 1): Signals(TIME, {"a.x": np.array([9.0, 3.0, 2.0, 5.0, 4.0])}, UNITS), ("FF", 1): signals(0.5)}
    found = find_violations(limits, evaluate(metrics, limits, tables), tables)
    assert [violation.cases for violation in found] == [{("PI", 1): 1.0}, {("PI", 1): None}]
    axes = drawn(Plot("P", (PlotCurve(X, "x"),), unit="mN", per_variant=True), tables, violations=found)
    curve, red, rings, limit = axes[0].lines
    assert curve.get_ydata().tolist() == [9000.0, 3000.0, 2000.0, 5000.0, 4000.0]
    assert np.isnan(red.get_ydata()).tolist() == [True, False, True, False, False]
    assert red.get_color() == plot_annotations.VIOLATION_COLOR
    assert (rings.get_xdata().tolist(), rings.get_ydata().tolist()) == ([1.0, 3.0], [3000.0, 5000.0])
    assert rings.get_marker() == "o"
    assert not rings.get_clip_on()  # a ring at the edge is whole
    assert (*limit.get_xdata(), *limit.get_ydata()) == (1.0, 4.0, 2500.0, 2500.0)
    assert not axes[0].patches  # no single sample violates a metric of many
    assert axes[0].get_xlim() == (0.0, 4.0)
    assert (len(axes[1].lines), len(axes[1].patches)) == (1, 0)
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x", X),), variants=("PI",)), tables, violations=found)
    assert len(axis.lines) == 1
    (axis,) = drawn(Plot("P", (PlotCurve(Y, "y"),)), TABLES, violations=found)
    assert [line.get_color() for line in axis.lines] == [COLORS[0], COLORS[0], COLORS[1]]


def test_rings_of_many_violations_end() -> None:
    from matplotlib.figure import Figure

    y = np.where(np.arange(60) % 2, np.nan, 1.0)
    axis: Any = Figure().subplots()
    plot_annotations.draw_violation(axis, np.arange(60.0), y)
    assert axis.lines[1].get_xdata().tolist() == [2.0 * number for number in range(plot_annotations.MAX_RINGS)]


def test_events_that_would_overlap_share_a_text() -> None:
    """Lines within the axis, of its variants, in the unit of the axis; texts nearer than 2.2 % of it are joined."""
    events = [
        EventLine(2.0, "set a.k = 1 N"),
        EventLine(1.0, "first"),
        EventLine(1.05, "second"),
        EventLine(1.05, "second"),
        EventLine(1.2, "third", ("PI",)),
        EventLine(3.0, "other", ("FF",)),
        EventLine(0.0, "at the beginning"),
        EventLine(4.0, "at the end"),
    ]
    tables = {case: table for case, table in TABLES.items() if case[0] == "PI"}
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"),), x_unit="ms"), tables, events=events)
    lines = [line.get_xdata()[0] for line in axis.lines if line.get_color() == plot_annotations.EVENT_COLOR]
    assert lines == [1000.0, 1050.0, 1200.0, 2000.0]
    texts = [(text.get_position()[0], text.get_text()) for text in axis.texts]
    assert texts == [(1000.0, "first\nsecond"), (1200.0, "third"), (2000.0, "a.k = 1 N")]
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x", Y),)), tables, events=events)
    assert list(axis.texts) == []


def test_numbers_of_events_stand_upright_and_share_a_text_as_ranges() -> None:
    events = [EventLine(1.0 + 0.01 * k, str(k)) for k in (1, 2, 3, 5)] + [EventLine(2.0, "6")]
    (axis,) = drawn(Plot("P", (PlotCurve(X, "x"),)), TABLES, events=events)
    assert [(text.get_text(), text.get_rotation()) for text in axis.texts] == [("\xa01-3, 5", 0.0), ("\xa06", 0.0)]


@every_case(
    ("name", "letters", "lines"),
    [
        ("set a.k = 4 N/m", 40, ["a.k = 4 N/m"]),
        ("set a.k = 4 N/m", 10, ["a.k", "= 4 N/m"]),
        ("drive_fault of motor", 7, ["drive_", "fault", "of", "motor"]),
        ("drive_fault of motor", 8, ["drive_", "fault of", "motor"]),
        ("", 5, [""]),
    ],
)
def test_long_names_are_wrapped(name: str, letters: int, lines: list[str]) -> None:
    assert plot_annotations.wrap_name(name, letters) == lines


def test_plots_of_a_scenario_without_plots() -> None:
    """Signals of a member by unit, at most four in a plot, at most eight plots; arrays and odd names are left out."""
    names = [f"a.f{number}" for number in range(5)]
    values = dict.fromkeys([*names, "b.x", "der(b.x)"], TIME) | {"b.array": np.zeros((5, 2)), "b.y": TIME}
    units = dict.fromkeys(names, "N") | {"b.x": "m", "b.y": "m"}
    table = Signals(TIME, values, units, display_units={"b.x": "mm"})
    found = default_plots({("", 1): table, ("", 2): table})
    assert [(plot.title, plot.unit, plot.label, plot.per_variant) for plot in found] == [
        ("a", "N", "", False),
        ("b", "mm", "", False),
    ]
    assert [[curve.label for curve in plot.curves] for plot in found] == [["f0", "f1", "f2", "f3"], ["x", "y"]]
    (single,) = default_plots({("A", 1): signals_of("c.z"), ("B", 1): signals_of("c.z")})
    assert (single.label, single.per_variant) == ("z", True)
    many = default_plots({("", 1): Signals(TIME, {f"m{number}.x": TIME for number in range(9)}, {})})
    assert [plot.title for plot in many] == [f"m{number}" for number in range(8)]


def signals_of(name: str) -> Signals:
    return Signals(TIME, {name: TIME}, {})


def test_a_large_recording_is_thinned_less_for_the_first_seed() -> None:
    from matplotlib.figure import Figure

    time = np.arange(6000.0)
    tables = {("PI", seed): Signals(time, {"a.x": np.sin(time)}, UNITS) for seed in (1, 2)}
    axis: Any = Figure().subplots()
    draw_panel(axis, Plot("P", (PlotCurve(X, "x"),)), tables, ["PI"])
    assert [len(line.get_xdata()) for line in axis.lines] == [1400, 466]
