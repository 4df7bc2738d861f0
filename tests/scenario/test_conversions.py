"""Values, windows and limits of a scenario file in SI, and what an SSP keeps of a scenario beside its system.

Over 400 lines: one table of cases for each kind of value.
"""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from tests.scenario.texts import BASE, changed, problems, variable
from twin.errors import CouplingError
from twin.results import Window
from twin.scenario import fmu_reader, parse_scenario, ssp_extra
from twin.scenario.keys import quantities
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

S = 10**9
HERE = SourceLocation("s.yaml", 3)


@every_case(
    ("text", "time"),
    [
        (0, 0),
        (2, 2 * S),
        (0.25, S // 4),
        (-1.5, -3 * S // 2),
        ("1 ms", 10**6),
        ("1ms", 10**6),
        ("2.5 us", 2500),
        ("7 ns", 7),
        ("2 min", 120 * S),
        ("1 h", 3600 * S),
        ("3", 3 * S),
        ("1/30 s", Fraction(S, 30)),
        ("-1/4 s", -S // 4),
        ("1/4 ms", 250_000),
        ("0.5 ns", Fraction(1, 2)),
        (10**7, 10**16),
        (-(10**7), -(10**16)),
    ],
)
def test_times_are_exact(text: Any, time: Any) -> None:
    assert quantities.duration(text) == time
    if isinstance(time, int):
        assert quantities.nanoseconds(text) == time
    else:
        with pytest.raises(ValueError, match="is not a whole number of nanoseconds"):
            quantities.nanoseconds(text)


@every_case(
    ("text", "parts"),
    [("5 m²", ("5", "m²")), ("1 s⁻¹", ("1", "s⁻¹")), ("2 kg·m²", ("2", "kg·m²")), ("5 ²", None), ("²", None)],
)
def test_quantities_with_superscripts(text: str, parts: tuple[str, str] | None) -> None:
    assert quantities.split(text) == parts


@every_case(
    ("value", "reason"),
    [
        (True, "expected a time, such as 1 ms, not True"),
        (None, "expected a time, such as 1 ms, not nothing"),
        ([1], "expected a time, such as 1 ms, not a list"),
        (float("nan"), "nan is not a time. Write a number and a unit, such as 1 ms or 1/30 s"),
        ("soon", "soon is not a time. Write a number and a unit, such as 1 ms or 1/30 s"),
        ("1 N", "1 N is not a time: use s, ms, us, ns, min or h"),
        ("1/0 s", "1/0 s is divided by zero. Write a ratio such as 1/30 s"),
        (10**7 + 1, "10000001 is longer than 10000000 s. Check the unit"),
        (-(10**7) - 1, "-10000001 is longer than 10000000 s. Check the unit"),
    ],
)
def test_what_is_no_time(value: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        quantities.duration(value)
    assert str(caught.value) == reason


@every_case(
    ("text", "parts"),
    [
        ("2 N", ("2", "N")),
        ("-1.5e-3mm/s", ("-1.5e-3", "mm/s")),
        ("3", ("3", "")),
        ("5 /s", ("5", "1/s")),
        ("5 1/(s*N)", ("5", "1/(s*N)")),
        ("5 1 / (s*N)", ("5", "1 / (s*N)")),
        ("1 /(s*N)", ("1", "1/(s*N)")),
        ("1/(s*N)", ("1", "1/(s*N)")),
        ("N", None),
        ("", None),
        ("1" * 80, ("1" * 80, "")),
        ("1" * 81, None),
    ],
)
def test_number_and_unit_of_a_quantity(text: str, parts: tuple[str, str] | None) -> None:
    assert quantities.split(text) == parts


@every_case(
    ("value", "unit", "difference", "si"),
    [
        (2, "mN", False, 2.0),
        ("2", "mN", False, 2.0),
        ("2 mN", "", False, 0.002),
        ("2 mN", "N", False, 0.002),
        ("5 degC", "K", False, 278.15),
        ("5 degC", "", True, 5.0),
        ("90 deg", "rad", False, np.pi / 2),
    ],
)
def test_values_in_si(value: Any, unit: str, difference: bool, si: float) -> None:
    assert quantities.si(value, unit, "x", difference) == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize(("text", "length"), [("x" * 40, 40), ("x" * 41, 40)])
def test_long_values_are_shortened(text: str, length: int) -> None:
    assert len(quantities.short(text)) == length
    assert quantities.short(text).endswith("...") is (len(text) > 40)


@every_case(
    ("value", "result"),
    [
        (1, 1),
        ([1, [True, "x"]], [1, [True, "x"]]),
        ([[[[1]]]], [[[[1]]]]),
        ([[[[[1]]]]], "expected a value or a list of values, not a list"),
        (None, "expected a value or a list of values, not nothing"),
        ({"a": 1}, "expected a value or a list of values, not a group of keys"),
        ([float("inf")], "inf is not a finite number"),
    ],
)
def test_plain_values(value: Any, result: Any) -> None:
    if isinstance(result, str):
        with pytest.raises(ValueError, match=result):
            quantities.raw(value)
    else:
        assert quantities.raw(value) == result


BOOLEAN = {"type": "Boolean", "dtype": np.dtype(bool)}
INT8 = {"type": "Int8", "dtype": np.dtype(np.int8)}
FLOAT32 = {"type": "Float32", "dtype": np.dtype(np.float32)}
ITEMS = {"items": (("open", 1), ("shut", 3)), **INT8}


@every_case(
    ("value", "options", "result"),
    [
        ("2 mN", {"unit": "N"}, 0.002),
        (2, {"unit": "N"}, 2.0),
        (True, BOOLEAN, True),
        (1, BOOLEAN, "x: expected true or false, not 1."),
        (True, {}, "x: expected a number, not True."),
        (True, INT8, "x: expected a number, not True."),
        (127, INT8, 127),
        (128, INT8, "x: expected a whole number (Int8), not 128."),
        (-128, INT8, -128),
        (-129, INT8, "x: expected a whole number (Int8), not -129."),
        (2.0, INT8, 2),
        (2.5, INT8, "x: expected a whole number (Int8), not 2.5."),
        ("shut", ITEMS, 3),
        (1, ITEMS, 1),
        (2, ITEMS, "x: expected an item of the enumeration, not 2. Choose from `open` (1), `shut` (3)."),
        (True, ITEMS, "x: expected an item of the enumeration, not True. Choose from `open` (1), `shut` (3)."),
        (3e38, FLOAT32, np.float32(3e38)),
        (-4e38, FLOAT32, "x: -4e+38 is too large for Float32. Give at most 3.4e+38."),
        ("a", {"type": "String", "dtype": np.dtype(object)}, "a"),
        (1, {"type": "String", "dtype": np.dtype(object)}, "x: expected text, not 1. Put it in quotes."),
        ([1], {}, "x: expected one value, not a list of 1."),
        (5, {"shape": (2, 2)}, [[5.0, 5.0], [5.0, 5.0]]),
        ([[1, 2], [3, 4]], {"shape": (2, 2)}, [[1.0, 2.0], [3.0, 4.0]]),
        ([1, 2], {"shape": (2, 2)}, "x: expected 2 x 2 values or one for all, not 2."),
        ([[1, 2], [3]], {"shape": (2, 2)}, "x: expected 2 x 2 values or one for all, not 2 x -1."),
        ([], {"shape": (2,)}, "x: expected 2 values or one for all, not 0."),
        (["1 mN", 2], {"shape": (2,), "unit": "N"}, [0.001, 2.0]),
    ],
)
def test_values_of_variables(value: Any, options: dict[str, Any], result: Any) -> None:
    target = variable("x", **options)
    if isinstance(result, str) and target.type != "String":
        with pytest.raises(CouplingError) as caught:
            quantities.resolve(value, target, "x")
        assert str(caught.value) == result
    elif isinstance(result, str) and value == 1:
        with pytest.raises(CouplingError, match=result):
            quantities.resolve(value, target, "x")
    else:
        found = quantities.resolve(value, target, "x")
        np.testing.assert_array_equal(found, result)
        assert target.type == "String" or np.asarray(found).dtype == target.dtype


@every_case(
    ("window", "result"),
    [
        ("from: 4 s", Window(4 * S)),
        ("from: 0 s", Window(0)),
        ("from: 9999 ms", Window(9_999_000_000)),
        ("from: 10 s", "from 10 s lies outside the run, 0 s to 10 s. Change it or set stop_time to more than 10 s."),
        ("from: -1 s", "from -1 s lies outside the run, 0 s to 10 s. Change it or stop_time."),
        ("to: 10 s", Window(None, 10 * S)),
        ("to: 11 s", Window(None, 11 * S)),
        ("to: 0 s", Window(None, 0)),
        ("to: -1 s", "to -1 s lies outside the run, 0 s to 10 s. Change it or stop_time."),
        ("from: 4 s, to: 5 s", Window(4 * S, 5 * S)),
        ("from: 4 s, to: 4 s", "to is not after from. Swap them."),
        ("from: 4 s, to: 3 s", "to is not after from. Swap them."),
    ],
)
def test_windows_lie_in_the_run(window: str, result: Window | str) -> None:
    text = changed("from: 4 s, unit", f"{window}, unit")
    if isinstance(result, str):
        assert problems(text) == [f"s.yaml:21: metrics.error: {result}"]
    else:
        assert parse_scenario(text, "s.yaml").metrics["error"].window == result


def test_windows_after_a_short_run_are_one_problem() -> None:
    """With the stop time that all of them need, not a line for each."""
    late = changed("from: 4 s, unit", "from: 12 s, to: 22 s, unit").replace(
        "metrics:\n", "metrics:\n  later: {signal: servo.position, reduce: max, from: 14 s}\n"
    )
    assert late.count("from: 1") == 2
    (line,) = problems(late)
    assert line.endswith(
        "and 1 more: from 12 s or 14 s lie outside the run, 0 s to 10 s. Change it or set stop_time to at least 22 s. "
        "For a short trial: a file that extends this one with metrics, expect and plots as `null`."
    )


def test_the_longest_variant_decides_about_windows() -> None:
    longer = changed("PI: {members", "PI: {stop_time: 20 s, members").replace("from: 4 s, unit", "from: 12 s, unit")
    assert parse_scenario(longer, "s.yaml").metrics["error"].window == Window(12 * S)
    late = longer.replace("from: 12 s, unit", "from: 20 s, unit")
    (line,) = problems(late)
    assert line.endswith("from 20 s lies outside the run, 0 s to 20 s. Change it or set stop_time to more than 20 s.")


def test_numbers_of_a_file_in_si() -> None:
    """Of the base text: each limit in the unit in which it is written."""
    scenario = parse_scenario(BASE, "s.yaml")
    metric, (order, limits), (plot,) = scenario.metrics["error"], scenario.expectations, scenario.plots
    assert metric.paper == pytest.approx({"PI": 0.0362, "PI+FF": 0.0238})
    assert metric.tolerance == pytest.approx(0.2)
    assert (metric.unit, metric.variants) == ("mN", ())
    assert (order.metric, order.ordered, order.unit, order.descending) == ("error", ("PI", "PI+FF"), "mN", True)
    assert (limits.at_least, limits.at_most, limits.unit) == (0.1, 0.4, "N")
    assert limits.window == Window(4 * S)
    assert (plot.band, plot.lines, plot.unit, plot.per_variant) == ((0.1, 0.4), (0.2,), "N", True)


ITEM = "{metric: error, ordered: [PI, PI+FF]}"


@pytest.mark.slow
@every_case(
    ("item", "line"),
    [
        ("{at_most: 1}", "give either `metric` or `signal`, or `ends`."),
        ("{metric: error, signal: sensor.force, at_most: 1}", "give either `metric` or `signal`, or `ends`."),
        ("{ends: stopped, at_most: 1}", "`ends` has no at_most. Give `from` and `to` for a stop."),
        ("{ends: completed, to: 2 s}", "a run is completed at stop_time. Leave `from` and `to` out."),
        ("{ends: completed, from: 2 s}", "a run is completed at stop_time. Leave `from` and `to` out."),
        ("{metric: error}", "nothing is expected. Add at_least, at_most, within or ordered."),
        ("{metric: error, within: [0, 1], at_most: 1}", "at_most and within cannot stand together. Use two items."),
        ("{signal: sensor.force, ordered: [PI, PI+FF]}", "only metrics can be ordered. Name a metric."),
        (
            "{signal: sensor.force, mean: true, at_most: 1}",
            "the mean is that of a metric within limits. Name a metric.",
        ),
        (
            "{metric: error, mean: true, ordered: [PI, PI+FF]}",
            "the mean is that of a metric within limits. Name a metric.",
        ),
        ("{metric: error, from: 2 s, at_most: 1}", "a metric has its own from and to. Give them there."),
        ("{metric: error, to: 2 s, at_most: 1}", "a metric has its own from and to. Give them there."),
        ("{metric: error, at_most: 1, margin: 1 mN}", "a margin is that of an order. Add `ordered`, or leave it out."),
        ("{metric: error, within: [2, 1]}", "the lower limit is above the upper one. Swap them."),
        ("{metric: error, at_least: 2, at_most: 1}", "the lower limit is above the upper one. Swap them."),
        (
            "{metric: error, ordered: [PI, PI+FF], margin: -1 mN}",
            "the margin is below zero. Turn the order around instead.",
        ),
        ("{metric: error, at_most: 1 m}", "`1 m` does not convert to mN."),
    ],
)
def test_limits_that_contradict_each_other(item: str, line: str) -> None:
    assert problems(changed(ITEM, item)) == [f"s.yaml:23: expect: {line}"]


@every_case(
    ("item", "expected"),
    [
        ("{metric: error, at_least: 1, at_most: 1}", {"at_least": 1.0, "at_most": 1.0, "margin": 0.0}),
        ("{metric: error, ordered: [PI, PI+FF], margin: 2 mN}", {"margin": 0.002, "margin_part": 0.0}),
        ("{metric: error, ordered: [PI, PI+FF], margin: 10 %}", {"margin": 0.0, "margin_part": pytest.approx(0.1)}),
        (
            "{metric: error, mean: true, at_most: 5 mN}",
            {"mean": True, "at_most": 0.005, "at_least": None, "unit": "mN"},
        ),
        ("{ends: stopped, from: 2 s, to: 3 s}", {"ends": "stopped", "window": Window(2 * S, 3 * S)}),
        ("{signal: sensor.force, at_most: 5 mN}", {"at_most": 0.005, "unit": "mN", "is_difference": False}),
    ],
)
def test_limits_that_are_accepted(item: str, expected: dict[str, Any]) -> None:
    found = parse_scenario(changed(ITEM, item), "s.yaml").expectations[0]
    assert {name: getattr(found, name) for name in expected} == expected


@every_case(
    ("causality", "options", "settable"),
    [
        ("input", {}, True),
        ("parameter", {}, True),
        ("parameter", {"variability": "fixed"}, False),
        ("output", {}, False),
        ("local", {}, False),
        ("input", {"shape": (2,)}, False),
        ("parameter", {"shape": (2,)}, False),
        ("input", {"type": "String", "dtype": np.dtype(object)}, False),
    ],
)
def test_what_a_person_can_set(causality: str, options: dict[str, Any], settable: bool) -> None:
    assert fmu_reader.is_settable(variable("x", causality, **options)) is settable


def test_a_plot_for_each_unit() -> None:
    units = ["N", "m", "N", "s", "K"]
    variables = {f"x{i}": variable(f"x{i}", "output", unit) for i, unit in enumerate(units)}
    variables |= {f"y{i}": variable(f"y{i}", "output", "N") for i in range(9)}
    variables |= {
        "p": variable("p", "parameter", "N"),
        "v": variable("v", "output", "N", shape=(2,)),
        "b": variable("b", "output", "N", **BOOLEAN),
    }
    assert fmu_reader.plots("a", variables) == [
        {"title": "Outputs", "signals": ["a.x0", "a.x2", *(f"a.y{i}" for i in range(6))]},
        {"title": "Outputs 2", "signals": ["a.x1"]},
        {"title": "Outputs 3", "signals": ["a.x3"]},
    ]


def tree(value: Any) -> Node:
    return Node.of(value, HERE)


def test_items_of_a_variant() -> None:
    items = [
        {"metric": "a", "variants": ["PI", "FF"], "at_most": 1},
        {"metric": "b", "variants": "FF"},
        {"metric": "c", "ordered": ["PI", "FF"]},
        {"metric": "d", "reference": {"PI": 1, "FF": 2}},
        {"metric": "e", "reference": {"FF": 2}, "tolerance": "20 %"},
        {"metric": "f", "reference": 3},
        {"metric": "g", "except": ["PI"], "at_most": 1},
        {"metric": "h", "except": "FF", "at_most": 1},
        "text",
    ]
    kept = [{"metric": "a", "at_most": 1}, {"metric": "d", "reference": 1}, {"metric": "e"}, items[5]]
    kept += [{"metric": "h", "at_most": 1}, "text"]  # a tolerance needs a reference
    assert ssp_extra.of_variant(tree(items), "PI").plain() == kept
    named = ssp_extra.of_variant(tree({str(i): item for i, item in enumerate(items[:4])}), "PI")
    assert named.plain() == {"0": kept[0], "3": kept[1]}
    assert named.location == HERE


def test_items_that_need_an_array() -> None:
    items = [{"title": "A", "signals": ["a.x", "b.y"]}, {"title": "B", "signals": ["a.x[1] - b.z"]}, {"title": "C"}]
    kept, dropped = ssp_extra.split_available(tree(items), {"b.z"})
    assert (kept.plain(), dropped) == ([items[0], items[2]], ["B"])
    kept, dropped = ssp_extra.split_available(tree({"m": {"signal": "f.q"}, "n": {"signal": "g.q"}}), {"f"})
    assert (kept.plain(), dropped) == ({"n": {"signal": "g.q"}}, ["m"])
    kept, dropped = ssp_extra.split_available(tree(items), set())
    assert (kept.plain(), dropped) == (items, [])


def test_arrays_are_recorded_by_element() -> None:
    catalog = {"a": {name: variable(name, "output") for name in ("x", "y")}, "b": {"x": variable("x", "output")}}

    def patterns(*given: str) -> list[str]:
        record = tree({"every": "1 ms", "variables": list(given)})
        found = ssp_extra.record_elements(record, {"a.x"}, catalog).plain()
        assert found["every"] == "1 ms"
        return found["variables"]  # type: ignore[no-any-return]

    assert patterns("a.x", "a.y") == ["a.x[*]", "a.y"]
    assert patterns("a.*") == ["a.*", "a.*[*]"]
    assert patterns("*.x") == ["*.x", "*.x[*]"]
    assert patterns("b.*") == ["b.*"]
    assert ssp_extra.record_elements(tree({"every": 1}), {"a.x"}, catalog).plain() == {"every": 1}


def test_limits_of_metrics_that_are_left_out() -> None:
    expect = [{"metric": "a"}, {"metric": "b"}, {"signal": "c.d"}]
    root = tree({"metrics": {"a": {"signal": "m.x"}, "b": {"signal": "m.y"}}, "expect": expect})
    case: Any = SimpleNamespace(variant="base", actions=(), members={})
    extra, _ = ssp_extra.extra_keys(root, case, {"m.y"}, "title")
    assert extra["expect"].plain() == [expect[0], expect[2]]
    extra, _ = ssp_extra.extra_keys(root.without("metrics"), case, set(), "title")
    assert extra["expect"].plain() == [expect[2]]


def test_names_of_an_entry() -> None:
    assert (ssp_extra.names(tree("PI")), ssp_extra.names(tree(["PI", 1]))) == (["PI"], ["PI", "1"])


@pytest.mark.parametrize(("difference", "kelvin"), [(False, 273.65), (True, 0.5)])
def test_a_standard_deviation_in_degrees_has_no_zero_point(difference: bool, kelvin: float) -> None:
    assert quantities.number("0.5 degC", "K", "", difference) == pytest.approx(kelvin)
