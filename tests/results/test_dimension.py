"""What expressions measure, and whether what they add up fits."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.every_case import every_case
from twin.component import unit
from twin.errors import ScenarioError
from twin.results import Expectation, Metric, Plot, PlotCurve, Signals, evaluate, format_value, plotting
from twin.results.evaluation import dimension, expression
from twin.run.report import metric_rows

UNITS = {
    "v.pressure": "Pa",
    "v.supply": "bar",
    "v.force": "N",
    "v.x": "m",
    "v.speed": "m/s",
    "v.stiffness": "N/m",
    "v.area": "m^2",
    "v.angle": "rad",
    "v.ratio": "",
    "v.temperature": "K",
    "v.ambient": "degC",
    "v.foreign": None,
    "v.odd": "fathomless",
}


@every_case(
    ("text", "unit"),
    [
        ("v.pressure", "Pa"),
        ("-v.pressure + 2", "Pa"),
        ("2 - v.x", "m"),
        ("v.pressure + v.supply", "Pa"),
        ("v.supply * v.area", "bar*m^2"),
        ("v.pressure ** 2", "Pa^2"),
        ("v.pressure ** (1 + 1) / v.pressure", "Pa"),
        ("sqrt(v.x**2 + v.area)", "m"),
        ("sqrt(v.area)", "m"),
        ("sqrt(v.force)", "N^0.5"),
        ("v.force ** 0.5 * v.x", "N^0.5*m"),
        ("v.x / v.force ** (1 / 3)", "m/N^(1/3)"),
        ("sqrt(v.supply)", "kg^0.5/(m^0.5*s)"),
        ("sqrt(v.angle)", ""),
        ("v.x ** 12", "m^12"),
        ("v.stiffness * v.x", "N"),
        ("v.force / v.stiffness - v.x", "m"),
        ("v.speed / v.x", "1/s"),
        ("1 / v.speed", "s/m"),
        ("max(v.x, 2, abs(v.x))", "m"),
        ("v.ratio * v.force", "N"),
        ("v.angle * v.ratio + 1", "rad"),
        ("v.ratio ** v.ratio", ""),
        ("2 ** v.ratio", ""),
        ("v.x ** 1e300", ""),
        ("v.x ** (1 / 0)", ""),
        ("0.5", ""),
        ("v.foreign + v.x", ""),
        ("v.odd * v.x", ""),
    ],
)
def test_the_unit_of_an_expression(text: str, unit: str) -> None:
    assert dimension.expression_measure(expression.parse(text), UNITS).unit == unit


@every_case("text", ["v.foreign", "v.foreign * v.x", "v.foreign + v.x", "sqrt(v.foreign)", "v.odd", "3"])
def test_what_is_not_known_fits_everything(text: str) -> None:
    found = dimension.expression_measure(expression.parse(text), UNITS)
    assert all(found.is_compatible(dimension.unit_measure(unit)) for unit in ("", "N", "degC"))


@every_case(
    ("text", "expected"),
    [
        ("v.pressure + v.temperature", "`v.pressure` is in Pa, `v.temperature` is in K. Add and subtract"),
        ("max(v.foreign, v.x, v.force)", "`v.x` is in m, `v.force` is in N. Compare quantities of one kind."),
        ("v.x - v.ratio", "`v.x` is in m, `v.ratio` is a plain number."),
        ("v.x * (v.x + v.speed)", "`v.x` is in m, `v.speed` is in m/s."),
        ("2 ** v.x", "the exponent `v.x` is in m, expected a plain number."),
        ("v.x ** v.ratio", "`v.x` is in m, so its exponent must be a number, not `v.ratio`."),
        ("sqrt(v.force) + v.x", "`sqrt(v.force)` is in N^0.5, `v.x` is in m."),
    ],
)
def test_what_does_not_fit_is_named_with_both_units(text: str, expected: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        dimension.expression_measure(expression.parse(text), UNITS)
    assert str(caught.value).startswith(expected)


@every_case(
    ("text", "unit"),
    [
        ("v.force", "mN"),
        ("v.force - 1", "mN"),
        ("v.ratio * v.force", "mN"),
        ("v.stiffness * v.x", "N"),
        ("v.speed", "mm/s"),
        ("v.force**2", "N^2"),
        ("v.ratio", ""),
        ("v.foreign", ""),
        ("v.supply + v.pressure", "bar"),
    ],
)
def test_a_value_is_shown_as_the_signal_in_its_unit(text: str, unit: str) -> None:
    parsed = expression.parse(text)
    units = {signal.name: UNITS[signal.name] or "" for signal in parsed.signals}
    displays = {"v.force": "mN", "v.speed": "mm/s"}
    assert dimension.preferred_unit(dimension.expression_measure(parsed, UNITS), units, displays) == unit


@every_case(
    ("text", "differs"),
    [
        ("v.temperature", False),
        ("v.temperature + 5", False),
        ("(v.temperature + v.ambient) / 2", False),
        ("max(v.temperature, v.ambient)", False),
        ("v.ratio * v.temperature", False),
        ("v.temperature - v.ambient", True),
        ("abs(v.temperature - v.ambient)", True),
        ("v.temperature - 310.15", True),
        ("2 * (v.temperature - v.ambient) / 3", True),
        ("min(v.temperature - v.ambient, 5)", True),
        ("5", False),
    ],
)
def test_differences_have_no_offset(text: str, differs: bool) -> None:
    assert dimension.is_difference(expression.parse(text)) is differs


@pytest.mark.slow
def test_temperatures_and_their_differences_are_shown_and_judged_right() -> None:
    time = np.arange(3.0)
    tables = {("base", 1): Signals(time, {"v.a": 303.15 + time, "v.b": np.full(3, 20.0)}, {"v.a": "K", "v.b": "degC"})}
    signal, rise = expression.parse("v.a"), expression.parse("v.a - v.b")
    metrics = {
        name: Metric(name, of, reduce, unit="degC")
        for name, of, reduce in (("last", signal, "final"), ("rise", rise, "final"), ("span", signal, "peak_to_peak"))
    }
    limit = Expectation("rise", "rise", at_most=12.0, unit="degC", is_difference=True)
    evaluation = evaluate(metrics, [limit], tables)
    assert [row["mean"] for row in metric_rows(evaluation.metric_results)] == ["32 degC", "12 degC", "2 degC"]
    assert evaluation.expectation_results[0].detail == "rise was 12 degC; expected at most 12 degC."
    assert format_value(12.0, "degF", is_difference=True) == "21.6 degF"
    plot = Plot("rise", (PlotCurve(rise, "rise"),), unit="degC", x_unit="ms", lines=(11.0,))
    figure = plotting.plot_svg(plot, tables)
    assert "rise [degC]" in figure
    assert "time [ms]" in figure
    assert ">2000<" in figure
    assert ">12.00<" in figure
    assert plot.shown(11.0) == "11 degC"


def test_plots_of_what_was_recorded_have_its_display_units() -> None:
    values = {"v.x": np.ones(2), "v.y": np.ones(2), "w.n": np.ones(2)}
    signals = Signals(np.arange(2.0), values, {"v.x": "m", "v.y": "m"}, display_units={"v.x": "mm", "v.y": "um"})
    plots = plotting.default_plots({("base", 1): signals})
    assert [(plot.title, plot.unit, len(plot.curves)) for plot in plots] == [("v", "mm", 2), ("w", "", 1)]


LEAVES = st.sampled_from([*UNITS, "2", "0", "0.5", "1e308", "1e-308"])
EXPRESSIONS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner),
        st.builds("{}({})".format, st.sampled_from(["abs", "sqrt", "norm", "-"]), inner),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner),
    ),
    max_leaves=8,
)


@given(EXPRESSIONS)
@example("v.pressure * 2 ** v.ratio")
def test_every_expression_has_a_unit_that_is_one_or_does_not_fit(text: str) -> None:
    parsed = expression.parse(text)
    dimension.is_difference(parsed)
    try:
        found = dimension.expression_measure(parsed, UNITS)
    except ScenarioError:
        return
    if found.unit and dimension.is_readable(found.unit):
        assert found.exponents == tuple(map(Fraction, unit.describe(found.unit).exponents[:-1]))
