"""Tuning: the best values of some parameters over all samples, by an objective and limits. Optuna proposes, the engine runs.

A study that goes on asks and tells again what it has; what Optuna proposes follows from its seed and what it was told.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.installed import import_optional
from twin.scenario import member_seed
from twin.study.design import SAMPLED, Assignment, Limit, Study, StudyRequest, design

if TYPE_CHECKING:
    from twin.study.execution.case_engine import Row
    from twin.study.execution.study_runner import PendingCases

TUNE, UNSEEN = "tune", "unseen"
STATISTICS: dict[str, Any] = {"mean": np.mean, "median": np.median, "max": np.max, "min": np.min}
BAD = 1e6  # what an objective without a value counts


@dataclass
class Trial:
    """Values of the knobs, the objective in SI, and by how much each limit is broken: above zero it is."""

    knobs: tuple[float, ...]
    objective: float
    broken: tuple[float, ...]
    part: str
    index: int

    @property
    def is_feasible(self) -> bool:
        """Whether all limits are kept."""
        return all(excess <= 0.0 for excess in self.broken) and math.isfinite(self.objective)


@dataclass
class Tuned:
    """The trials, the first with the scenario's own values; best and own judged again on samples that no trial has seen."""

    trials: list[Trial]
    best: Trial | None
    unseen: list[Trial]  # of the scenario's own values, then of the best
    last: int


def tune(study: Study, cases: PendingCases, number: int) -> Tuned:
    """Tune; numbers of cases go on from `number`."""
    optuna = import_optional("optuna", "study", "tune")
    keys = study.keys.tune
    assert keys is not None
    variant = keys.variant or study.variants[0]
    sign = 1.0 if keys.goal == "min" else -1.0
    first = judged(
        study,
        [cases.completed_row(request) for request in study.requests() if request.variant == variant],
        own(study, variant),
        SAMPLED,
        0,
    )
    trials = [first]
    last = number

    def evaluate(knobs: tuple[float, ...], values: Any, part: str, index: int) -> Trial:
        nonlocal last
        requests = trial_requests(study, variant, knobs, values, part, index, last)
        last += len(requests)
        return judged(study, cases.run(requests, part), knobs, part, index)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Optuna tells that constraints are experimental
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        sampler = optuna.samplers.TPESampler(
            seed=keys.seed, constraints_func=lambda trial: trial.user_attrs["broken"] or (0.0,)
        )
        optimizer = optuna.create_study(direction="minimize", sampler=sampler)
        if all(knob.low <= value <= knob.high for knob, value in zip(study.knobs, first.knobs, strict=True)):
            optimizer.enqueue_trial(
                {knob.factor.name: value for knob, value in zip(study.knobs, first.knobs, strict=True)}
            )
        for index in range(1, keys.trials + 1):
            proposed = optimizer.ask()
            knobs = tuple(
                proposed.suggest_float(knob.factor.name, knob.low, knob.high, log=knob.is_log) for knob in study.knobs
            )
            if knobs == first.knobs:
                trial = Trial(knobs, first.objective, first.broken, TUNE, index)
            else:
                trial = evaluate(knobs, study.design.values, TUNE, index)
                trials.append(trial)
            proposed.set_user_attr("broken", list(trial.broken))
            optimizer.tell(proposed, sign * trial.objective if np.isfinite(trial.objective) else BAD)
    good = [trial for trial in trials if trial.is_feasible]
    best = min(good, key=lambda trial: sign * trial.objective) if good else None
    candidates = [first, best] if best is not None else [first]
    unseen = [evaluate(candidate.knobs, fresh(study), UNSEEN, k) for k, candidate in enumerate(candidates)]
    return Tuned(trials, best, unseen, last)


def own(study: Study, variant: str) -> tuple[float, ...]:
    """What the scenario has for the knobs."""
    (case,) = (case for case in study.scenario.variants if case.variant == variant)
    assignment = Assignment(case, study.catalogs[variant], [knob.factor for knob in study.knobs])
    return tuple(assignment.nominal(knob.factor) for knob in study.knobs)


def fresh(study: Study) -> Any:
    """As many samples from another seed."""
    samples = study.keys.samples
    seed = member_seed(samples.seed, "unseen")
    return design(samples.method, samples.count, seed, study.factors, study.correlation).values


def trial_requests(
    study: Study, variant: str, knobs: tuple[float, ...], values: Any, part: str, index: int, number: int
) -> list[StudyRequest]:
    """The cases of a trial: every sample with the seed that it has in all trials."""
    requests: list[StudyRequest] = []
    for sample, row in enumerate(values, 1):
        seeds = study.seeds(sample) if part == TUNE else [member_seed(seed, UNSEEN) for seed in study.seeds(sample)]
        for seed in seeds:
            number += 1
            requests.append(
                StudyRequest(number, f"{part} {index}", sample, variant, seed, tuple(map(float, row)), knobs)
            )
    return requests


def judged(study: Study, rows: list[Row], knobs: tuple[float, ...], part: str, index: int) -> Trial:
    """A trial from its rows."""
    keys = study.keys.tune
    assert keys is not None
    failed = np.inf if keys.goal == "min" else -np.inf
    objective = statistic(values(study, rows, keys.metric, failed), keys.of, keys.quantile)
    return Trial(knobs, objective, tuple(excess(study, rows, limit) for limit in study.limits), part, index)


def values(study: Study, rows: list[Row], metric: str, failed: float) -> Any:
    """A metric of rows; `failed` where a case has none."""
    column = list(study.scenario.metrics).index(metric)
    metric_values = [row.metrics[column] if row.metrics else None for row in rows]
    return np.array([failed if value is None else value for value in metric_values])


def statistic(samples: Any, of: str, quantile: float) -> float:
    """What a metric's values come to."""
    if of == "quantile":
        return float(np.quantile(samples, quantile, method="higher"))
    return float(STATISTICS[of](samples))


def excess(study: Study, rows: list[Row], limit: Limit) -> float:
    """By how much a limit is broken; what is not above zero keeps it."""
    if limit.expectation:
        column = [e.name for e in study.scenario.expectations].index(limit.expectation)
        holds = [row.holds[column] if row.holds else False for row in rows]
        highest = lowest = float(np.mean([bool(item) for item in holds if item is not None] or [False]))
    else:
        highest, lowest = (
            statistic(values(study, rows, limit.metric, failed), limit.statistic, limit.quantile)
            for failed in (np.inf, -np.inf)
        )
    over = highest - limit.at_most if limit.at_most is not None else -np.inf
    under = limit.at_least - lowest if limit.at_least is not None else -np.inf
    worst = max(over, under)
    return float(worst) if np.isfinite(worst) else BAD
