"""Probabilities of changes by Bayes' rule, alarms and restarts, from innovations that are put in."""

from __future__ import annotations

import numpy as np
import pytest

from twin.follow.changes import UNKNOWN, Amount, Change, ChangeBank
from twin.follow.filters import Ensemble, Extended, Unscented, Update

RATES = (1 / 3600, 3 / 3600)
CHANGES = (
    Change(
        "friction", RATES[0], (Amount({"a.mu": (2.0, 0.0)}, {}), Amount({"a.mu": (0.0, 0.5), "a.k": (1.0, 0.1)}, {}))
    ),
    Change("offset", RATES[1], (Amount({}, {1: 0.3}),)),
)
SIGMA = 0.1  # of the innovations


def bank(changes=CHANGES, make=Unscented, **options):
    filter_ = make(np.array([1.0, 2.0]), np.array([0.1, 0.1]), np.array([0.0, 0.0]), np.array([3.0, 3.0]), **options)
    return ChangeBank(changes, filter_, 2)


def update(own, time, *innovations, measured=(0.0, 0.0), gain=None):
    """Tell the bank of a measurement: the filter's innovation, then those of the models, before their offsets."""
    first, *others = (np.array(one) for one in innovations)
    nis = float(np.sum((first / SIGMA) ** 2))
    gain = np.zeros((2, 2)) if gain is None else gain
    result = Update(np.zeros(2), first, np.full(2, SIGMA), nis, SIGMA * np.eye(2), gain)
    outputs = np.array(measured) - np.array(others)
    return own.update(time, own.points.copy(), outputs, [0, 1], np.array(measured), result)


def test_each_change_is_as_likely_as_it_happens_in_the_time_that_is_remembered():
    own = bank()
    weights = np.array([1.0, 4.0 * np.mean(RATES), 4.0 * RATES[0], 4.0 * RATES[1]])
    assert own.names == ("no change", "none of these", "friction", "offset")
    assert own.probabilities == pytest.approx(weights / weights.sum())
    assert own.count == 3
    assert own.parameters == ["a.mu", "a.k"]
    small = (0.01, 0.01)
    update(own, 0.0, small, (1.0, 1.0), (1.0, 1.0), (1.0, 1.0))
    update(own, 2.9, small, (0.0, 0.0), (1.0, 1.0), (1.0, 1.0))
    assert own.probabilities == pytest.approx(weights / weights.sum())  # nothing is named at first


def test_likelihoods_are_forgotten_with_a_time_constant():
    """Log-likelihood ratios of half the difference of the normalized squares; one of none is worth 1.5 for each value."""
    own = bank()
    same = ((0.1, 0.1), (0.1, 0.1), (0.1, 0.1), (0.1, 0.4))
    update(own, 0.0, *same)
    better = ((0.3, 0.1), (0.1, 0.1), (0.3, 0.1), (0.3, 0.4))  # a square of 10, 2, 10, 10
    update(own, 4.0, *better)
    ratios = np.array([0.5 * (10 - 3), 0.5 * (10 - 2), 0.0, 0.0])
    prior = np.log(4.0 * np.array([np.mean(RATES), RATES[0] / 2, RATES[0] / 2, RATES[1]]))

    def expected():
        weights = np.exp(np.concatenate([[0.0], prior + ratios]))
        weights /= weights.sum()
        return [weights[0], weights[1], weights[2] + weights[3], weights[4]]

    assert own.probabilities == pytest.approx(expected(), rel=1e-9)
    own._restart = np.inf  # no restart in between
    update(own, 4.5, *better)
    ratios = np.exp(-0.5 / 4.0) * ratios + ratios
    assert own.probabilities == pytest.approx(expected(), rel=1e-9)
    for _ in range(60):
        update(own, 4.5, *better)
    assert own._ratios.max() == pytest.approx(100.0)  # what is sure need not become surer
    for _ in range(60):
        update(own, 4.5, (0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (0.5, 0.8))
    assert own._ratios[1:] == pytest.approx(-20.0)  # and may come back


def until(own, time, stop, *innovations, every=0.1):
    """Tell the bank the same again and again: the time of the next one, alarms, and when a change became sure."""
    alarms, sure = [], {}
    while time < stop - 1e-9:
        if alarm := update(own, time, *innovations):
            alarms.append(alarm)
        if own.probabilities.max() > 0.95:
            sure.setdefault(own.names[int(np.argmax(own.probabilities))], time)
        time += every
    return time, alarms, sure


FINE = ((0.1, 0.1), (0.3, 0.3), (0.3, 0.3), (0.1, 0.1))  # the filter is right
FRICTION = ((0.4, 0.4), (0.4, 0.4), (0.01, 0.01), (0.4, 0.4))
STRANGE = ((0.6, 0.6), (0.6, 0.6), (0.6, 0.6), (0.6, 0.6))


def test_a_change_is_named_when_it_has_been_sure_for_a_second():
    own = bank()
    time, alarms, sure = until(own, 0.0, 10.0, *FINE)
    assert (alarms, list(sure)) == ([], ["no change"])
    _, alarms, sure = until(own, time, 14.0, *FRICTION)
    first = alarms[0]
    assert first.name == "friction"
    assert 9.9 < sure["friction"] < 12.0
    assert first.time == pytest.approx(sure["friction"] + 1.0, abs=0.11)
    assert first.onset == pytest.approx(10.0, abs=0.11)
    assert first.probability > 0.95
    assert own.alarms == alarms
    assert own._named == 1  # the second amount


@pytest.mark.slow
def test_what_no_listed_change_explains_is_called_so_when_it_has_been_sure_for_seven_seconds():
    own = bank()
    time, *_ = until(own, 0.0, 10.0, *FINE)
    time, alarms, sure = until(own, time, 30.0, *STRANGE)
    (alarm,) = alarms  # once
    assert alarm.name == UNKNOWN
    assert alarm.time == pytest.approx(sure[UNKNOWN] + 7.0, abs=0.11)
    assert alarm.onset == pytest.approx(10.0, abs=0.11)
    time, alarms, _ = until(own, time, 60.0, *FINE)
    assert alarms == []
    assert own.probabilities[0] > 0.95
    _, alarms, _ = until(own, time, 80.0, *STRANGE)
    assert [one.name for one in alarms] == [UNKNOWN]  # it may come again


def test_models_are_corrected_with_the_gain_of_the_filter():
    own = bank()
    own.points = np.array([[1.0, 1.0], [2.0, 2.9], [0.05, 1.0]])
    gain = np.array([[0.02, 0.0], [0.0, 0.1]])  # of the normalized innovation
    update(own, 0.0, (0.0, 0.0), (0.1, 0.2), (0.1, 0.2), (-0.3, 0.4), gain=gain)
    assert own.points == pytest.approx(
        np.array([[1.02, 1.2], [2.02, 3.0], [0.0, 1.1]])
    )  # within 0 to 3; less the offset
    own.points = np.ones((3, 2))
    update(own, 0.1, (0.0, 0.0), (5.0, -0.2), (0.1, -7.0), (0.0, 0.3), gain=gain)
    assert own.points == pytest.approx(np.array([[1.06, 0.8], [1.02, 0.7], [1.0, 1.0]]))  # by three deviations at most


class Batch:
    """Notes what is written; values of two parameters of eight copies."""

    def __init__(self, count=8):
        self.count, self.calls, self.values = count, [], np.tile([1.0, 4.0], (count, 1))

    def copy_memory(self, numbers, source=0):
        self.calls.append(("copy", list(numbers), source))

    def write(self, points, *, sharing):
        self.calls.append(("write", points.tolist(), sharing))

    def get_parameters(self):
        return self.values.copy()

    def set_parameters(self, values):
        self.calls.append(("set", values.tolist()))
        self.values = values


def test_models_that_are_due_start_at_the_estimate_with_their_amounts():
    own, batch, points = bank(), Batch(), np.full((5, 2), 1.5)
    own.write(batch, points, 5)
    assert batch.calls[:3] == [("copy", [5], 0), ("copy", [6], 0), ("copy", [7], 0)]
    assert batch.calls[3] == ("write", [[1.5, 1.5]] * 5 + [[1.0, 2.0]] * 3, 5)
    changed = [[1.0, 4.0]] * 5 + [[2.0, 4.0], [0.5, 4.1], [1.0, 4.0]]
    assert batch.calls[4] == ("set", [pytest.approx(row) for row in changed])
    batch.calls.clear()
    own.write(batch, points, 5)  # none is due
    assert [call[0] for call in batch.calls] == ["write"]


@pytest.mark.parametrize("make", [Unscented, Extended, Ensemble])
def test_a_named_change_is_taken_over(make):
    own = bank(make=make, **({"size": 5, "seed": 1} if make is Ensemble else {}))
    batch = Batch()
    assert not own.adopt(batch)
    assert batch.calls == []
    own._named, own.points = 1, np.array([[1.0, 1.0], [2.5, 2.6], [0.0, 0.0]])
    assert own.adopt(batch)
    if make is Ensemble:
        assert batch.values == pytest.approx(np.array([[0.5, 4.1]] * 5 + [[1.0, 4.0]] * 3))
    else:
        assert batch.calls == [("copy", [0], 6)]
        assert own.filter.mean.tolist() == [2.5, 2.6]
    assert own.offset.tolist() == [0.0, 0.0]
    assert own._starting.all()
    own._named = 2
    own.adopt(batch)
    own._named = 2
    own.adopt(batch)
    assert own.offset == pytest.approx([0.0, 0.6])  # offsets add up
    assert own._ratios.tolist() == [0.0] * 4
    calls = len(batch.calls)
    own.adopt(batch)
    assert len(batch.calls) == calls


def test_models_start_again_except_those_that_explain_the_measurements_best():
    own = bank()
    time, *_ = until(own, 0.0, 5.0, *FINE)
    own._starting[:] = False
    until(own, time, time + 1.0, *FINE)
    assert own._starting.tolist() == [True, True, True]  # each second while nothing has changed
    own._starting[:] = False
    until(own, 6.1, 10.0, *FRICTION)
    assert own._starting.tolist() == [True, False, True]


def test_models_start_again_somewhat_less_likely_than_an_unknown_change():
    """Together by a factor of e^6; those that explain the measurements best go on."""
    own = bank()
    unknown, leading = 9.0, 10.0
    own._ratios[:] = unknown, leading, 2.0, -3.0
    own._cumulated[:], own._lowest[:], own._onsets[:], own._starting[:] = 5.0, -1.0, 3.0, False
    own._plan_restart(8.0)
    assert own._starting.tolist() == [False, True, True]
    prior = np.log(4.0 * np.array([np.mean(RATES), RATES[0] / 2, RATES[1]]))
    again = unknown + prior[0] - prior[1:] - np.log(3) - 6.0
    assert own._ratios == pytest.approx([unknown, leading, *again])
    assert (own._cumulated.tolist(), own._lowest.tolist()) == ([5.0, 5.0, 0.0, 0.0], [-1.0, -1.0, 0.0, 0.0])
    assert (own._onsets.tolist(), own._restart) == ([3.0, 3.0, 8.0, 8.0], 8.0)
    own._ratios[:] = -2.0, 0.0, 0.1, -2.0
    own._plan_restart(9.0)
    assert own._starting.tolist() == [True, False, True]  # what explains nothing starts again
    assert own._ratios == pytest.approx([-2.0, 0.0, 0.1, 0.0])
