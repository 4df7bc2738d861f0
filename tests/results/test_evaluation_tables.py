"""What judges a run, as tables: ends of hardware, orders of variants, dimensions, reductions part by part."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from twin.results import Expectation, Metric, Plot, Signals, Window, evaluate
from twin.results.evaluation import dimension, expression
from twin.results.evaluation.hardware_termination import HardwareTermination
from twin.results.evaluation.metric_format import display_units, metric_formats
from twin.results.evaluation.metrics import MetricResult
from twin.results.evaluation.ordering import check_order
from twin.results.evaluation.reduction import MOMENT_REDUCTIONS, REDUCTIONS, reduce_samples

S = 10**9
X = expression.parse("a.x")
CASE = {("PI", 1): Signals(np.arange(2.0), {"a.x": np.arange(2.0)})}


@every_case(
    ("ends", "window", "termination", "verdict", "detail"),
    [
        ("completed", (), None, "pass", "1 run completed, everything at rest; expected a run to its end."),
        (
            "completed",
            (),
            (2, ""),
            "fail",
            "PI, seed 1 stopped at 2 s: limit Expected a run to its end, everything at rest.",
        ),
        ("stopped", (), None, "fail", "PI, seed 1 ran to its end. Expected a stop, everything at rest."),
        ("stopped", (), (2, ""), "pass", "1 run stopped at 2 s, everything at rest; expected a stop."),
        (
            "stopped",
            (2, 3),
            (2, ""),
            "pass",
            "1 run stopped at 2 s, everything at rest; expected a stop from 2 s to 3 s.",
        ),
        (
            "stopped",
            (2, 3),
            (3, ""),
            "pass",
            "1 run stopped at 3 s, everything at rest; expected a stop from 2 s to 3 s.",
        ),
        (
            "stopped",
            (2, None),
            (1, ""),
            "fail",
            "PI, seed 1 stopped at 1 s: limit Expected a stop from 2 s, everything at rest.",
        ),
        (
            "stopped",
            (None, 2),
            (3, ""),
            "fail",
            "PI, seed 1 stopped at 3 s: limit Expected a stop until 2 s, everything at rest.",
        ),
        ("stopped", (None, 2), (2, ""), "pass", "1 run stopped at 2 s, everything at rest; expected a stop until 2 s."),
        (
            "stopped",
            (),
            (2, "x"),
            "fail",
            "PI, seed 1 stopped at 2 s: limit Not at rest: x Expected a stop, everything at rest.",
        ),
        (
            "completed",
            (),
            (None, "x"),
            "fail",
            "PI, seed 1 ran to its end. Not at rest: x Expected a run to its end, everything at rest.",
        ),
    ],
)
def test_how_hardware_ends_a_run(
    ends: str, window: tuple[Any, ...], termination: Any, verdict: str, detail: str
) -> None:
    limits = [None if edge is None else edge * S for edge in window]
    expectation = Expectation("", ends=ends, window=Window(*limits))
    recorded = {}
    if termination:
        time, unsafe = termination
        recorded = {("PI", 1): HardwareTermination(None if time is None else time * S, "limit", unsafe)}
    (found,) = evaluate({}, [expectation], CASE, True, recorded).expectation_results
    assert (found.verdict, found.detail) == (verdict, detail)
    assert (
        found.name == f"ends with {detail.rpartition('xpected ')[2].rstrip('.').removesuffix(', everything at rest')}"
    )


def test_ends_of_several_runs() -> None:
    tables = {("PI", seed): CASE["PI", 1] for seed in (1, 2)} | {("FF", 1): CASE["PI", 1]}
    ended = {("PI", 1): HardwareTermination(S), ("PI", 2): HardwareTermination(3 * S)}
    expectations = [Expectation("e", ends="stopped", variants=names) for names in (("PI",), ("FF",), ("none",))]
    found = [
        (each.name, each.verdict, each.detail, each.more)
        for each in evaluate({}, expectations, tables, True, ended).expectation_results
    ]
    assert found == [
        (
            "e",
            "pass",
            "2 runs stopped at 1 s to 3 s, everything at rest; expected a stop.",
            "Judged in 1 of 2 variants: PI.",
        ),
        (
            "e",
            "fail",
            "FF, seed 1 ran to its end. Expected a stop, everything at rest.",
            "Judged in 1 of 2 variants: FF.",
        ),
        ("e", "skipped", "None of its variants was run.", ""),
    ]


def result(variant: str, *values: float | None, unit: str = "N", paper: float | None = None) -> MetricResult:
    metric = Metric("m", X, "mean", unit=unit)
    return MetricResult(metric, variant, dict(enumerate(values, 1)), paper)


@every_case(
    ("first", "second", "options", "verdict", "detail"),
    [
        ((2.0,), (1.0,), {}, "pass", "m: PI 2 N > FF 1 N."),
        ((1.0,), (1.0,), {}, "fail", "1 N in FF, expected below 1 N (PI)."),
        ((1.0,), (2.0,), {"descending": False}, "pass", "m: PI 1 N < FF 2 N."),
        ((2.0,), (1.0,), {"descending": False}, "fail", "1 N in FF, expected above 2 N (PI)."),
        ((2.0,), (1.0,), {"margin": 1.0}, "pass", "m: PI 2 N > FF 1 N (required margin: 1 N)."),
        ((2.0,), (1.0,), {"margin": 1.25}, "fail", "1 N in FF, expected at most 0.75 N (PI 2 N less 1.25 N)."),
        ((2.0,), (1.0,), {"margin_part": 0.5}, "pass", "m: PI 2 N > FF 1 N (required margin: 50 %)."),
        ((-2.0,), (-3.0,), {"margin_part": 0.75}, "fail", "-3 N in FF, expected at most -3.5 N (PI -2 N less 75 %)."),
        ((None,), (1.0,), {}, "fail", "1 N in FF, expected below - (PI)."),
        ((2.0,), (None,), {}, "fail", "- in FF, expected below 2 N (PI)."),
        ((2.0, 3.0), (1.0, 2.0), {}, "pass", "m: PI 2.5 N > FF 1.5 N."),
        ((2.0, 3.0), (2.5, 2.0), {}, "pass", "m: PI 2.50 N > FF 2.25 N; not at seed 1."),
        ((2.0, 3.0), (2.0, 2.0), {}, "pass", "m: PI 2.5 N > FF 2.0 N; not at seed 1."),
        ((2.0, 3.0), (3.0, 4.0), {}, "fail", "3.5 N in FF, expected below 2.5 N (PI); all seeds."),
    ],
)
def test_orders(first: Any, second: Any, options: dict[str, Any], verdict: str, detail: str) -> None:
    expectation = Expectation("", "m", ordered=("PI", "FF"), unit="N", **options)
    name = f"m {'rises' if options.get('descending') is False else 'falls'}: PI, FF"
    found = check_order(expectation, {"PI": result("PI", *first), "FF": result("FF", *second)})
    assert found[:3] == (name, verdict, detail)


def test_an_order_of_one_variant() -> None:
    expectation = Expectation("named", "m", ordered=("PI", "FF"))
    assert check_order(expectation, {"PI": result("PI", 1.0)}) == (
        "named",
        "skipped",
        "Not judged: an order needs at least two of PI and FF; only PI has m in this run.",
        "",
    )


@every_case(
    ("values", "unit", "decimals"),
    [
        ((0.0999,), "N", 4),
        ((0.1,), "N", 1),
        ((0.0,), "N", None),
        ((0.05, 0.2), "N", 2),
        ((12.5, 3.0), "N", 1),
        ((9999.0,), "N", 0),
        ((10000.0,), "N", None),
        ((0.001,), "K", 3),
        ((0.00099,), "K", None),
        ((0.0999,), "mN", 1),
        ((123.456,), "", 1),
        ((), "N", None),
    ],
)
def test_decimals_of_a_metric(values: tuple[float, ...], unit: str, decimals: int | None) -> None:
    results = [result("PI", value, unit=unit) for value in values] or [result("PI", None, unit=unit)]
    found = metric_formats(results)["m"]
    assert (found.unit, found.decimals) == (unit, decimals)


def test_a_quantity_has_one_unit_whatever_the_values_are() -> None:
    assert display_units({"a": "N", "b": "mN", "c": "mm", "d": "", "e": "s"}) == {
        "a": "mN",
        "b": "mN",
        "c": "mm",
        "d": "",
        "e": "s",
    }
    metrics = {name: Metric(name, X, "mean", unit=unit) for name, unit in (("a", "N"), ("b", "mN"))}
    for value in (0.01, 12.0):
        formats = metric_formats(MetricResult(metric, "PI", {1: value}, None) for metric in metrics.values())
        assert {style.unit for style in formats.values()} == {"mN"}
    limits = [Expectation("low", "a", at_most=0.4, unit="N"), Expectation("", "a", ordered=("PI", "FF"))]
    tables = {(name, 1): Signals(np.arange(2.0), {"a.x": np.full(2, 0.5)}, {"a.x": "N"}) for name in ("PI", "FF")}
    found = evaluate(metrics, limits, tables).expectation_results
    assert [each.detail for each in found] == [
        "mean 500 mN in 0 s to 1 s in PI, expected at most 400 mN; fails in all variants.",
        "500 mN in FF, expected below 500 mN (PI).",
    ]


def test_the_mean_and_the_worst_of_seeds() -> None:
    values = result("PI", 1.0, -3.0)
    assert (values.mean, values.worst, values.ratio) == (-1.0, -3.0, None)
    assert result("PI", 1.0, 3.0, paper=4.0).ratio == 0.5
    assert result("PI", 1.0, paper=0.0).ratio is None
    assert [getattr(result("PI", 1.0, None, paper=1.0), name) for name in ("mean", "worst", "ratio")] == [None] * 3
    assert [getattr(result("PI"), name) for name in ("mean", "worst")] == [None] * 2
    least = MetricResult(Metric("m", X, "min"), "PI", {1: 1.0, 2: -0.5, 3: -0.25}, None)
    assert least.worst == -0.5
    largest = MetricResult(Metric("m", X, "max"), "PI", {1: -1.0, 2: 0.5, 3: -2.0}, None)
    assert largest.worst == 0.5


@every_case("reduce", REDUCTIONS)
@every_case("cuts", [[], [0], [1], [3], [2, 2, 5], [1, 2, 3, 4, 5, 6]])
def test_a_reduction_part_by_part_is_that_of_the_whole(reduce: str, cuts: list[int]) -> None:
    values = np.array([0.5, -3.25, 2.0, 2.0, 7.5, -1.0, 0.25])
    assert set(REDUCTIONS) == set(MOMENT_REDUCTIONS)
    expected = {
        "mean": 8.0 / 7,
        "rms": np.sqrt(np.sum(values**2) / 7),
        "std": np.sqrt(np.sum(values**2) / 7 - (8.0 / 7) ** 2),
        "max_abs": 7.5,
        "min": -3.25,
        "max": 7.5,
        "final": 0.25,
        "peak_to_peak": 10.75,
    }
    assert reduce_samples(reduce, np.split(values, cuts)) == pytest.approx(expected[reduce], rel=1e-14)
    assert reduce_samples("max_abs", np.split(-values, cuts)) == 7.5
    assert np.isnan(reduce_samples(reduce, [np.array([]), np.array([])]))


@every_case(
    ("text", "factors"),
    [
        ("N", {"N": 1}),
        ("N*m", {"N": 1, "m": 1}),
        ("N/m", {"N": 1, "m": -1}),
        ("N/m^2", {"N": 1, "m": -2}),
        ("N/m**2", {"N": 1, "m": -2}),
        ("J/(kg*K)", {"J": 1, "kg": -1, "K": -1}),
        ("m^2*m/s^2", {"m": 3, "s": -2}),
        ("m^-2", {"m": -2}),
        ("m/m", {}),
        ("1/s", {"s": -1}),
        ("N m", {"N m": 1}),
        ("m^12", {"m^12": 1}),
        ("%", {"%": 1}),
        ("°C/s", {"°C": 1, "s": -1}),
    ],
)
def test_factors_of_a_unit(text: str, factors: dict[str, int]) -> None:
    assert dimension.split_unit(text) == tuple((symbol, Fraction(power)) for symbol, power in factors.items())


@every_case(
    ("factors", "text"),
    [
        ({}, ""),
        ({"N": 1}, "N"),
        ({"N": 2}, "N^2"),
        ({"N": Fraction(1, 2)}, "N^0.5"),
        ({"N": 1, "m": 1}, "N*m"),
        ({"N": 1, "m": -1}, "N/m"),
        ({"N": 1, "m": -2, "s": -1}, "N/(m^2*s)"),
        ({"s": -1}, "1/s"),
        ({"s": -1, "m": -1}, "1/(s*m)"),
        ({"N/m": 2}, "(N/m)^2"),
        ({"N m": 1, "s": 1}, "(N m)*s"),
        ({"N m": 1}, "N m"),
    ],
)
def test_a_product_of_units(factors: dict[str, Any], text: str) -> None:
    assert dimension.format_product(tuple((symbol, Fraction(power)) for symbol, power in factors.items())) == text


def test_powers_and_products_of_measures() -> None:
    force, length = dimension.unit_measure("N"), dimension.unit_measure("m")
    assert force.multiply(length).unit == "N*m"
    assert force.multiply(force.raise_to(Fraction(-1))) == dimension.DIMENSIONLESS
    assert force.raise_to(Fraction(0)) == dimension.DIMENSIONLESS
    assert force.raise_to(Fraction(99)).factors == (("N", Fraction(99)),)
    assert force.raise_to(Fraction(100)) is dimension.UNKNOWN
    assert force.raise_to(Fraction(-100)) is dimension.UNKNOWN
    assert force.raise_to(Fraction(98)).multiply(force).factors == (("N", Fraction(99)),)
    assert force.raise_to(Fraction(99)).multiply(force) is dimension.UNKNOWN
    assert force.raise_to(Fraction(-99)).multiply(force.raise_to(Fraction(-1))) is dimension.UNKNOWN
    for other in (dimension.UNKNOWN, force):
        assert dimension.UNKNOWN.multiply(other) is dimension.UNKNOWN
        assert other.multiply(dimension.UNKNOWN) is dimension.UNKNOWN
        assert dimension.UNKNOWN.is_compatible(other)
        assert other.is_compatible(dimension.UNKNOWN)
    assert not force.is_compatible(length)
    assert dimension.unit_measure("rad").is_compatible(dimension.DIMENSIONLESS)
    assert dimension.unit_measure("J").is_compatible(force.multiply(length))
    assert (force.text, dimension.DIMENSIONLESS.text) == ("is in N", "is a plain number")
    assert [dimension.unit_measure(text) for text in ("", "1", "-")] == [dimension.DIMENSIONLESS] * 3
    assert [dimension.unit_measure(text) for text in (None, "?")] == [dimension.UNKNOWN] * 2
    half = force.multiply(length).raise_to(Fraction(2, 3)).multiply(force.raise_to(Fraction(1, 3)))
    assert half.unit == "N*m^(2/3)"
    assert dimension.Measure((("N", Fraction(3, 2)), ("kg", Fraction(1, 2)), ("m", Fraction(-3, 2)))).unit == "kg^2/s^3"


@every_case(
    ("text", "count"),
    [
        ("3", None),
        ("-3 + 2", None),
        ("t.a", 1.0),
        ("+t.a", 1.0),
        ("-t.a", -1.0),
        ("t.a - t.b", 0.0),
        ("t.a - 2", 0.0),
        ("2 - t.a", 0.0),
        ("t.a + 2", 1.0),
        ("2 + t.a", 1.0),
        ("t.a + t.b", 2.0),
        ("t.a + t.b - t.c", 1.0),
        ("t.a - -t.b", 2.0),
        ("t.a * 3", 3.0),
        ("3 * t.a", 3.0),
        ("t.a / 4", 0.25),
        ("t.a / 0", 1.0),
        ("2 / t.a", 1.0),
        ("t.a * t.b", 1.0),
        ("(t.a - t.b) * t.c", 0.0),
        ("t.a / t.b", 1.0),
        ("(t.a + t.b) / t.c", 2.0),
        ("3 ** t.a", 1.0),
        ("abs(-t.a)", 1.0),
        ("abs(2)", None),
        ("max(t.a, t.b, 3)", 1.0),
        ("max(t.a - t.b, t.c)", 1.0),
        ("max(t.a - t.b, t.c - t.b)", 0.0),
    ],
)
def test_zeros_of_a_scale(text: str, count: float | None) -> None:
    parsed = expression.parse(text)
    assert dimension.zero_count(parsed.tree) == count
    assert dimension.is_difference(parsed) is (count not in (None, 1.0))


@every_case(
    ("text", "size"),
    [
        ("a.x - a.y", [7.0, 6.0]),
        ("-a.x + a.y", [7.0, 6.0]),
        ("a.x * -a.y", [12.0, 8.0]),
        ("a.x / a.y", [0.75, 0.5]),
        ("a.x ** 2", [9.0, 4.0]),
        ("abs(a.x - a.y)", [7.0, 6.0]),
        ("min(a.x, a.y, 3)", [3.0, 2.0]),
        ("-5", 5.0),
    ],
)
def test_the_size_of_operands(text: str, size: Any) -> None:
    values = {"a.x": np.array([3.0, -2.0]), "a.y": np.array([-4.0, 4.0])}
    np.testing.assert_array_equal(expression.parse(text).magnitude(values), size)


def test_units_of_plots_have_no_offset_in_differences() -> None:
    from twin.results import PlotCurve

    temperature, rise = (PlotCurve(expression.parse(text), "") for text in ("t.a", "t.a - t.b"))
    assert Plot("", (rise,), unit="degC").shown(5.0) == "5 degC"
    assert Plot("", (temperature, rise), unit="degC").shown(310.15) == "37 degC"
