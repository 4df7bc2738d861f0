"""The search for the worst case and the judgment of a tuning, where cases are formulas instead of simulations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.study.patients import STUDY, study_file
from twin.study import load_study
from twin.study.execution.case_engine import Row
from twin.study.execution.tuning import BAD, TUNE, UNSEEN, Trial, excess, fresh, judged, own, statistic, trial_requests
from twin.study.execution.worst_case_search import WorstCase, search_worst

TUNED = (
    STUDY.replace("\nkeep:", "\nvariants: [plain]\nkeep:")
    + """
worst: {metric: force_max, evaluations: 64, inside: 90 %}
tune:
  knobs: {wall.free_length: {from: 40 mm, to: 60 mm}}
  metric: force_max
  of: max
  limits:
    - {metric: force_max, of: min, at_least: 15 mN}
    - {expectation: gentle, at_least: 90 %}
    - {metric: motion, of: quantile, quantile: 50 %, at_most: 3 mm}
  trials: 12
"""
)


def load(folder, *changes):
    text = TUNED
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return load_study(study_file(folder, text))


class Formulas:
    """Evaluates cases by a formula of the values of their factors."""

    def __init__(self, metric):
        self.metric, self.runs = metric, []

    def completed_row(self, request):
        return Row(request.number, "done", "", (self.metric(request.values), 0.0), (True, None))

    def run(self, requests, part):
        requests = list(requests)
        self.runs.append((part, requests))
        return [self.completed_row(one) for one in requests]


@pytest.mark.parametrize(("goal", "sign"), [("max", 1.0), ("min", -1.0)])
def test_the_worst_case_is_at_an_edge_of_the_middle_90_percent(tmp_path, goal, sign):
    study = load(tmp_path, ("evaluations: 64", f"goal: {goal}, evaluations: 400"))
    cases = Formulas(lambda values: values[1])  # heart.scale is uniform in 0.5 to 1.5
    worst = search_worst(study, cases, 100)
    assert worst.value == pytest.approx(1.0 + sign * 0.45, abs=2e-3)
    assert abs(worst.value - 1.0) <= 0.45
    assert worst.sampled == sign * max(sign * row[1] for row in study.design.values)
    requests = [one for _, run in cases.runs for one in run]
    assert (worst.metric, worst.variant, worst.goal) == ("force_max", "plain", goal)
    assert worst.evaluations == len(requests) == 400
    assert worst.last == 500
    assert [one.number for one in requests] == list(range(101, 501))
    assert [one.sample for one in requests] == list(range(1, 401))
    assert {len(run) for _, run in cases.runs} == {40}
    assert {part for part, _ in cases.runs} == {"worst"}
    assert len({one.seed for one in requests}) == 1
    assert all(np.isnan(one.extra).tolist() == [True] for one in requests)
    assert requests[worst.number - 101].values == worst.values
    assert worst.values[1] == worst.value
    (rates,) = [[one.values[0] for one in requests]]
    assert 45 / 60 < min(rates) < max(rates) < 110 / 60


@pytest.mark.parametrize(("evaluations", "size", "runs"), [(8, 8, 1), (64, 8, 8), (100, 12, 8), (1000, 40, 25)])
def test_generations_of_the_search(tmp_path, evaluations, size, runs):
    cases = Formulas(lambda values: values[1])
    search_worst(load(tmp_path, ("evaluations: 64", f"evaluations: {evaluations}")), cases, 0)
    assert [len(run) for _, run in cases.runs] == [size] * runs


def test_a_case_without_a_value_is_the_worst(tmp_path):
    study = load(tmp_path)
    worst = search_worst(study, Formulas(lambda values: None if values[1] > 1.3 else values[1]), 6)
    assert np.isnan(worst.value)
    assert worst.values[1] > 1.3
    assert worst.sampled <= 1.3


def test_numbers_of_cases_in_all(tmp_path):
    assert load(tmp_path).total == 6 + 64 + 13 * 6
    assert load(tmp_path, ("seed: 3", "seed: 3, seeds: [4, 5]")).total == 12 + 64 + 13 * 12
    assert load_study(study_file(tmp_path)).total == 12  # two variants


@every_case(("of", "value"), [("mean", 4.0), ("median", 2.5), ("max", 10.0), ("min", 1.0), ("quantile", 3.0)])
def test_statistics_of_a_metric(of, value):
    assert statistic(np.array([3.0, 1.0, 10.0, 2.0]), of, 0.5) == value  # a quantile is one of the values


def rows(metrics, holds=None):
    return [
        Row(i, "done", "", (one, one), (ok, None))
        for i, (one, ok) in enumerate(zip(metrics, holds or [True] * 9, strict=False), 1)
    ]


def test_limits_are_broken_by_what_is_beyond_them(tmp_path):
    least, gentle, motion = load(tmp_path).limits
    study = load(tmp_path)
    assert [one.text for one in study.limits] == [
        "min of force_max at least 15 mN",
        "gentle at least 90 %",
        "quantile of motion at most 3 mm",
    ]
    assert excess(study, rows([0.02, 0.03]), least) == pytest.approx(-0.005)
    assert excess(study, rows([0.02, 0.013]), least) == pytest.approx(0.002)
    assert excess(study, rows([1e-3, 2e-3, 4e-3]), motion) == pytest.approx(-1e-3)
    assert excess(study, rows([1e-3, 3.5e-3, 4e-3]), motion) == pytest.approx(0.5e-3)
    assert excess(study, rows([0.0] * 4, [True, True, True, False]), gentle) == pytest.approx(0.15)
    assert excess(study, rows([0.0] * 4, [True, None, True, True]), gentle) == pytest.approx(-0.1)  # not judged
    assert excess(study, rows([0.0], [None]), gentle) == pytest.approx(0.9)
    failed = Row(1, "failed", "", (), ())
    assert excess(study, [failed, *rows([0.0])], gentle) == pytest.approx(0.4)
    assert excess(study, [failed], motion) == BAD
    both = replace(least, at_most=0.03)
    assert excess(study, rows([0.02]), both) == pytest.approx(-0.005)
    assert excess(study, rows([0.04]), both) == pytest.approx(0.01)


def test_a_trial_is_judged_by_objective_and_limits(tmp_path):
    study = load(tmp_path)
    trial = judged(study, rows([0.016, 0.02], [True, True]), (0.05,), TUNE, 3)
    assert (trial.knobs, trial.part, trial.index) == ((0.05,), "tune", 3)
    assert trial.objective == 0.02
    assert trial.broken == pytest.approx((-0.001, -0.1, 0.017))
    failed = judged(study, [*rows([0.016]), Row(2, "failed", "", (), ())], (0.05,), TUNE, 4)
    assert failed.objective == np.inf
    assert failed.broken == pytest.approx((BAD, 0.4, BAD)), "a failed case keeps no limit"


@every_case(
    ("objective", "broken", "feasible"),
    [
        (1.0, (), True),
        (1.0, (0.0, -1.0), True),
        (1.0, (-1.0, 1e-9), False),
        (np.inf, (-1.0,), False),
        (np.nan, (), False),
    ],
)
def test_a_trial_is_feasible_that_keeps_all_limits(objective, broken, feasible):
    assert Trial((), objective, broken, TUNE, 1).is_feasible is feasible


def test_cases_of_a_trial_have_the_seeds_of_the_samples_and_unseen_ones_others(tmp_path):
    study = load(tmp_path, ("seed: 3", "seed: 3, seeds: [4, 5]"))
    values = study.design.values[:2]
    requests = trial_requests(study, "plain", (0.05,), values, TUNE, 7, 20)
    assert [(one.number, one.part, one.sample, one.variant, one.seed, one.extra) for one in requests] == [
        (21, "tune 7", 1, "plain", 4, (0.05,)),
        (22, "tune 7", 1, "plain", 5, (0.05,)),
        (23, "tune 7", 2, "plain", 4, (0.05,)),
        (24, "tune 7", 2, "plain", 5, (0.05,)),
    ]
    assert [one.values for one in requests[1:3]] == [tuple(row) for row in values]
    unseen = trial_requests(study, "plain", (0.05,), values, UNSEEN, 0, 24)
    assert [one.number for one in unseen] == [25, 26, 27, 28]
    assert not {one.seed for one in unseen} & {4, 5}
    assert unseen[0].seed == unseen[2].seed != unseen[1].seed
    assert fresh(study).shape == study.design.values.shape
    assert not np.isin(fresh(study), study.design.values).any()
    assert own(study, "plain") == (pytest.approx(0.05, abs=0.05),)


@pytest.mark.parametrize(
    ("goal", "value", "sampled", "is_worse"),
    [
        ("max", 1.0, 2.0, True),
        ("max", 2.0, 1.0, False),
        ("min", 1.0, 2.0, False),
        ("min", 2.0, 1.0, True),
        ("max", np.nan, 2.0, False),  # the case failed, which is worse than any value
        ("max", 1.0, np.nan, False),  # no sample has a value
    ],
)
def test_a_sample_that_is_worse_than_the_search_is_told(goal, value, sampled, is_worse):
    worst = WorstCase("m", "base", goal, 1, value, (), sampled, 8, 9)
    assert ("raise `evaluations`" in worst.remark) is is_worse
