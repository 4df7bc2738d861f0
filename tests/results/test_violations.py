"""Violations of expectations: which samples and cases, in which words."""

from __future__ import annotations

import numpy as np
import pytest

from tests.every_case import every_case
from twin.results import Expectation, Metric, Plot, PlotCurve, Signals, Window, evaluate
from twin.results.evaluation import expression, violations

S = 10**9
FORCE = expression.parse("s.force")
TIME = np.arange(5.0)
TABLES = {
    ("PI", 1): Signals(TIME, {"s.force": np.array([0.0, 3.0, 4.0, -2.0, 1.0])}, {"s.force": "N"}),
    ("PI", 2): Signals(TIME, {"s.force": np.array([0.0, 1.0, 2.0, 1.0, 0.5])}, {"s.force": "N"}),
    ("FF", 1): Signals(TIME, {"s.force": np.array([2.0, 2.0, 2.0, 2.0, -3.5])}, {"s.force": "N"}),
    ("off", 1): Signals(TIME, {"s.force": np.full(5, 99.0)}, {"s.force": "N"}, complete=False),
}


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (None, None, [False, False, False, False, True, True]),
        (0.0, None, [True, False, False, False, True, True]),
        (None, 1.0, [False, False, False, True, True, True]),
        (0.0, 1.0, [True, False, False, True, True, True]),
    ],
)
def test_limits_themselves_are_inside(low: float | None, high: float | None, expected: list[bool]) -> None:
    values = np.array([np.nextafter(0, -1), 0.0, 1.0, np.nextafter(1, 2), np.nan, np.inf])
    assert violations.is_outside(values, low, high).tolist() == expected


@every_case(
    ("mask", "spans"),
    [
        ("", []),
        ("...", []),
        ("x", [(0.0, 0.0)]),
        ("xxx", [(0.0, 2.0)]),
        (".xx.x", [(1.0, 2.0), (4.0, 4.0)]),
        ("x.xx.", [(0.0, 0.0), (2.0, 3.0)]),
    ],
)
def test_spans_go_from_the_first_to_the_last_failed_sample(mask: str, spans: list[tuple[float, float]]) -> None:
    failed = np.array([letter == "x" for letter in mask], bool)
    assert violations.consecutive_spans(np.arange(float(len(mask))), failed) == spans


def test_of_too_many_spans_the_nearest_are_merged() -> None:
    count = violations.MAX_SPANS
    time = np.arange(2.0 * count + 3)
    failed = np.arange(len(time)) % 2 == 0
    time[602:] -= 0.5  # samples 600 and 602 are nearer than any other two, except for 4 and 6
    time[6:] -= 0.75
    at_limit = violations.consecutive_spans(time[: 2 * count], failed[: 2 * count])
    assert at_limit == [(t, t) for t in time[: 2 * count : 2]]
    pair = (4.0, 5.25)
    above = violations.consecutive_spans(time[: 2 * count + 1], failed[: 2 * count + 1])
    assert above == [*at_limit[:2], pair, *at_limit[4:], (798.75, 798.75)]
    another = violations.consecutive_spans(time, failed)
    assert another == [*above[:299], (599.25, 600.75), *above[301:], (800.75, 800.75)]


def find(expectation: Expectation, metrics: dict[str, Metric] | None = None) -> list[violations.Violation]:
    return violations.find_violations([expectation], evaluate(metrics or {}, [expectation], TABLES), TABLES)


def test_every_sample_of_a_signal() -> None:
    window = Window(1 * S, 3 * S)
    (found,) = find(Expectation("", signal=FORCE, at_least=-1.0, at_most=2.0, unit="N", window=window))
    assert found == violations.Violation(
        "s.force from -1 N to 2 N",
        "s.force from -1 N to 2 N, from 1 s, to 3 s",
        FORCE,
        window,
        {("PI", 1): 1.0},
        "N",
        -1.0,
        2.0,
        worst={("PI", 1): 2.0},
    )
    assert found.start == (("PI", 1), 2.0)
    assert found.variants == ("PI",)
    assert found.limits == [-1.0, 2.0]
    assert not found.over_time
    value = TABLES["PI", 1].values["s.force"]
    assert found.violating_samples(("PI", 1), TIME, value).tolist() == [False, True, True, True, False]


def test_only_variants_of_the_expectation() -> None:
    assert find(Expectation("", signal=FORCE, at_most=3.0, variants=("FF",))) == []
    (found,) = find(Expectation("a name", signal=FORCE, at_least=-3.0, variants=("FF",)))
    assert (found.name, found.cases, found.limits) == ("a name", {("FF", 1): 4.0}, [-3.0])


@pytest.mark.parametrize(
    ("reduce", "samples", "limits"),
    [
        ("max", {("PI", 1): [1.0, 2.0]}, [2.5]),
        ("max_abs", {("PI", 1): [1.0, 2.0], ("FF", 1): [4.0]}, [-2.5, 2.5]),
        ("final", {("FF", 1): [4.0]}, [-2.5, 2.5]),
        ("mean", {}, []),
        ("peak_to_peak", {("PI", 1): [], ("FF", 1): []}, []),
    ],
)
def test_all_samples_that_the_limit_of_an_extreme_excludes(
    reduce: str, samples: dict[tuple[str, int], list[float]], limits: list[float]
) -> None:
    metrics = {"m": Metric("m", FORCE, reduce, unit="N")}
    found = find(Expectation("", "m", at_least=-2.5 if reduce == "final" else None, at_most=2.5), metrics)
    if not samples:
        assert found == []
        return
    (violation,) = found
    assert (violation.limits, violation.unit, violation.metric) == (limits, "N", "m")
    assert f"; {reduce.replace('_', ' ')} of s.force" in violation.text
    assert violation.over_time is (reduce == "peak_to_peak")
    assert list(violation.cases) == list(samples)
    for case, times in samples.items():
        mask = violation.violating_samples(case, TIME, TABLES[case].values["s.force"])
        assert TIME[mask].tolist() == times
    if reduce.startswith("max"):
        assert violation.start == (("PI", 1), 2.0)  # the worst sample, not the first one


def test_an_extreme_that_no_limit_of_a_sample_explains_is_one_sample() -> None:
    (found,) = find(Expectation("", "m", at_least=4.5, variants=("PI",)), {"m": Metric("m", FORCE, "max")})
    assert (found.cases, found.reduce) == ({("PI", 1): 2.0, ("PI", 2): 2.0}, "max")


def test_a_failed_extreme_has_the_time_of_its_worst_and_of_its_first_sample() -> None:
    limit = Expectation("force", "m", at_most=2.5, unit="N")
    result = evaluate({"m": Metric("m", FORCE, "max_abs", unit="N")}, [limit], TABLES).expectation_results[0]
    assert result.detail.startswith("4 N at 2 s in PI, seed 1, expected at most 2.5 N; first at 1 s; fails in")


def test_least_and_last_samples() -> None:
    metrics = {name: Metric(name, FORCE, name, Window(1 * S, None)) for name in ("min", "final")}
    (least,) = find(Expectation("", "min", at_least=0.75), metrics)
    assert least.cases == {("PI", 1): 3.0, ("PI", 2): 4.0, ("FF", 1): 4.0}
    assert least.text == "min at least 0.75; min of s.force, from 1 s"
    (last,) = find(Expectation("", "final", at_least=0.75), metrics)
    assert last.cases == {("PI", 2): 4.0, ("FF", 1): 4.0}


def test_an_order_concerns_the_later_variant_and_a_mean_all_cases() -> None:
    metrics = {"m": Metric("m", FORCE, "max", unit="N")}
    (order,) = find(Expectation("", "m", ordered=("FF", "PI")), metrics)
    assert order.name == "m: FF > PI"
    assert order.text == "m: FF > PI; max of s.force"
    assert order.cases == {("PI", 1): 2.0, ("PI", 2): 2.0}  # FF comes before it and sets its limit
    (rising,) = find(Expectation("named", "m", ordered=("PI", "FF"), descending=False), metrics)
    assert (rising.name, rising.text) == ("named", "m: PI < FF; max of s.force")
    (mean,) = find(Expectation("", "m", mean=True, at_most=2.5), metrics)
    assert mean.cases == {**order.cases, ("FF", 1): 0.0}
    assert find(Expectation("", "m", mean=True, at_most=2.75), metrics) == []


def test_an_order_concerns_the_variants_beyond_the_one_before() -> None:
    tables = {
        (name, 1): Signals(TIME, {"s.force": np.full(5, value)}) for name, value in (("A", 3.0), ("B", 4.0), ("C", 1.0))
    }
    metrics, order = {"m": Metric("m", FORCE, "max")}, Expectation("", "m", ordered=("A", "B", "C"))
    (found,) = violations.find_violations([order], evaluate(metrics, [order], tables), tables)
    assert (found.variants, found.metric) == (("B",), "m")


def test_a_plot_shows_a_violating_sample() -> None:
    (samples,) = find(Expectation("", signal=FORCE, at_most=3.5))

    def shown(violation: violations.Violation, text: str = "s.force", **plot: object) -> bool:
        x = plot.pop("x", None)
        curves = (PlotCurve(expression.parse(text), "", x),)  # type: ignore[arg-type]
        return violation.is_shown_in(Plot("", curves, **plot), TABLES)  # type: ignore[arg-type]

    assert shown(samples)
    assert shown(samples, " s.force ")
    assert not shown(samples, "abs(s.force)")
    assert not shown(samples, x=expression.parse("s.x"))
    assert shown(samples, window=Window(2 * S, None))
    assert not shown(samples, window=Window(3 * S, None))
    assert not shown(samples, variants=("FF",))
    assert shown(samples, variants=("FF", "PI"))


def test_a_selected_sample_outside_of_the_shown_time() -> None:
    violation = violations.Violation("", "", FORCE, Window(), {("PI", 1): 2.0, ("PI", 2): None}, reduce="max")

    def samples(case: int, *times: float) -> list[bool]:
        return violation.violating_samples(("PI", case), np.array(times), np.zeros(len(times))).tolist()  # type: ignore[no-any-return]

    assert samples(1, 2.0, 3.0) == [True, False]
    assert samples(1, 1.0, 2.0) == [False, True]
    assert samples(1, 1.5, 2.25, 3.0) == [False, True, False]
    assert samples(1, 2.5, 3.0) == [False, False]
    assert samples(1, 0.0, 1.5) == [False, False]
    assert samples(1) == []
    assert samples(2, 1.0, 2.0) == [False, False]
