"""Expressions, reductions and verdicts, against numpy.

Over 400 lines: one small recording serves all of them.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.every_case import every_case
from twin.errors import ScenarioError
from twin.results import (
    Expectation,
    HardwareTermination,
    Metric,
    MetricFormat,
    Plot,
    Signals,
    Window,
    evaluate,
    format_value,
)
from twin.results.evaluation import expression
from twin.results.evaluation.limit_failures import time_text
from twin.results.evaluation.reduction import REDUCTIONS
from twin.run.report import metric_rows

TIME = np.arange(1001) * 0.01
FORCE = 0.2 + 0.05 * np.sin(TIME)
X = np.stack([TIME, -TIME, TIME**2], 1)


def signals(scale: float = 1.0, *, complete: bool = True) -> Signals:
    values = {"a.force": 0.2 + scale * (FORCE - 0.2), "a.x": X * 1000, "a.count": np.arange(1001), "a.on": TIME > 5}
    return Signals(TIME, values, {"a.force": "N", "a.x": "mm"}, complete)


def metric(text: str = "a.force", reduce: str = "std", **options: object) -> Metric:
    return Metric("m", expression.parse(text), reduce, **options)  # type: ignore[arg-type]


@every_case(
    ("text", "expected"),
    [
        ("a.force", FORCE),
        ("-a.force + 0.2", 0.2 - FORCE),
        ("abs(a.force - 0.2) * 2 / 4", np.abs(FORCE - 0.2) / 2),
        ("a.x[2]", -TIME),
        ("norm(a.x)", np.linalg.norm(X, axis=1)),
        ("max(a.x[1], a.x[3], 2)", np.maximum(np.maximum(TIME, TIME**2), 2)),
        ("min(a.force, 0.2)", np.minimum(FORCE, 0.2)),
        ("sqrt(a.force) ** 2", FORCE),
        ("a.count * 1e-3", np.arange(1001) * 1e-3),
        ("a.on", TIME > 5),
        ("0.5", np.full(1001, 0.5)),
    ],
)
def test_expressions(text: str, expected: np.ndarray) -> None:
    found = signals().evaluate(expression.parse(text))
    assert found is not None
    np.testing.assert_allclose(found[1], expected, rtol=1e-12, atol=1e-15)


@every_case(
    ("text", "expected"),
    [
        ("force", "cannot be used"),
        ("a.b; c", "is not an expression. Use names"),
        ("abs(a.b", "is not an expression: '(' was never closed. Use names"),
        ("__import__('os').system('x')", "cannot be used"),
        ("f('os').system", "is not a signal"),
        ("a.b()", "cannot be used"),
        ("a.b if a.c else a.d", "cannot be used"),
        ("[a.b for x in a.c]", "cannot be used"),
        ("a.x[0]", "counted from 1"),
        ("a.x[1:2]", "counted from 1"),
        ("a.x[True]", "counted from 1"),
        ("a.x[1, 0]", "counted from 1"),
        ("a.x[1, b.c]", "counted from 1"),
        ("min(a.b)", "takes two or more arguments, not 1"),
        ("max(a.b)", "takes two or more arguments, not 1"),
        *((f"{name}()", f"{name} takes one argument, not 0") for name in ("abs", "sqrt", "norm")),
        *((f"{name}(a.b, a.c)", f"{name} takes one argument, not 2") for name in ("abs", "sqrt", "norm")),
        ("abs(x=a.b)", "cannot be used"),
        ("'a'", "cannot be used"),
        ("a.b < 1", "cannot be used"),
        ("True", "cannot be used"),
        ("a.count - 9007199254740993", "`9007199254740993` has more digits than the 15 to 17 of a number here"),
        (f"a.force + {'9' * 320}", "`99999999999999999999...` has more digits than"),
        ("", "expected an expression"),
        ("(" * 300, "is not an expression"),
        ("a.b+" * 200 + "1", "is too long"),
        ("x" * 401, "is too long"),
    ],
)
def test_what_is_no_expression(text: str, expected: str) -> None:
    with pytest.raises(ScenarioError, match=r".") as caught:
        expression.parse(text)
    assert expected in str(caught.value)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.text("ab.x[]()+-*/ 0123,'", max_size=40) | st.text(max_size=20))
def test_any_text_is_an_expression_or_says_why(text: str) -> None:
    try:
        parsed = expression.parse(text)
    except ScenarioError:
        return
    parsed_signals = {signal.name: FORCE for signal in parsed.signals if not signal.index}
    Signals(TIME, parsed_signals).evaluate(parsed)


def test_names_in_expressions() -> None:
    parsed = expression.parse("a.b.c[1,2] - d.e + d.e")
    assert [str(signal) for signal in parsed.signals] == ["a.b.c[1,2]", "d.e"]
    assert parsed.single is None
    assert str(expression.parse(" a.x[3]").single) == "a.x[3]"


EXPECTED = {
    "mean": np.mean,
    "std": np.std,
    "min": np.min,
    "max": np.max,
    "peak_to_peak": np.ptp,
    "final": lambda x: x[-1],
    "max_abs": lambda x: np.abs(x).max(),
    "rms": lambda x: np.sqrt((x**2).mean()),
}


@every_case("reduce", REDUCTIONS)
def test_reductions(reduce: str) -> None:
    window = Window(4 * 10**9, 7 * 10**9)
    (figure,) = evaluate({"m": metric(reduce=reduce, window=window)}, [], {("A", 1): signals()}).metric_results
    assert figure.values[1] == pytest.approx(EXPECTED[reduce](FORCE[400:701]), rel=1e-14)


def test_windows_include_both_ends() -> None:
    found = signals().evaluate(expression.parse("a.force"), Window(4 * 10**9, 4 * 10**9))
    assert found is not None
    assert found[0].tolist() == [4.0]


def tables(*scales: float) -> dict[tuple[str, int], Signals]:
    return {
        (name, seed): signals(scale * (1 + 0.1 * seed))
        for name, scale in zip("ABC", scales, strict=False)
        for seed in (0, 1)
    }


STD = float(np.std(FORCE))


@every_case(
    ("paper", "tolerance", "applies", "verdict"),
    [
        ({"A": STD}, 0.2, True, "pass"),
        ({"A": STD}, 0.01, True, "fail"),
        ({"A": STD}, 0.01, False, "other"),
        ({"A": STD}, None, True, "info"),
        ({}, None, True, "info"),
        ({"B": STD}, 0.1, True, "info"),
    ],
)
def test_verdicts(paper: dict[str, float], tolerance: float | None, applies: bool, verdict: str) -> None:
    evaluation = evaluate({"m": metric(paper=paper, tolerance=tolerance)}, [], tables(1.0), applies)
    (figure,) = evaluation.metric_results
    assert figure.verdict == verdict
    assert evaluation.passed is (verdict != "fail")
    assert figure.mean == pytest.approx(1.05 * STD)
    assert figure.worst == pytest.approx(1.1 * STD)
    if "A" in paper:
        assert figure.ratio == pytest.approx(1.05)


def test_a_decimal_tolerance_is_kept_to_the_last_digit() -> None:
    constant = {("A", 1): Signals(TIME, {"a.force": np.full(1001, 0.12)})}
    (figure,) = evaluate({"m": metric(reduce="mean", paper={"A": 0.1}, tolerance=0.2)}, [], constant).metric_results
    assert figure.verdict == "pass"


def test_no_number_fails_and_a_signal_of_another_variant_is_left_out() -> None:
    broken = {("A", 1): Signals(TIME, {"a.force": np.full(1001, np.nan)}), ("B", 1): Signals(TIME, {"b.x": FORCE})}
    evaluation = evaluate({"m": metric()}, [], broken)
    assert [(figure.variant, figure.verdict, figure.mean) for figure in evaluation.metric_results] == [
        ("A", "none", None)
    ]
    assert not evaluation.passed


def test_a_metric_of_some_variants() -> None:
    evaluation = evaluate({"m": metric(variants=("B",))}, [], tables(1.0, 0.5))
    assert [figure.variant for figure in evaluation.metric_results] == ["B"]


def test_a_failure_is_one_line_and_the_rest_is_apart() -> None:
    """The worst sample with its time and case, then the first violation; the worst of each run is left out."""
    force = expression.parse("a.force")
    (found,) = evaluate(
        {}, [Expectation("safe", signal=force, at_most=0.1, unit="N")], tables(1.0, 0.5)
    ).expectation_results
    assert found.detail == (
        "0.255 N at 1.57 s in A, seed 1, expected at most 0.1 N; first at 0 s in A, seed 0; fails in all variants, all seeds."
    )
    assert found.more == "Judged: a.force."
    assert found.cases[:2] == (("A", 1, "0.255 N", "1.57 s"), ("A", 0, "0.25 N", "1.57 s"))  # a list in the report
    cases = {(name, seed): signals(1.0 + 0.1 * (ord(name) - 64 == seed)) for name in "ABC" for seed in (1, 2, 3)}
    limit = Expectation("safe", signal=force, at_most=0.252, variants=("A", "B", "C"), unit="N")
    (found,) = evaluate({}, [limit], cases | {("D", 1): signals()}).expectation_results
    assert (
        found.detail
        == "0.255 N at 1.57 s in A, seed 1, expected at most 0.252 N; first at 1.24 s; fails in 3 of 10 runs."
    )
    assert (found.more.removeprefix("Judged: a.force. "), found.cases[-1][:2]) == (
        "Judged in 3 of 4 variants, all but D.",
        ("C", 3),
    )
    fifty = {("A", seed): signals(1.1) for seed in range(7)} | {("B", 1): signals()}
    (found,) = evaluate({}, [limit], fifty).expectation_results
    assert (found.detail.rpartition("; ")[2], len(found.cases)) == ("fails in A, all seeds.", 7)


def test_a_value_of_a_window_has_the_window_as_its_time() -> None:
    """The first rows have the result of the first window: `at 0 s` was the time of a window that ends at 22 s."""
    values = {"w.std": np.array([3.0, 3.0, 3.0, 2.0])}
    recorded = Signals(np.array([0.0, 10.0, 22.0, 23.0]), values, {"w.std": "N"}, window_lengths={"w.std": 10.0})
    windows = expression.parse("w.std")
    limits = [Expectation("m", "m", at_most=1.0, unit="N"), Expectation("s", signal=windows, at_most=1.0, unit="N")]
    outcomes = evaluate({"m": Metric("m", windows, "max", unit="N")}, limits, {("A", 1): recorded}).expectation_results
    assert [each.detail for each in outcomes] == ["3 N in 12 s to 22 s, expected at most 1 N."] * 2
    assert time_text(21.995, 10.0) == " in 12 s to 22 s"  # of rows every 5 ms, the first one at 12 s


def test_all_pairs_out_of_order_are_named() -> None:
    cases = {(name, 1): signals(size) for name, size in (("A", 1.0), ("B", 2.0), ("C", 3.0))}
    order = Expectation("o", metric="m", ordered=("A", "B", "C"), unit="N")
    (found,) = evaluate({"m": Metric("m", expression.parse("a.force"), "max")}, [order], cases).expectation_results
    assert re.fullmatch(
        r"(.*) N in B, expected below (.*) N \(A\), and (.*) N in C, expected below \1 N \(B\)\.", found.detail
    )


def test_what_did_not_finish_is_left_out() -> None:
    evaluation = evaluate({"m": metric()}, [], {("A", 1): signals(complete=False), ("B", 1): signals()})
    assert [figure.variant for figure in evaluation.metric_results] == ["B"]


@every_case(
    ("expectation", "verdict", "detail"),
    [
        (Expectation("", metric="m", ordered=("A", "B", "C")), "pass", "m: A 0.03495 N > B 0.01748 N > C 0.00350 N."),
        (Expectation("", metric="m", ordered=("B", "A"), descending=False), "pass", "m: B 0.01748 N < A 0.03495 N."),
        (Expectation("", metric="m", ordered=("B", "A")), "fail", "0.03495 N in A, expected below 0.01748 N (B); all seeds."),
        (Expectation("", metric="m", ordered=("A", "B"), margin_part=0.49), "pass", "m: A 0.03495 N > B 0.01748 N (required margin: 49 %)."),
        (Expectation("", metric="m", ordered=("A", "B"), margin_part=0.51), "fail", "0.01748 N in B, expected at most 0.01713 N (A 0.03495 N less 51 %); all seeds."),
        (Expectation("", metric="m", ordered=("A", "B"), margin=0.53 * STD), "fail", "0.01748 N in B, expected at most 0.01731 N (A 0.03495 N less 0.01764 N); seed 0."),
        (Expectation("", metric="m", ordered=("A", "X")), "skipped", "Not judged: an order needs at least two of A and X; only A has m in this run."),
        (Expectation("", metric="m", at_most=0.035), "fail", f"standard deviation {format_value(1.1 * STD, 'N')} in 0 s to 10 s in A, seed 1."),
        (Expectation("", metric="m", at_most=0.035, variants=("B",)), "pass", f"m was {format_value(0.5 * STD, 'N')} to {format_value(0.55 * STD, 'N')}; expected at most"),
        (Expectation("", metric="m", at_most=1.06 * STD, variants=("A",), mean=True), "pass", f"m was {format_value(1.05 * STD, 'N')}; expected"),
        (Expectation("named", metric="m", at_most=0.03, variants=("A",), mean=True), "fail", f"{format_value(1.05 * STD, 'N')}, the mean of all runs, expected at most 0.03 N."),
        (Expectation("", metric="m", at_least=1.0), "fail", f"standard deviation {format_value(0.1 * STD, 'N')} in 0 s to 10 s in C, seed 0; fails in all variants, all seeds."),
        (Expectation("named", metric="m", at_most=1.06 * STD), "fail", f"standard deviation {format_value(1.1 * STD, 'N')} in 0 s to 10 s in A, seed 1, expected at most {format_value(1.06 * STD, 'N')}."),
        (Expectation("", signal=expression.parse("a.force"), at_least=0.1, at_most=0.3), "pass", "a.force was 0.145 N to 0.255 N"),
        (Expectation("", signal=expression.parse("a.force"), at_least=0.1, at_most=0.25), "fail", "0.255 N at 1.57 s in A, seed 1; first at 1.15 s."),
        (Expectation("named", signal=expression.parse("a.force"), at_least=0.16, at_most=0.24), "fail",
         "0.145 N at 4.71 s and 0.255 N at 1.57 s in A, seed 1, expected 0.16 N to 0.24 N; first at 0.82 s; fails in A, all seeds."),
        (Expectation("", signal=expression.parse("a.nothing"), at_least=0.1), "skipped", "Not judged: this run has no complete case with a.nothing."),
    ],
)  # fmt: skip
def test_expectations(expectation: Expectation, verdict: str, detail: str) -> None:

    evaluation = evaluate({"m": metric(unit="N")}, [replace(expectation, unit="N")], tables(1.0, 0.5, 0.1))
    (outcome,) = evaluation.expectation_results
    assert outcome.verdict == verdict
    assert outcome.detail.startswith(detail), outcome.detail
    assert evaluation.passed is (verdict != "fail")


@pytest.mark.parametrize(
    ("text", "window", "detail"),
    [
        ("a.x", Window(), "a.x is no single value in A, seed 0; expected at most 1 N. Name its elements."),
        ("a.x + a.force", Window(), "a.x + a.force is no single value in A, seed 0;"),
        (
            "a.force",
            Window(4_001_000_000, 4_009_000_000),
            "a.force has no sample from 4.001 s to 4.009 s in A, seed 0;",
        ),
    ],
)
def test_what_judges_no_sample_fails(text: str, window: Window, detail: str) -> None:
    """Neither an expectation of a signal nor a metric and what is expected of it."""
    signal = expression.parse(text)
    found = evaluate(
        {"m": metric(text, window=window)},
        [
            Expectation("", signal=signal, at_most=1.0, window=window, unit="N"),
            Expectation("", metric="m", at_most=1.0),
            Expectation("", metric="m", at_most=1.0, mean=True),
            Expectation("", metric="m", ordered=("A", "B")),
        ],
        tables(1.0, 0.5),
    )
    assert [one.verdict for one in found.expectation_results] == ["fail"] * 4
    assert found.expectation_results[0].detail.startswith(detail), found.expectation_results[0].detail
    assert [one.verdict for one in found.metric_results] == ["none", "none"]


@pytest.mark.parametrize(("stop", "limit", "verdict"), [(10, 0.3, "pass"), (11, 0.3, "skipped"), (11, 0.2, "fail")])
def test_a_run_that_ends_before_the_window_does_not_pass(stop: int, limit: float, verdict: str) -> None:
    """A limit for ten minutes is not met after one; what is broken stays broken."""
    window = Window(0, stop * 10**9)
    expected = [
        Expectation("", signal=expression.parse("a.force"), at_most=limit, window=window, unit="N"),
        Expectation("", metric="m", at_most=limit),
    ]
    found = evaluate({"m": metric(reduce="max", window=window)}, expected, {("A", 1): signals()}).expectation_results
    assert [result.verdict for result in found] == [verdict, verdict]
    cut = "Not judged: the run of A, seed 1, ends at 10 s, before its window ends at 11 s."
    assert [result.detail == cut for result in found] == [verdict == "skipped"] * 2


def test_a_window_after_the_end_of_all_runs_is_not_judged() -> None:
    """As with `--set stop_time`; but a run that drives stopped fails."""
    window = Window(11 * 10**9)
    expected = [Expectation("", signal=expression.parse("a.force"), at_most=1.0, window=window, unit="N")]
    expected += [Expectation("", metric="m", at_most=1.0)]
    case = {("A", 1): signals()}
    found = evaluate({"m": metric(window=window)}, expected, case)
    assert {result.detail for result in found.expectation_results} == {
        "Not judged: the run ends at 10 s, before the window begins at 11 s."
    }
    assert [result.verdict for result in found.metric_results] == ["cut"]
    stop = {("A", 1): HardwareTermination(10**10, "fault")}
    failed = evaluate({"m": metric(window=window)}, expected, case, terminations=stop)
    assert [result.verdict for result in failed.expectation_results] == ["fail", "fail"]


def test_one_case_without_a_sample_fails() -> None:
    """A variant that is shorter than the others: what is expected at the end is not known of it."""
    short = Signals(TIME[:500], {"a.force": FORCE[:500]}, {"a.force": "N"})
    late = Expectation("", signal=expression.parse("a.force"), at_most=1.0, window=Window(6 * 10**9))
    (outcome,) = evaluate({}, [late], {("A", 1): signals(), ("B", 1): short}).expectation_results
    assert outcome.verdict == "fail"
    assert "in B, seed 1" in outcome.detail


@settings(max_examples=200, deadline=None)
@given(
    st.recursive(
        st.sampled_from(["a.n", "a.v", "a.w", "a.m", "a.v[2]", "a.m[2,1]", "2"]),
        lambda inner: (
            st.builds("({} {} {})".format, inner, st.sampled_from("+*-/"), inner)
            | st.builds("{}({})".format, st.sampled_from(["norm", "abs", "-"]), inner)
            | st.builds("max({}, {})".format, inner, inner)
        ),
        max_leaves=6,
    )
)
def test_the_shape_of_an_expression_is_that_of_its_value(text: str) -> None:
    """What the check knows of an expression is what comes out after the run; what it refuses has no meaning."""
    parsed = expression.parse(text)
    shapes: dict[str, tuple[int, ...]] = {"a.n": (), "a.v": (3,), "a.w": (2,), "a.m": (2, 3)}
    try:
        expected = parsed.shape(shapes)
    except ScenarioError:
        assert "expected equal shapes. Name one of" in parsed.array_problem(shapes)
        return
    value = parsed.evaluate({name: np.ones((7, *shape)) for name, shape in shapes.items()})
    assert np.shape(value) in ((7, *expected), expected)
    assert bool(expected) == bool(parsed.array_problem(shapes))


def test_nan_breaks_a_limit() -> None:
    broken = {("A", 1): Signals(TIME, {"a.force": np.where(TIME > 3, np.nan, 0.2)})}
    (outcome,) = evaluate(
        {}, [Expectation("", signal=expression.parse("a.force"), at_most=1.0)], broken
    ).expectation_results
    assert outcome.verdict == "fail"


@every_case("limits", [{"at_least": 0.0}, {"at_most": 1.0}, {"at_least": 0.0, "at_most": 1.0}])
@every_case("value", [np.inf, -np.inf, np.nan])
def test_what_is_not_finite_passes_no_limit(limits: dict[str, float], value: float) -> None:
    force = np.where(np.arange(1001) == 300, value, 0.2)
    (outcome,) = evaluate(
        {},
        [Expectation("", signal=expression.parse("a.force"), **limits)],
        {("A", 1): Signals(TIME, {"a.force": force})},
    ).expectation_results
    assert outcome.verdict == "fail"
    assert outcome.detail == f"{'not a number' if np.isnan(value) else value} at 3 s."


def test_shown() -> None:
    assert (format_value(1.0, "1/min"), format_value(2.0, "1/(N*s)")) == ("60 /min", "2 /(N*s)")
    assert MetricFormat("1/min").number(1.0) == "60"
    assert [format_value(0.0362, "N"), format_value(0.0362, "mN"), format_value(None, "N"), format_value(2.0, "")] == [
        "0.0362 N",
        "36.2 mN",
        "-",
        "2",
    ]


@every_case(
    ("text", "reduce", "scale", "expected"),
    [
        ("a.x", "mean", 1e-2, "0 mm"),
        ("a.x - a.y", "max_abs", 1.0, "0 mm"),
        ("0.1 * a.k * a.x", "mean", 1e6, "0 mm"),
        ("a.y * 1e-15", "max", 1.0, "1e-12 mm"),
        ("a.y - a.x / 2", "final", 1.0, "250 mm"),
        ("a.k", "std", 1.0, "0 mm"),
    ],
)
def test_what_rounding_leaves_of_zero_is_shown_as_zero(text: str, reduce: str, scale: float, expected: str) -> None:
    """Small beside the numbers it is made of, that is; a small number stays."""
    x = scale * np.sin(2 * np.pi * np.arange(10_001) / 10_000)
    x[-1] = scale / 2
    x[0] = -x[-1]
    values = {"a.x": x, "a.y": x + np.where(np.arange(10_001) == 10_000, 0, np.spacing(x)), "a.k": np.full(10_001, 0.1)}
    if "1e-15" in text:
        values["a.y"] = np.full(10_001, scale)
    cases = {("A", 1): Signals(np.arange(10_001) * 1e-3, values, {})}
    limit = Expectation("", metric="m", at_most=1.0, unit="mm")
    found = evaluate({"m": metric(text, reduce, unit="mm")}, [limit], cases)
    assert metric_rows(found.metric_results)[0]["mean"] == expected
    assert metric_rows(found.metric_results)[0]["mean"] == expected
    assert found.expectation_results[0].detail.startswith(f"m was {expected};")


def test_a_value_alone_is_as_small_as_it_is() -> None:
    """Without the size of the numbers that it is made of."""
    plot = Plot("", (), unit="mm")
    for shown in (metric(unit="mm").shown, Expectation("", "m", unit="mm").shown, plot.shown):
        assert shown(1e-18) == "1e-15 mm"
    assert [item.shown(1e-18, 1.0) for item in (metric(unit="mm"), Expectation("", "m", unit="mm"))] == ["0 mm"] * 2


def test_zero_in_a_unit_with_an_offset() -> None:
    assert format_value(273.15 + 1e-13, "degC") == "0 degC"


def test_a_unit_that_nobody_knows_stays_as_it_is() -> None:
    odd = Signals(TIME, {"a.force": FORCE}, {"a.force": "furlong/parsnip"})
    found = odd.evaluate(expression.parse("a.force"))
    assert found is not None
    assert found[1].tolist() == FORCE.tolist()


def test_what_holds_for_the_file_s_own_parameters_is_skipped_with_others() -> None:
    expectation = Expectation("", signal=expression.parse("a.x"), at_most=-1.0, nominal=True)
    tables = {("A", 0): Signals(np.arange(3.0), {"a.x": np.ones(3)})}
    failed, skipped = (evaluate({}, [expectation], tables, applies).expectation_results[0] for applies in (True, False))
    assert (failed.verdict, skipped.verdict) == ("fail", "skipped")
    assert (failed.is_outside, skipped.is_outside) == (False, True)
    assert skipped.detail.startswith(
        "Outside of its limits for nominal values: 1 at 0 s"
    )  # its value, though not judged
    (held,) = evaluate({}, [replace(expectation, at_most=2.0)], tables, False).expectation_results
    assert (held.verdict, held.is_outside) == ("skipped", False)
    assert held.detail.startswith("a.x was 1; expected at most 2. Not judged: ")


@every_case(
    ("values", "options", "verdict"),
    [
        ((2.0, 1.0), {}, "pass"),
        ((1.0, 1.0), {}, "fail"),
        ((2.0, 1.0), {"margin": 1.0}, "pass"),
        ((2.0, 1.0), {"margin": 1.25}, "fail"),
        ((2.0, 1.0), {"margin_part": 0.5}, "pass"),
        ((1.0, 2.0), {"margin": -1.0}, "pass"),
    ],
)
def test_a_margin_may_be_reached_exactly(values: tuple[float, float], options: dict[str, float], verdict: str) -> None:
    """Without one, equal values are in no order."""
    tables = {
        (name, 0): Signals(TIME, {"a.force": 0.0 * TIME + value}) for name, value in zip("AB", values, strict=True)
    }
    order = Expectation("", metric="m", ordered=("A", "B"), **options)  # type: ignore[arg-type]
    (found,) = evaluate({"m": metric(reduce="mean")}, [order], tables).expectation_results
    assert found.verdict == verdict


def test_no_power_of_ten_in_a_milli_unit() -> None:
    """Except where the unit stands in the heading of a column."""
    assert [format_value(value, "mN") for value in (18.08, 0.2, -10.0)] == ["18.08 N", "200 mN", "-10 N"]
    assert format_value(18.08, "mN", keeps_unit=True) == "1.808e+04 mN"
    assert MetricFormat("mN").number(18.08) == "1.808e+04"
