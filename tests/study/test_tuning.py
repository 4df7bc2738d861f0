"""The course of a tuning, where an optimizer proposes what the test says and cases are formulas."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.study.patients import STUDY, study_file
from twin.study import load_study
from twin.study.execution import tuning
from twin.study.execution.case_engine import Row
from twin.study.execution.tuning import BAD, tune

TUNED = """
tune:
  knobs: {{wall.free_length: {{from: {low}, to: 60 mm, scale: log}}, heart.rate: {{from: 1 Hz, to: 2 Hz}}}}
  metric: force_max
  of: max
  goal: {goal}
  variant: {variant}
  seed: 7
  trials: 3
  limits: [{limits}]
"""


class Optimizer:
    """Proposes knobs in turn and remembers what it is told."""

    def __init__(self, proposals):
        self.proposals, self.told, self.enqueued, self.asked, self.direction = list(proposals), [], [], [], ""
        self.logging = SimpleNamespace(set_verbosity=lambda _level: None, ERROR=1)
        self.samplers = SimpleNamespace(TPESampler=self.sampler)

    def sampler(self, seed, constraints_func):
        self.seed, self.constraints = seed, constraints_func

    def create_study(self, direction, sampler):
        assert sampler is None
        self.direction = direction
        return self

    def enqueue_trial(self, knobs):
        self.enqueued.append(knobs)

    def ask(self):
        values = iter(self.proposals.pop(0))
        trial = SimpleNamespace(user_attrs={})
        trial.suggest_float = lambda *name, log: self.asked.append((*name, log)) or next(values)
        trial.set_user_attr = trial.user_attrs.__setitem__
        return trial

    def tell(self, trial, value):
        self.told.append((value, self.constraints(trial)))


class Formulas:
    """The force of a case is 1 N per metre of the first knob, as in the scenario 48 mm; 0.1 N more with unseen samples."""

    def __init__(self, study, failing=()):
        self.study, self.failing, self.runs = study, failing, []

    def completed_row(self, request):
        assert request.number <= self.study.count
        return Row(request.number, "done", "", (0.048, 0.0), (True, None))

    def run(self, requests, part):
        requests = list(requests)
        self.runs.append((part, [one.number for one in requests], requests[0].extra, {one.variant for one in requests}))
        force = requests[0].extra[0] + (0.1 if part == "unseen" else 0.0)
        if requests[0].extra[0] in self.failing:
            return [Row(one.number, "failed", "", (), ()) for one in requests]
        return [Row(one.number, "done", "", (force, 0.0), (True, None)) for one in requests]


def tuned(tmp_path, monkeypatch, proposals, *, goal="min", variant="plain", low="40 mm", limits="", failing=()):
    text = STUDY.replace("\nkeep:", "\nvariants: [soft, plain]\nkeep:")
    text += TUNED.format(goal=goal, variant=variant, low=low, limits=limits)
    study = load_study(study_file(tmp_path, text))
    optimizer, cases = Optimizer(proposals), Formulas(study, failing)
    monkeypatch.setattr(tuning, "import_optional", lambda *_: optimizer)
    return tune(study, cases, 100), optimizer, cases, study


def test_the_best_of_some_trials(tmp_path, monkeypatch):
    """Numbers of cases go on from 100. A force of 45 mN breaks the limit, so the scenario's own values are the best."""
    limits = "{metric: force_max, of: min, at_least: 46 mN}"
    found, optimizer, cases, study = tuned(
        tmp_path, monkeypatch, [(0.045, 1.5), (0.055, 1.0), (0.05, 1.2)], limits=limits
    )
    own = tuning.own(study, "plain")
    assert own == pytest.approx((0.048, 1.0))
    assert (optimizer.direction, optimizer.seed) == ("minimize", 7)
    assert optimizer.enqueued == [{"wall.free_length": own[0], "heart.rate": own[1]}]
    assert optimizer.asked == [("wall.free_length", 0.04, 0.06, True), ("heart.rate", 1.0, 2.0, False)] * 3
    assert [(one.knobs, one.objective, one.part, one.index) for one in found.trials] == [
        (own, 0.048, "sample", 0),
        ((0.045, 1.5), 0.045, "tune", 1),
        ((0.055, 1.0), 0.055, "tune", 2),
        ((0.05, 1.2), 0.05, "tune", 3),
    ]
    assert found.best is found.trials[0]
    assert [value for value, _ in optimizer.told] == [0.045, 0.055, 0.05]
    assert [limits[0] for _, limits in optimizer.told] == pytest.approx([0.001, -0.009, -0.004])
    assert [(part, numbers[0], numbers[-1]) for part, numbers, *_ in cases.runs] == [
        ("tune", 101, 106),
        ("tune", 107, 112),
        ("tune", 113, 118),
        ("unseen", 119, 124),
        ("unseen", 125, 130),
    ]
    assert found.last == 130
    assert all(variants == {"plain"} for *_, variants in cases.runs)
    assert [(one.knobs, one.objective, one.part, one.index) for one in found.unseen] == [
        (own, pytest.approx(0.148), "unseen", 0),
        (own, pytest.approx(0.148), "unseen", 1),
    ]


def test_the_scenarios_own_proposal_is_not_run_again(tmp_path, monkeypatch):
    _, _, _, study = tuned(tmp_path, monkeypatch, [(0.05, 1.5)] * 3)
    own = tuning.own(study, "plain")
    found, optimizer, cases, _ = tuned(tmp_path, monkeypatch, [own, (0.05, 1.5), own])
    assert [one.index for one in found.trials] == [0, 2]
    assert [value for value, _ in optimizer.told] == [0.048, 0.05, 0.048]
    assert [limits for _, limits in optimizer.told] == [(0.0,)] * 3  # no limits: none is broken
    assert len(cases.runs) == 1 + 2


def test_a_largest_objective_is_the_least_of_its_negative(tmp_path, monkeypatch):
    """A trial that fails counts as bad; the first of the variants by default."""
    found, optimizer, cases, _ = tuned(
        tmp_path, monkeypatch, [(0.05, 1.5), (0.055, 1.5), (0.06, 1.5)], goal="max", variant='""', failing=(0.06,)
    )
    assert [value for value, _ in optimizer.told] == [-0.05, -0.055, BAD]
    assert found.best.knobs == (0.055, 1.5)
    assert found.trials[-1].objective == -np.inf, "a failed case is no large one"
    assert {variant for *_, variants in cases.runs for variant in variants} == {"soft"}


def test_own_values_outside_of_the_knobs_are_not_proposed(tmp_path, monkeypatch):
    found, optimizer, *_ = tuned(
        tmp_path, monkeypatch, [(0.05, 1.5)] * 3, low="49 mm", limits="{metric: force_max, of: min, at_least: 1 N}"
    )
    assert optimizer.enqueued == []
    assert found.best is None
    assert len(found.unseen) == 1
