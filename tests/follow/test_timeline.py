"""Values of a rig by the steps of the model: which value a step uses, where the model stops, from where it is repeated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.follow.follower import SavedFollower
from twin.follow.timeline import InputSamples, RevisableFollower, Timeline

BEGIN, STEP = 1_000_000_000, 10_000_000  # [ns]


def timeline(inputs=1, gap=0.5):
    return Timeline(SimpleNamespace(start_ns=BEGIN, step_ns=STEP), inputs, gap)


@every_case(("time", "tick"), [(1.0, 0), (1.0049, 0), (1.0051, 1), (1.01, 1), (1.0149, 1), (1.5, 50), (0.98, -2)])
def test_a_value_belongs_to_the_nearest_step(time, tick):
    assert timeline().tick(time) == tick


def test_a_step_uses_the_latest_value_of_each_output():
    own = timeline()
    assert own.add_measurement(1, 1.02, 5.0) == 2
    assert own.add_measurement(1, 1.02, 6.0) is None  # there already
    assert own.add_measurement(1, 1.018, 7.0) is None  # older, of the same step
    assert own.add_measurement(1, 1.021, 8.0) == 2
    assert own.add_measurement(0, 1.019, 9.0) == 2
    ((tick, values),) = own.visits(0, 2, 100)
    assert (tick, list(values.items())) == (2, [(0, 9.0), (1, 8.0)])  # in the order of the outputs


@every_case(
    ("after", "limit", "idle", "steps"),
    [
        (0, 10, 100, [2, 7]),
        (0, 7, 100, [2, 7]),
        (0, 6, 100, [2]),
        (2, 7, 100, [7]),  # what is measured at the step reached is done
        (7, 10, 100, []),
        (0, 10, 3, [2, 5, 7, 10]),  # at most 3 steps without a stop
        (0, 9, 3, [2, 5, 7]),
        (2, 7, 5, [7]),  # no stop where a measurement follows at once
        (7, 10, 3, [10]),
        (0, 10, 1, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
    ],
)
def test_steps_to_stop_at(after, limit, idle, steps):
    own = timeline()
    own.add_measurement(0, 1.07, 3.0)
    own.add_measurement(0, 1.02, 1.0)
    visits = list(own.visits(after, limit, idle))
    assert [tick for tick, _ in visits] == steps
    measured = {2: {0: 1.0}, 7: {0: 3.0}}
    assert all(values == measured.get(tick, {}) for tick, values in visits)


def test_the_first_step_that_an_input_changes():
    own = Timeline(SimpleNamespace(start_ns=BEGIN, step_ns=7_812_500), 2, 0.5)  # 1/128 s
    for time, step in (
        (1.0, 0),  # the first value: everything changes
        (1.5, 1),  # in a gap that is interpolated: after its begin
        (1.25, 1),
        (1.25, None),  # there already
        (1.50390625, 65),  # between steps 64 and 65
        (2.25, 160),  # after a longer gap, in which values are held: the step of the value
        (0.5, 0),
    ):
        assert own.add_input(1, time, 10.0 * time) == step, time
    assert own.inputs[0].times == []
    np.testing.assert_array_equal(own.rows(1, 30, 34), [12.34375, 12.421875, 12.5, 12.578125, 12.65625])
    np.testing.assert_array_equal(own.rows(1, 159, 160), [15.0390625, 22.5])


def test_a_gap_as_long_as_allowed_is_interpolated():
    samples = InputSamples(0.5, [1.0], [4.0])
    np.testing.assert_array_equal(samples.at(np.array([0.0, 1.0, 9.0])), [4.0, 4.0, 4.0])
    samples.insert(1.5, 8.0)
    samples.insert(2.25, 16.0)
    np.testing.assert_array_equal(samples.at(np.array([1.25, 1.5, 1.875, 2.25])), [6.0, 8.0, 8.0, 16.0])


def test_values_of_former_steps_are_forgotten():
    own = timeline(inputs=2)
    for time in (1.0, 1.02, 1.04, 1.06):
        own.add_measurement(0, time, time)
        own.add_input(1, time, time)
    own.forget(4)
    assert [tick for tick, _ in own.visits(-1, 10, 100)] == [4, 6]
    assert own.inputs[1].times == [1.04, 1.06]
    assert own.add_measurement(0, 1.02, 2.0) == 2  # as if it had never been there
    own.forget(5)  # between two samples: the former one is needed
    assert own.inputs[1].times == [1.04, 1.06]
    own.forget(100)
    assert own.inputs[1].times == [1.06]
    assert list(own.visits(-1, 10, 100)) == []
    assert own.inputs[0].times == []


class Recorded:
    """A follower that only notes what it is told; `state` is all it has seen since its start."""

    def __init__(self, table):
        self.tick, self.state, self.calls, self.table = 0, (), [], table
        row = SimpleNamespace(component=SimpleNamespace(views={"row": np.array(7)}))
        other = SimpleNamespace(component=SimpleNamespace(views={}))
        self.batch = SimpleNamespace(simulation=SimpleNamespace(members={"recorded 1#0": row, "plant#0": other}))
        self.row = row.component.views["row"]

    def advance(self, tick):
        inputs = self.table[: tick - self.tick + 1].tolist()
        assert self.row == 0  # the model reads the table from its begin
        self.row[...] = 7
        self.state += ((self.tick, tick, inputs),)
        self.tick = tick

    def correct(self, measurements):
        self.state += (dict(measurements),)
        return self.tick, self.state

    def save(self):
        return SavedFollower(self.state, None, None, None, self.tick)

    def restore(self, saved):
        self.calls.append(saved.tick)
        self.tick, self.state = saved.tick, saved.filter


@pytest.fixture
def revisable(monkeypatch):
    """A revisable follower of steps of 10 ms, with values up to 50 ms late, and a stop at least every 100 steps."""
    table = np.zeros(101)
    case = SimpleNamespace(start_ns=BEGIN, step_ns=STEP)
    problem = SimpleNamespace(
        rig=SimpleNamespace(max_delay=5 * STEP + 1), experiment=SimpleNamespace(case=case), inputs=["force"]
    )
    problem.tables, problem.longest_interval = (table,), 100.0
    monkeypatch.setattr("twin.follow.timeline.Follower", lambda *_: Recorded(table))
    own = timeline()
    own.add_input(0, 1.0, 10.0)
    return RevisableFollower(problem, own)


def test_a_late_value_is_as_if_it_had_come_in_time(revisable):
    assert revisable.add_measurement(0, 1.02, 1.0)
    assert revisable.add_input(0, 1.04, 14.0)
    assert revisable.add_measurement(0, 1.06, 3.0)
    estimates = revisable.run(6)
    assert [tick for tick, _ in estimates] == [2, 6]
    assert revisable.tick == 6
    assert revisable.add_measurement(0, 1.05, 2.0)
    (five, _), (six, state) = revisable.run(6)
    assert (five, six) == (5, 6)
    assert revisable.follower.calls == [0, 2]  # the start, and the last step before the late value
    assert state == (
        (0, 2, [10.0, 11.0, 12.0]),
        {0: 1.0},
        (2, 5, [12.0, 13.0, 14.0, 14.0]),
        {0: 2.0},
        (5, 6, [14.0, 14.0]),
        {0: 3.0},
    )
    assert revisable.run(6) == []  # nothing new
    assert revisable.run(3) == []  # it never goes back by itself
    assert revisable.follower.calls == [0, 2]


def test_a_late_input_repeats_the_steps_that_it_changes(revisable):
    for time in (1.02, 1.04, 1.06):
        revisable.add_measurement(0, time, time)
    revisable.run(6)
    assert revisable.add_input(0, 1.05, 20.0)  # after 1.0 s, the sample before
    assert [tick for tick, _ in revisable.run(6)] == [2, 4, 6]
    assert revisable.follower.state[4] == (4, 6, [18.0, 20.0, 20.0])
    assert revisable.add_measurement(0, 1.09, 1.0)  # later than all: no step is repeated
    assert [tick for tick, _ in revisable.run(9)] == [9]
    assert revisable.follower.calls == [0, 0]


def test_what_is_older_than_the_horizon_is_refused(revisable):
    assert revisable.max_delay == 5
    assert revisable.horizon == 0
    assert not revisable.add_measurement(0, 1.0, 1.0)  # at the start
    for tick in range(1, 13):
        revisable.add_measurement(0, 1.0 + 0.01 * tick, float(tick))
    revisable.run(12)
    assert revisable.horizon == 7
    assert not revisable.add_measurement(0, 1.07, 1.0)
    assert not revisable.add_input(0, 1.07, 1.0)
    assert revisable.add_input(0, 1.08, 1.0)  # changes what is after 1.0 s, of which steps after 7 are not final
    assert [tick for tick, _ in revisable.run(12)] == [8, 9, 10, 11, 12]
    assert revisable.follower.calls == [0, 7]


def test_the_horizon_is_that_of_the_last_state_where_few_are_saved(revisable):
    revisable.add_measurement(0, 1.02, 1.0)
    revisable.add_measurement(0, 1.2, 2.0)
    revisable.run(20)
    assert revisable.horizon == 15
    assert revisable.add_measurement(0, 1.16, 3.0)
    assert [tick for tick, _ in revisable.run(20)] == [16, 20]
    assert revisable.follower.calls == [0, 2]
    assert [tick for tick, _ in revisable.run(150)] == [120]  # nothing is measured for 100 steps
    assert revisable.horizon == 115
