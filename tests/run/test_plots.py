"""Plots: what is drawn is what was recorded, and what failed is marked."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.every_case import every_case
from tests.run.reported import FORCE, LIMIT, PLOTS, SVG, TIME, labels, tables
from twin.results import (
    EventLine,
    Expectation,
    Metric,
    Plot,
    PlotCurve,
    Signals,
    Window,
    evaluate,
    figure_files,
    find_violations,
    plot_annotations,
    plotting,
)
from twin.results.evaluation import expression
from twin.run.report_plots import draw_plots
from twin.web import PackedArrays

if TYPE_CHECKING:
    from collections.abc import Sequence


def test_without_plots_every_signal_is_drawn() -> None:
    assert [(plot.title, plot.unit, plot.per_variant) for plot in plotting.default_plots(tables())] == [
        ("a", "N", True),
        ("a", "m", True),
    ]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(2, 50))
def test_envelope_keeps_every_peak(values: list[float], points: int) -> None:
    y = np.array(values)
    x, shown = plotting.envelope(np.arange(len(y)), y, points)
    assert len(x) == len(shown) <= points
    assert (shown.min(), shown.max()) == (y.min(), y.max())
    assert (np.diff(x) >= 0).all()


@pytest.mark.slow
def test_plots_survive_what_is_not_a_number() -> None:
    broken = {("A", 1): Signals(TIME, {"a.force": np.where(TIME > 2, np.nan, np.inf)}, {"a.force": "N"})}
    assert plotting.plot_svg(PLOTS[0], broken, [EventLine(1.0)]).startswith("<svg")
    one = {("A", 1): Signals(TIME[:1], {"a.force": TIME[:1]})}
    assert plotting.plot_svg(PLOTS[0], one).startswith("<svg")


@pytest.mark.slow
def test_points_are_marked_where_there_are_numbers() -> None:
    """Matplotlib draws a marker once per point as a reference to one definition."""
    sparse = np.full(len(TIME), np.nan)
    sparse[[10, 200, 3000]] = 1.0, 2.0, 3.0
    found = {("A", 1): Signals(TIME, {"a.x": sparse, "a.y": sparse**2})}
    curve = PlotCurve(expression.parse("a.y"), "y", expression.parse("a.x"))
    line, points = (plotting.plot_svg(Plot("P", (curve,), points=flag), found) for flag in (False, True))
    assert points.count("<use ") - line.count("<use ") == 3


@pytest.mark.slow
def test_where_an_expectation_failed_is_marked() -> None:
    """On the curve that was judged; in a plot of its own where none is; nowhere if it holds."""
    late = Window(2 * 10**9)
    error = expression.parse("a.force-0.2")
    limits = [
        LIMIT,
        Expectation("far", signal=error, at_most=0.04, unit="N", window=late),
        Expectation("end", metric="end", at_most=-1.0),
        Expectation("holds", signal=FORCE, at_most=1.0),
    ]
    metrics = {"end": Metric("end", expression.parse("a.x"), "final")}
    cases = tables()
    evaluation = evaluate(metrics, limits, cases)
    found = {one.name: one for one in find_violations(limits, evaluation, cases)}
    assert list(found) == ["stays <in> band", "far", "end"]
    assert list(found["far"].cases) == [("PI", 1), ("PI", 2)]

    force = cases["PI", 1].values["a.force"]
    bad = found["far"].violating_samples(("PI", 1), TIME, force - 0.2)
    assert np.array_equal(bad, (TIME >= 2) & (force - 0.2 > 0.04))
    whole, part = (
        found["end"].violating_samples(("PI", 1), TIME[:n], cases["PI", 1].values["a.x"][:n]) for n in (5001, 4000)
    )
    assert np.flatnonzero(whole).tolist() == [5000]
    assert not part.any()  # a plot that ends earlier shows nothing of it

    shown = draw_plots(PLOTS[:1], cases, [], list(found.values()), PackedArrays(), "runs/x")
    assert [one.title for one in shown] == ["Failed: far", "Failed: end", "Force <per> controller"]
    assert "; line: seed 1; light: range of seeds 1-2; red: " in shown[2].note
    assert shown[2].note.endswith("red: violates stays <in> band: a.force from 0.1 N to 0.22 N, in PI")
    assert (
        draw_plots(PLOTS[1:2], cases, [], [], PackedArrays(), "")[0].note
        == "line: seed 1; light: on paper only, seed 2"
    )
    assert all(plot_annotations.VIOLATION_COLOR in one.svg for one in shown)
    assert plot_annotations.VIOLATION_COLOR not in plotting.plot_svg(PLOTS[0], cases)


@pytest.mark.slow
def test_events_have_their_names_where_they_happen() -> None:
    happened = [EventLine(1.0, "set a.k = 4 N/m", ("PI",)), EventLine(2.0, "fault one")]
    svg = plotting.plot_svg(PLOTS[0], tables(), happened)
    assert labels(svg).count("a.k = 4 N/m") == 1
    assert labels(svg).count("fault one") == 2


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("unit", "name"), [("mN", "force"), ("mm/s", "velocity"), ("", "value"), ("%", "part"), ("qq", "")]
)
def test_several_signals_have_their_quantity_at_the_axis(unit: str, name: str) -> None:
    assert plot_annotations.quantity_name(unit) == name
    svg = plotting.plot_svg(Plot("P", (PlotCurve(FORCE, "a"), PlotCurve(FORCE, "b")), unit="mN"), tables())
    assert "force [mN]" in labels(svg)


def numbers(texts: Sequence[str]) -> list[float]:
    """Those that are numbers."""
    return [float(text) for text in texts if re.fullmatch(r"-?\d+(\.\d+)?", text)]


@pytest.mark.slow
@every_case("scale", [1.0, 0.05, 4e-3, -4e-3, 3.7e-4])
def test_ticks_and_legends_say_what_is_drawn(scale: float) -> None:
    """Every tick stands where its number is, also where numbers need three digits and more behind the point."""
    ramp = {("A", 1): Signals(TIME, {"a.x": scale * TIME / TIME[-1], "a.y": 0 * TIME}, {})}
    curves = (
        PlotCurve(expression.parse("a.x"), "limit 0.0362 m"),
        PlotCurve(expression.parse("a.y"), 'at 1.2345 d="0.6789"'),
    )
    svg = plotting.plot_svg(Plot("P", curves), ramp)
    texts = labels(svg)
    assert {"limit 0.0362 m", 'at 1.2345 d="0.6789"'} <= set(texts)

    times = numbers(texts[: texts.index("time [s]")])
    ticks = numbers(texts[texts.index("time [s]") :])
    for axis in (times, ticks):
        assert len(axis) == len(set(axis)) > 3, axis
        assert np.diff(axis) == pytest.approx(np.diff(axis)[0], rel=1e-9)
    assert max(map(abs, ticks)) == pytest.approx(abs(scale), rel=0.3)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("value", [True, False])
def test_a_boolean_is_drawn_between_its_values(value: bool) -> None:
    steady = {("A", 1): Signals(TIME, {"a.on": np.full(len(TIME), value), "a.n": np.full(len(TIME), 3)}, {})}
    axis = labels(plotting.plot_svg(Plot("P", (PlotCurve(expression.parse("a.on"), "on"),)), steady))
    assert axis[axis.index("time [s]") + 1 :] == ["0", "1", "on"]
    axis = labels(plotting.plot_svg(Plot("P", (PlotCurve(expression.parse("a.n"), "n"),)), steady))
    assert axis[axis.index("time [s]") + 1 :] == ["3", "n"]


def test_a_boolean_is_drawn_with_steps() -> None:
    """A sample holds until the next one: no slope that never was."""
    few = {("A", 1): Signals(np.arange(4.0), {"a.on": np.array([False, True, True, False])}, {})}
    svg = plotting.plot_svg(Plot("P", (PlotCurve(expression.parse("a.on"), "on"),)), few)
    drawn = [element.get("d", "") for element in ET.fromstring(svg).iter(f"{SVG}path") if "clip-path" in element.attrib]
    points = np.array([text.split() for text in re.split("[ML]", drawn[-1])[1:]], float)
    assert np.all(np.min(np.abs(np.diff(points, axis=0)), axis=1) < 0.02)


def test_places_in_plots_are_short_and_rounded() -> None:
    """The path of a drawn line is at most half a hundredth of a point off."""
    exact = '<path d="M 1.23456 -7.996 L 0.004 12 C 1.5e-05 2"/><text x="3.14159">3.14159 &lt;</text>'
    short = '<path d="M 1.23 -8 L 0 12 C 1.5e-05 2"/><text x="3.14">3.14159 &lt;</text>'
    assert figure_files.round_coordinates(exact) == short
    svg = plotting.plot_svg(PLOTS[1], tables())
    paths = [element.get("d", "") for element in ET.fromstring(svg).iter(f"{SVG}path")]
    assert not re.search(r"\.\d{3}", " ".join(paths))
