"""Numbers of a comparison: differences of a signal, of its times, of summaries; their order and verdict.

Over 400 lines: signals, metrics and verdicts are compared in the same two made-up runs.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from twin.results import Signals
from twin.results.comparison import (
    MAX_VALUES_IN_MEMORY,
    Comparison,
    Difference,
    batches,
    describe_length_difference,
    is_selected,
    largest_difference,
    missing_signals,
)
from twin.results.recording.run_folder import RecordedVariable
from twin.results.resampling import resample
from twin.results.summary_comparison import (
    MetricChange,
    Missing,
    VerdictChange,
    compare_summaries,
    is_close,
    is_convertible,
    list_missing,
    metric_changes,
    select_variants,
    verdict_changes,
)

INF, NAN = np.inf, np.nan
TIME = np.array([0.0, 1.0, 2.0, 3.0])


def compared(
    first: Any, second: Any, units: tuple[str, str] = ("N", "N"), times: Any = None, tolerance: float = 0.0
) -> Difference:
    """The largest difference of a signal; `times`: those of the second run."""
    one, other = (
        Signals(np.asarray(time, float), {"a.x": np.asarray(values)}, {"a.x": unit} if unit else {})
        for values, unit, time in zip((first, second), units, (TIME, TIME if times is None else times), strict=True)
    )
    return largest_difference("a.x", ("PI", 3), one, other, tolerance)


@every_case(
    ("first", "second", "value", "part", "time"),
    [
        ([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0], 0.0, 0.0, 0.0),
        ([1.0, 2.0, 3.0, 4.0], [1.0, 2.5, 2.0, 4.0], 1.0, 0.25, 1.0),
        ([1.0, 2.0, 3.0, -4.0], [1.0, 2.0, 3.0, -5.0], 1.0, 0.2, 3.0),
        ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
        ([NAN, INF, -INF, 1.0], [NAN, INF, -INF, 1.0], 0.0, 0.0, 0.0),
        ([1.0, NAN, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0], INF, INF, 1.0),
        ([1.0, 2.0, INF, 4.0], [1.0, 2.0, -INF, 4.0], INF, INF, 2.0),
        ([True, True, False, False], [True, False, False, False], 1.0, 1.0, 1.0),
        ([[1, 2], [1, 2], [1, 2], [1, 2]], [[1, 2], [1, 2], [0, 4], [1, 2]], 2.0, 0.5, 2.0),
        ([[1, 2], [1, 2], [1, 2], [1, 2]], [1, 2, 3, 4], INF, INF, 0.0),
    ],
)
def test_the_largest_difference_of_a_signal(first: Any, second: Any, value: float, part: float, time: float) -> None:
    """Relative to the largest magnitude in both; `time`: when it begins."""
    found = compared(first, second)
    assert (found.name, found.variant, found.seed) == ("a.x", "PI", 3)
    assert (found.value, found.part, found.time) == (value, part, time)


def test_a_difference_begins_where_it_exceeds_the_tolerance() -> None:
    first, second = [0.0, 0.0, 0.0, 10.0], [0.0, 1.0, 2.0, 10.0]
    assert compared(first, second, tolerance=0.1).time == 2.0
    assert compared(first, second, tolerance=0.0999).time == 1.0


@every_case(
    ("units", "second", "value", "text"),
    [
        (("N", "mN"), [1000.0, 2000.0, 3000.0, 4000.0], 0.0, "0 N"),
        (("mN", "N"), [1.0, 2.0, 3.0, 4.0], 3.996, "3.996 N"),
        (("K", "degC"), [-272.15, -271.15, -270.15, -269.15], 0.0, "0 K"),
        (("degC", "degC"), [1.0, 2.0, 3.0, 6.0], 2.0, "2 degC"),
        (("N", "m"), [1.0, 2.0, 3.0, 4.0], INF, "no number in one"),
        (("N", ""), [1.0, 2.0, 3.0, 4.0], INF, "no number in one"),
        (("qq", "qq"), [1.0, 2.0, 3.0, 5.0], 1.0, "1 qq"),
        (("qq", "N"), [1.0, 2.0, 3.0, 4.0], INF, "no number in one"),
    ],
)
def test_units_are_converted_before_values_are_compared(
    units: tuple[str, str], second: list[float], value: float, text: str
) -> None:
    found = compared([1.0, 2.0, 3.0, 4.0], second, units)
    assert found.value == pytest.approx(value, abs=1e-12)
    assert found.text == text
    assert is_convertible(*units) is (value < INF)


@every_case(
    ("times", "second", "value"),
    [
        ([0.0, 3.0], [0.0, 3.0], 0.0),  # a straight line
        ([0.0, 1.5, 3.0], [0.0, 1.5, 4.0], 1.0),
        ([1.0, 2.0], [1.0, 2.0], 0.0),  # only where both are recorded
        ([1.0, 1.5], [1.0, 7.0], 0.0),
        ([5.0, 6.0], [1.0, 2.0], INF),
        ([], [], INF),
    ],
)
def test_other_times_are_interpolated(times: list[float], second: list[float], value: float) -> None:
    assert compared(TIME, np.array(second), times=times).value == value


@every_case(
    ("times", "value"),
    [
        (np.arange(0.0, 3.1, 0.5), 0.0),  # the finer recording holds every sample of the coarser one
        ([0.0, 1.5, 3.0], 0.25),  # at 1.5 s the parabola is 0.25 below its chord
        ([0.5, 1.5, 2.5, 3.5], 0.25),  # equally fine: samples of both count
    ],
)
def test_the_verdict_does_not_depend_on_the_order_of_the_recordings(times: Any, value: float) -> None:
    curve, other = TIME**2, np.asarray(times) ** 2
    forth = largest_difference(
        "a.x", ("PI", 3), *(Signals(t, {"a.x": x}, {}) for t, x in ((TIME, curve), (times, other))), 0.0
    )
    back = largest_difference(
        "a.x", ("PI", 3), *(Signals(t, {"a.x": x}, {}) for t, x in ((times, other), (TIME, curve))), 0.0
    )
    assert forth.value == back.value == value
    assert (forth.part, forth.time) == (back.part, back.time)


COARSE, FINE = np.arange(11) / 10, np.arange(101) / 100


@every_case(
    ("coarse", "fine", "value"),
    [
        (np.sin(9 * COARSE), np.sin(9 * FINE), None),  # peaks between the samples of the coarser one
        (0 * COARSE, 0 * FINE + 5.0 * (np.arange(101) == 44), 5.0),
        (np.sin(9 * COARSE), np.sin(9 * FINE) + 5.0 * (np.arange(101) == 44), pytest.approx(4.5, abs=0.5)),
        (0 * COARSE, np.where(np.arange(101) == 44, np.nan, 0.0), INF),
        (COARSE > 0.7, (FINE > 0.7) | (np.arange(101) == 44), 1.0),  # a pulse
        (COARSE > 0.7, FINE > 0.73, None),  # switches between two samples
    ],
)
def test_a_spike_between_the_samples_of_the_coarser_recording_is_a_difference(
    coarse: Any, fine: Any, value: float | None
) -> None:
    """What a smooth curve may do between two samples, or a switch at another time between them, is none."""
    signals = [Signals(t, {"a.x": x}, {}) for t, x in ((COARSE, coarse), (FINE, fine))]
    for pair in (signals, signals[::-1]):
        found = largest_difference("a.x", ("PI", 3), pair[0], pair[1], 1e-9)
        if value is None:
            assert found.value < 1e-9
        else:
            assert (found.value, found.time) == (value, FINE[44])


def test_what_is_no_real_number_keeps_its_value_until_the_next_sample() -> None:
    own = np.array([0.0, 1.0, 2.0])
    assert resample(np.array([-1.0, 0.0, 0.5, 1.0, 9.0]), own, np.array([3, 4, 5]), False).tolist() == [3, 3, 3, 4, 5]
    pairs = np.array([[0.0, 1.0], [2.0, 1.0], [4.0, 1.0]])
    assert resample(np.array([0.5, 1.25]), own, pairs, True).tolist() == [[1.0, 1.0], [2.5, 1.0]]
    assert resample(np.array([0.5]), own, np.zeros((3, 0)), True).shape == (1, 0)
    assert compared([0, 1, 2, 3], [0, 1, 2, 3], times=[0.5, 1.5, 2.5, 3.5]).value == 1.0


@every_case(
    ("first", "second", "text"),
    [
        ([0.0, 1.0], [0.0, 1.0], ""),
        ([0.0, 1.0, 2.0], [0.0, 1.0], ""),  # a sample more
        ([0.0, 1.0, 2.0], [0.0, 0.5, 1.0], ""),
        ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0], "recorded to 3 s and to 1 s."),
        ([0.0, 1.0], [0.0, 1.0, 2.01], ""),
        ([0.0, 0.1, 0.2], [0.0, 0.1, 0.2, 0.3, 0.4], "recorded to 0.2 s and to 0.4 s."),
        ([], [0.0, 1.0, 2.0], "recorded to 0 s and to 2 s."),
        ([0.5], [0.0], "recorded from 0.5 s and from 0 s, to 0.5 s and to 0 s."),
        ([0.0, 1.0, 2.0], [1.0, 2.0], ""),
        ([0.0, 1.0, 2.0, 3.0], [2.0, 3.0], "recorded from 0 s and from 2 s."),
        ([], [], ""),
    ],
)
def test_a_recording_that_ended_earlier(first: list[float], second: list[float], text: str) -> None:
    assert describe_length_difference(np.array(first), np.array(second)) == text


@every_case(
    ("first", "second", "tolerance", "close"),
    [
        (1.0, 1.0, 0.0, True),
        (1.0, 1.1, 0.1, True),
        (10.0, 9.0, 0.1, True),
        (10.0, 8.99, 0.1, False),
        (-10.0, -11.0, 0.09, False),
        (-10.0, -11.0, 0.1, True),
        (None, None, 0.0, True),
        (None, 0.0, 1.0, False),
        (0.0, None, 1.0, False),
    ],
)
def test_numbers_that_are_close(first: float | None, second: float | None, tolerance: float, close: bool) -> None:
    assert is_close(first, second, tolerance) is close


def summary(status: str = "completed", **changes: Any) -> dict[str, Any]:
    values = changes.get("values", {"1": 2.0, "2": 3.0})
    return {
        "status": status,
        "cases": [{"variant": "PI", "seed": seed, "samples": 5} for seed in changes.get("seeds", (1, 2))],
        "metrics": {
            changes.get("metric", "m"): {"unit": changes.get("unit", "N"), "variants": {"PI": {"values": values}}}
        },
        "expectations": [
            {"name": name, "verdict": verdict} for name, verdict in changes.get("verdicts", {"e": "pass"}).items()
        ],
    }


@every_case(
    ("changes", "problems"),
    [
        ({}, []),
        ({"status": "failed"}, ["status: completed and failed."]),
        ({"seeds": (1,)}, ["1 case only in the first run: PI, seed 2"]),
        ({"seeds": ()}, ["2 cases only in the first run: PI, seed 1; PI, seed 2"]),
        ({"seeds": (1, 2, 3)}, ["1 case only in the second run: PI, seed 3"]),
        ({"values": {"1": 2.02, "2": 3.0}}, []),
        ({"values": {"1": 2.03, "2": 3.0}}, ["metric m of PI, seed 1: 2 N and 2.03 N."]),
        ({"values": {"1": 2.0, "2": None}}, ["metric m of PI, seed 2: 3 N and no value."]),
        ({"values": {"1": 2.1, "2": 6.0}}, ["metric m of PI, seed 2: 3 N and 6 N; also in 1 other case."]),
        ({"unit": "mN"}, ["metric m of PI, seed 1: 2 N and 0.002 N; also in 1 other case."]),
        (
            {"metric": "n"},
            ["1 metric only in the first run: m", "1 metric only in the second run: n"],
        ),
        ({"verdicts": {"e": "fail"}}, ["requirement e: pass and fail."]),
        (
            {"verdicts": {"f": "pass"}},
            ["1 requirement only in the first run: e", "1 requirement only in the second run: f"],
        ),
    ],
)
def test_what_differs_in_two_summaries(changes: dict[str, Any], problems: list[str]) -> None:
    """Within one percent; with chosen signals the cases alone."""
    second = summary(**changes)
    different, missing = compare_summaries(summary(), second, 0.01, metrics=True, with_verdicts=True)
    assert [*different, *(entry.text(5) for entry in missing)] == problems
    different, missing = compare_summaries(summary(), second, 0.01, metrics=False, with_verdicts=True)
    assert (different, [entry.text(5) for entry in missing]) == (
        [],
        [text for text in problems if text.split()[1].startswith("case")],
    )
    different, missing = compare_summaries(summary(), second, 0.01, metrics=True, with_verdicts=False)
    whole = ("status", "requirement", "1 requirement")
    own = [problem for problem in problems if not problem.startswith(whole)]
    assert [*different, *(entry.text(5) for entry in missing)] == own
    selected = [select_variants(each, {"BW": ("BW", "BW")}, 0) for each in (summary(), second)]
    assert compare_summaries(*selected, 0.01, metrics=False, with_verdicts=False) == ([], [])


def test_values_of_metrics_have_one_unit_and_differ_in_their_digits() -> None:
    """In the smaller unit that another metric of the scenario has."""
    small, other = summary(values={"1": 2.0, "2": 3.00001}), summary()
    for one in (small, other):
        one["metrics"]["other"] = {**one["metrics"]["m"], "unit": "mN", "variants": {}}
    (line,), _ = compare_summaries(other, small, 1e-9, metrics=True, with_verdicts=True)
    assert line == "metric m of PI, seed 2: 3000 mN and 3000.01 mN."


def test_metrics_of_both_runs_are_a_table() -> None:
    """Sorted by change over the seeds' spread, in the unit of the first run; a value in one run only comes first."""

    def of(**metrics: tuple[str, dict[str, dict[str, float | None]]]) -> dict[str, Any]:
        return {
            "metrics": {
                name: {"unit": unit, "variants": {variant: {"values": own} for variant, own in variants.items()}}
                for name, (unit, variants) in metrics.items()
            }
        }

    first = of(
        force=("mN", {"PI": {"1": 100.0, "2": 300.0}, "FF": {"1": -50.0}}),
        depth=("mm", {"PI": {"1": 0.0}}),
        lag=("s", {"PI": {"1": 1.0}}),
        alone=("s", {"PI": {"1": 1.0}}),
        rest=("degC", {"PI": {"1": 1.0}}),
    )
    second = of(
        force=("N", {"PI": {"1": 0.11, "3": 9.0}, "FF": {"1": -0.1}}),
        depth=("mm", {"PI": {"1": 0.0}}),
        lag=("s", {"PI": {"1": None}}),
        rest=("K", {"PI": {"1": 1.0}}),
    )
    changes = metric_changes(first, second)
    assert [(each.metric, each.variant, each.second) for each in changes] == [
        ("lag", "PI", None),
        ("rest", "PI", None),
        ("force", "FF", -100.0),
        ("force", "PI", 110.0),
        ("depth", "PI", 0.0),
    ]
    table = Comparison((), (), (), 0.0, (), changes).metrics
    assert list(table) == ["metric", "variant", "unit", "first", "second", "change", "relative change"]
    assert table.iloc[2].tolist() == ["force", "FF", "mN", -50.0, -100.0, -50.0, -1.0]
    assert table["relative change"].iloc[3:].tolist() == [pytest.approx(0.1), 0.0]
    pairs = {"FF=PI": ("FF", "PI")}
    chosen = [select_variants({**each, "cases": []}, pairs, at) for at, each in enumerate((first, second))]
    assert [(each.metric, each.variant, each.first, each.second) for each in metric_changes(*chosen)] == [
        ("force", "FF=PI", -50.0, 110.0)
    ]
    assert MetricChange("m", "PI", "", 0.0, -2.0).relative == -INF
    difference = Difference("tip.position", "PI", 1, 0.002, 0.25, 1.0, "mm")
    html = Comparison(
        (difference,), ("a",), (), 0.0, (), changes, (VerdictChange("contact", "pass", "fail"),)
    )._repr_html_()
    assert html.startswith("<p>The runs differ: 1 of 1 signals")
    cells = re.findall("<td(?: style=.text-align: (left).)?>([^<]*)</td>", html)
    for text in ("force", "contact", "fail", "tip.position"):  # notebooks align text right
        assert ("left", text) in cells
    assert [text for _, text in cells if "%" in text] == ["25 %", "-100 %", "10 %", "0 %"]
    assert "<table" not in Comparison((), (), (), 0.0)._repr_html_()


def test_changes_have_the_units_of_the_tables() -> None:
    """Of N beside mN, in both runs, as in `Run.metrics`: the tables mixed them."""

    def of(force: float, error: float) -> dict[str, Any]:
        values = {"force": ("mN", force), "error": ("N", error)}
        return {
            "metrics": {
                name: {"unit": unit, "variants": {"PI": {"values": {"1": value}}}}
                for name, (unit, value) in values.items()
            }
        }

    changes = metric_changes(of(200.1, 0.03561), of(200.1, 0.03555))
    assert [(each.metric, each.unit, each.first, each.second) for each in changes] == [
        ("error", "mN", 35.61, 35.55),
        ("force", "mN", 200.1, 200.1),
    ]


def test_noise_around_zero_does_not_come_first() -> None:
    """A change within the spread of the seeds is the last, however large its ratio; verdicts: new failures first."""

    def of(zero: dict[str, float], rate: dict[str, float], *verdicts: str) -> dict[str, Any]:
        metrics = {"zero": {"unit": "N", "variants": {"PI": {"values": zero}}}}
        metrics["rate"] = {"unit": "1/min", "variants": {"PI": {"values": rate, "verdict": "pass"}}}
        return {
            "metrics": metrics,
            "expectations": [{"name": f"e{i}", "verdict": verdict} for i, verdict in enumerate(verdicts)],
        }

    first = of({"1": -0.01, "2": 0.011}, {"1": 60.0, "2": 60.1}, "pass", "pass", "fail")
    second = of({"1": 0.04, "2": -0.03}, {"1": 62.0, "2": 62.1}, "skipped", "fail", "fail")
    assert [each.metric for each in metric_changes(first, second)] == ["rate", "zero"]
    assert verdict_changes(first, second) == (("e1", "pass", "fail"), ("e0", "pass", "skipped"))


def test_metrics_that_differ_are_sorted_by_relative_difference() -> None:
    first, second = (
        {**summary(), "metrics": {name: summary(values={"1": value})["metrics"]["m"] for name, value in own.items()}}
        for own in ({"a": 1.0, "b": 1.0, "c": 1.0}, {"a": 1.1, "b": 3.0, "c": 1.2})
    )
    lines, _ = compare_summaries(first, second, 0.0, metrics=True, with_verdicts=True)
    assert [line.split()[1] for line in lines] == ["b", "c", "a"]


def test_entries_of_one_run() -> None:
    entries = list_missing("signal", {"a": 1, "b": 2}, {"b": 1, "c": 2, "d": 3})
    assert [(entry.run, entry.names) for entry in entries] == [("first", ("a",)), ("second", ("c", "d"))]
    assert entries[1].text(1) == "2 signals only in the second run: c and 1 more"
    assert missing_signals({"PI": ["a", "b"], "FF": ["a", "b"]}, {"PI": ["b"], "FF": ["b"]}) == [
        Missing("signal", "first", ("a",))
    ]
    assert missing_signals({"PI": ["a", "b"], "FF": ["a"]}, {"PI": ["b"], "FF": ["a"]}) == [
        Missing("signal", "first", ("a",), "PI")
    ]


@every_case(
    ("patterns", "selected"),
    [((), True), (("a.*",), True), (("b.*", "*.x"), True), (("b.*",), False), (("A.x",), False)],
)
def test_signals_are_chosen_by_patterns(patterns: tuple[str, ...], selected: bool) -> None:
    assert is_selected("a.x", patterns) is selected


def test_signals_are_read_in_groups_that_fit_into_memory() -> None:
    variables = {name: RecordedVariable(name, shape=shape) for name, shape in (("a", ()), ("b", (3,)), ("c", ()))}
    names = list(variables)
    assert list(batches(names, variables, 0)) == [names]
    assert list(batches([], variables, 5)) == []
    quarter = MAX_VALUES_IN_MEMORY // 4
    assert list(batches(names, variables, quarter)) == [["a", "b"], ["c"]]
    assert list(batches(names, variables, quarter - 1)) == [["a", "b", "c"]]
    assert list(batches(names, variables, MAX_VALUES_IN_MEMORY)) == [["a"], ["b"], ["c"]]


def test_the_largest_relative_difference_is_first() -> None:
    def entry(name: str, part: float, time: float, seed: int = 1, variant: str = "A") -> Difference:
        return Difference(name, variant, seed, part, part, time)

    late, early = entry("a", 0.5, 2.0), entry("b", 0.1, 1.0)
    larger = entry("c", 0.2, 1.0)
    same = [entry("d", 0.2, 1.0, 1, "B"), entry("d", 0.2, 1.0, 1), entry("d", 0.2, 1.0, 2)]
    within, equal, unknown = entry("e", 0.01, 0.5), entry("f", 0.0, 0.0), entry("g", NAN, 3.0)
    found = Comparison((late, early, larger, *same, within, equal, unknown), (), (), 0.01)
    assert found.differing == [unknown, late, larger, same[1], same[2], same[0], early]
    assert found.identical_count == 1
    assert list(found.signals["signal"]) == ["g", "a", "c", "d", "d", "d", "b", "e", "f"]
    assert list(found.signals) == ["signal", "variant", "seed", "unit", "difference", "relative difference", "from"]
    shown = Comparison((Difference("a", "PI", 1, 0.02, 0.5, 2.0, "mN"),), (), (), 0.01).signals
    assert shown.iloc[0].tolist() == ["a", "PI", 1, "mN", pytest.approx(20.0), 0.5, 2.0]
    assert list(Comparison((), (), (), 0.0).signals) == list(shown)
    assert not found.agrees
    assert Comparison((within, equal), (), ("a note",), 0.01).agrees
    assert not Comparison((within, equal), ("a problem",), (), 0.01).agrees
    alone = Comparison((within, equal), (), (), 0.01, (Missing("signal", "first", ("a", "b")),))
    assert not alone.agrees
    assert alone.headline == (
        "The runs differ: 0 of 2 signals (1 equal to the bit, 1 within 0.01), 2 signals only in the first."
    )
    assert found.largest == unknown
