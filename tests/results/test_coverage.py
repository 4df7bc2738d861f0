"""What a run leaves unjudged: variants that no expectation names, and windows after its end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin.results import Expectation, Metric, Signals, Window, evaluate
from twin.results.evaluation import expression
from twin.results.evaluation.coverage import group_lines, list_names

FORCE = expression.parse("wall.force")
LIMIT = Expectation("clinical range", signal=FORCE, at_most=0.4, variants=("PI", "FF"), unit="N")
S = 10**9


def tables(*variants: str, samples: int = 11) -> dict[tuple[str, int], Signals]:
    time = np.arange(samples) * 1.0
    return {(variant, 1): Signals(time, {"wall.force": time / 100}, {"wall.force": "N"}) for variant in variants}


def test_a_verdict_names_the_variants_that_it_judged() -> None:
    run = tables("PI", "FF", "mine")
    found = evaluate({}, [LIMIT, replace(LIMIT, variants=())], run)
    detail = "wall.force was 0 N to 0.1 N; expected at most 0.4 N."
    assert [(each.detail, each.more) for each in found.expectation_results] == [
        (detail, "Judged in 2 of 3 variants, all but mine."),
        (detail, ""),
    ]
    many = evaluate({}, [replace(LIMIT, variants=("a0",))], tables(*(f"a{i}" for i in range(9))))
    assert many.expectation_results[0].more == "Judged in 1 of 9 variants: a0."


def test_names_with_commas_are_quoted_and_many_are_counted() -> None:
    assert list_names(["PI"]) == "PI"
    assert list_names(["PI", "FF", "BW"]) == "PI, FF and BW"
    assert list_names(["PI+FF, replayed", "PI"]) == '"PI+FF, replayed" and "PI"'
    assert list_names([f"a{i}" for i in range(9)]) == "a0, a1, a2, a3, a4, a5 and 3 more"
    assert list_names([]) == ""
    limit = replace(LIMIT, variants=("PI, replayed",), at_least=0.02)
    (result,) = evaluate({}, [limit], tables("FF", "PI, replayed")).expectation_results
    assert result.detail == '0 N at 0 s in "PI, replayed", expected 0.02 N to 0.4 N.'
    assert result.more == 'Judged: wall.force. Judged in 1 of 2 variants: "PI, replayed".'


def test_lines_of_several_cases_are_one() -> None:
    cases = [(variant, seed) for variant in ("PI", "PI, mine") for seed in (1, 2, 3)]
    same = [f"{variant}, seed {seed}: force is high" for variant, seed in cases]
    assert group_lines(same, cases) == ["all variants, all seeds: force is high"]
    assert group_lines([*same[:3], "PI, mine, seed 2: late", *same[3:5], "step"], cases) == [
        "PI, all seeds; PI, mine, seeds 1-2: force is high".replace("PI, mine", '"PI, mine"'),
        "PI, mine, seed 2: late",
        "step",
    ]
    assert group_lines(["PI, seed 1: a", "PI, seed 1: a"], [("PI", 1)]) == ["PI, seed 1: a"]


def test_equal_limits_are_one_number() -> None:
    limit = Expectation("", signal=FORCE, at_least=0.1, at_most=0.1, unit="N")
    result, named = evaluate({}, [limit, replace(limit, name="exact")], tables("PI")).expectation_results
    assert named.detail.endswith("expected exactly 0.1 N.")
    assert result.name == "wall.force from 0.1 N to 0.1 N"  # recorded


@pytest.mark.parametrize(
    ("expectations", "sentences"),
    [
        ([LIMIT], ["No requirement judges mine."]),
        (
            [LIMIT, Expectation("late", ends="completed")],
            [
                'mine is not judged by "clinical range". Name it in the variants of that requirement, or add a requirement.'
            ],
        ),
        ([LIMIT, Expectation("other", signal=FORCE, at_most=0.5)], []),  # another limit of the same signal
        ([replace(LIMIT, excluded=("mine",)), Expectation("", ends="completed")], []),
        ([replace(LIMIT, variants=("PI",)), Expectation("", ends="completed")], []),  # a limit of one variant
        (
            [replace(LIMIT, variants=("PI",), unlisted=("mine",)), Expectation("", ends="completed")],
            [
                'mine is not judged by "clinical range". Name it in the variants of that requirement, or add a requirement.'
            ],
        ),
    ],
)
def test_a_variant_that_escapes_an_expectation_is_named(expectations: list[Expectation], sentences: list[str]) -> None:
    assert list(evaluate({}, expectations, tables("PI", "FF", "mine")).unjudged) == sentences


def test_a_metric_whose_window_a_run_does_not_reach_is_not_compared() -> None:
    """A mean of half the window says nothing of the paper's figure."""
    metric = Metric("m", FORCE, "mean", Window(0, 20 * S), "N", {"PI": 0.05}, 0.2)
    assert [
        evaluate({"m": metric}, [], tables("PI", samples=samples)).metric_results[0].verdict for samples in (11, 21)
    ] == ["cut", "fail"]
    alone = replace(metric, paper={}, tolerance=None)
    assert [
        evaluate({"m": alone}, [], tables("PI", samples=samples)).metric_results[0].verdict for samples in (11, 21)
    ] == ["cut", "info"]
    assert evaluate({"m": alone}, [], tables("PI", samples=11), has_ended=False).metric_results[0].verdict == "info"


def test_an_order_names_the_variants_that_it_did_not_compare() -> None:
    metric = Metric("m", FORCE, "max", unit="N")
    order = Expectation("order", metric="m", ordered=("FF", "PI", "BW"), descending=False, margin=0.0)
    run = {("FF", 1): tables("FF", samples=5)["FF", 1], **tables("PI")}
    (result,) = evaluate({"m": metric}, [order], run).expectation_results
    assert (result.detail, result.more) == ("m: FF 0.04 N < PI 0.10 N.", "Not compared: BW.")
