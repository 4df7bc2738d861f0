"""Figures whose texts come from files: nothing in them is a formula, breaks the SVG or ends in a warning."""

import re
import warnings
from xml.dom import minidom

import numpy as np
import pytest

from twin.results import Plot, Signals, figure_files, histogram, plotting
from twin.results.evaluation import expression
from twin.results.evaluation.metrics import PlotCurve
from twin.scene import picture

TEXTS = (
    "\x1b[31m red",
    "\x00\x07",
    "\u202eright to left",
    "العربية",
    "😀 中文",
    "$5 and $6_{",
    r"$\frac{1$",
    "</text></svg><script>x</script>",
    "a\nb",
)


@pytest.mark.slow
@pytest.mark.parametrize("text", TEXTS)
def test_texts_are_drawn_as_they_are(text, tmp_path):
    time = np.linspace(0.0, 1.0, 20)
    tables = {(name, 0): Signals(time, {"a.x": time, "a.y": -time}) for name in (f"one {text}", "other")}
    plot = Plot(text, (PlotCurve(expression.parse("a.x"), text),), label=text, x_label=text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = [plotting.plot_svg(plot, tables), plotting.bar_chart({text: 1.0, "b": 2.0}, text)]
    for svg in drawn:
        root = minidom.parseString(svg).documentElement
        assert root.getElementsByTagName("script") == []
        assert not re.search(r"[\x00-\x08\x0b-\x1f\x1b\u202a-\u202e]", svg)


@pytest.mark.slow
def test_powers_of_ten_stay_formulas():
    svg = histogram(np.r_[np.zeros(5000), 1.0], "jitter [ms]")
    assert "mathdefault" not in re.sub("<!--.*?-->", "", svg, flags=re.DOTALL)


@pytest.mark.slow
def test_a_picture_of_any_title(tmp_path):
    from matplotlib.figure import Figure

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = Figure()
        figure.subplots().set_title("".join(TEXTS).replace("$", ""))
        picture.save_figure(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize("place", [0, 1, 3_333, 9_999])
def test_no_peak_is_lost_in_a_thinned_line(place):
    """The smallest and largest value of every part, from the first sample to the last."""
    x, y = np.arange(10_000.0), np.zeros(10_000)
    y[place] = -1.0
    thin_x, thin_y = plotting.envelope(x, y, 200)
    assert len(thin_x) == len(thin_y) == 200
    assert thin_x[0] == 0.0
    assert np.all(np.diff(thin_x) > 0.0)
    assert np.count_nonzero(thin_y == -1.0) == 1
    assert abs(thin_x[np.argmin(thin_y)] - place) <= 100.0


def test_a_thinned_edge_keeps_its_direction():
    x = np.arange(1_000.0)
    _, rising = plotting.envelope(x, x, 100)
    _, falling = plotting.envelope(x, -x, 100)
    assert np.all(np.diff(rising) > 0.0)
    assert np.all(np.diff(falling) < 0.0)
    short = plotting.envelope(x, x, 1_000)
    assert short[0] is x
    for count, expected in ((0, 0), (1, 1), (30, 30), (31, 16), (60, 30), (61, 21), (1000, 30)):
        thin_x, thin_y = plotting.thin_loop(x[:count], -x[:count], 10)
        assert len(thin_x) == expected
        assert np.array_equal(thin_y, -thin_x)


def test_points_of_a_curve():
    """Over time or over another signal; not a number is a gap; none where a signal was not recorded."""
    time = np.arange(3.0)
    signals = Signals(time, {"a.x": 2.0 * time, "a.y": np.array([1.0, np.inf, 3.0])})
    y, x, z = map(expression.parse, ("a.y", "a.x", "a.z"))
    for curve, expected in (
        (PlotCurve(y, ""), (time, [1.0, np.nan, 3.0])),
        (PlotCurve(x, "", x), (2.0 * time, 2.0 * time)),
    ):
        np.testing.assert_array_equal(plotting.evaluate_curve(curve, Plot("", (curve,)), signals), expected)
    for curve in (PlotCurve(z, ""), PlotCurve(y, "", z)):
        assert plotting.evaluate_curve(curve, Plot("", (curve,)), signals) is None


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("style", [None, {"lines.linewidth": 7.0}])
def test_a_figure_is_the_same_each_time_and_has_its_style(style):
    svg = [figure_files.render_svg((2, 1), "salt", lambda axes: axes[0, 0].plot([0, 1]), style) for _ in range(2)]
    assert svg[0] == svg[1]
    assert ("stroke-width: 7" in svg[0]) is (style is not None)
