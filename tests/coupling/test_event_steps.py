"""Steps up to an event: how the loop is told to make parts of a step, and what time it is in between."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling.event_steps import EventSteps
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import bits
from twin.coupling.variable_step.events import VariableStepEvents
from twin.coupling.variable_step.record_layout import PAST
from twin.errors import SimulationError

MS = 1_000_000
LENGTH = loop.OPERATION.index("h")


class Planned:
    """The events of a run: ticks at some times, announced events, the member that ends the run."""

    def __init__(self, ticks=(), announced=None, ended=""):
        self.due, self.announced, self.ended = min(ticks, default=None), announced, ended
        self.order = [SimpleNamespace(name=f"m{i}", due=tick, has_jumped=False) for i, tick in enumerate(ticks)]
        self.address = 4711

    @property
    def upcoming(self):
        return min((t for t in (self.due, self.announced) if t is not None), default=None)


def steps(events, tick=0, stop=100, period=0, begin=0):
    """Steps of 4 ms with one operation that steps a member and one that does not; `period`: its own [ns]."""
    state = np.zeros(1, loop.RECORD)[0]
    operations = np.zeros((2, len(loop.OPERATION)), np.int64)
    operations[0, LENGTH] = bits(0.004)
    state["operations"], state["operation_count"] = operations.ctypes.data, 2
    state["tick"], state["stop"], state["every"], state["condition_count"] = tick, stop, 1, 3
    state["begin_ns"], state["step_ns"], state["per_second"] = begin // MS, 4, 1000
    members = {"a": SimpleNamespace(period_ns=period)}
    found = EventSteps(events, members, {"a": 4 * MS}, state, begin, 4 * MS)
    found.memory = operations
    return found


def made(found, result=loop.DONE):
    """Run once; what the loop was told, as time and length of the steps [s], and its other fields."""
    told = []

    def run():
        state = found.state
        begin = (state["begin_ns"] + state["tick"] * state["step_ns"]) / state["per_second"]
        length = found.memory.view(np.float64)[:, LENGTH]
        assert length[1] == 0.0
        rows = bool(state["every"] == 1)
        told.append((begin, length[0], int(state["stop"]), rows, int(state["condition_count"]), found.is_part))
        told.append(found.time())
        state["tick"] = state["stop"]
        return result

    assert found.go(run) == result
    return told


def test_a_tick_at_a_communication_point_splits_nothing():
    found = steps(Planned([8 * MS]), stop=5)
    assert made(found) == [(0.0, 0.004, 5, True, 3, False), 4 * MS]
    assert int(found.state["tick"]) == 5


def test_the_loop_stops_before_the_step_with_the_tick_and_makes_it_in_parts():
    """A tick at 9.5 ms, and after it another at 11 ms: parts of 1.5, 1.5 and 1 ms, of which the last records a row."""
    events = Planned([9_500_000])
    found = steps(events)
    assert made(found) == [(0.0, 0.004, 2, True, 3, False), 4 * MS]
    assert made(found) == [(0.008, 0.0015, 3, False, 0, True), 9_500_000]
    assert (int(found.state["tick"]), found.now) == (2, 9_500_000)
    events.due = 11 * MS
    assert made(found) == [(0.0095, 0.0015, 3, False, 0, True), 11 * MS]
    events.due = 14 * MS
    assert made(found) == [(0.011, 0.001, 3, True, 3, False), 12 * MS]
    assert (int(found.state["tick"]), found.now, found.is_part, found.target) == (3, None, False, None)
    assert found.memory.view(np.float64)[:, LENGTH].tolist() == [0.004, 0.0], "lengths are those of before"
    assert [int(found.state[name]) for name in ("begin_ns", "step_ns", "per_second", "every")] == [0, 4, 1000, 1]
    assert found.time() == 16 * MS


def test_steps_count_from_the_begin_of_the_run():
    found = steps(Planned([102_500_000]), begin=100 * MS)
    assert made(found) == [(0.1, 0.0025, 1, False, 0, True), 102_500_000]
    assert made(found) == [(0.1025, 0.0015, 1, True, 3, False), 104 * MS]


@pytest.mark.parametrize("result", [loop.FAILED, loop.FULL, loop.FINISHED])
def test_a_part_that_was_not_made_is_repeated(result):
    found = steps(Planned([1 * MS]))
    first = made(found, result)
    assert found.now is None
    found.state["tick"] = 0
    assert made(found) == first


@every_case(
    ("events", "tick", "stop"),
    [
        (Planned(), 0, 100),
        (Planned([5 * MS]), 0, 1),
        (Planned([7_999_999]), 0, 1),
        (Planned([9 * MS]), 0, 2),
        (Planned([8 * MS]), 0, 100),
        (Planned([5 * MS]), 1, 2),  # the step in progress is over at 8 ms
        (Planned([500 * MS + 1]), 0, 100),
        (Planned([500 * MS], announced=6 * MS), 0, 1),
        (Planned([500 * MS], ended="m0"), 6, 7),
    ],
)
def test_after_an_event_the_loop_is_told_where_to_stop(events, tick, stop):
    found = steps(events, tick)
    found.check(tick * 4 * MS)
    assert int(found.state["stop"]) == stop
    assert found.events.steps is found


def test_an_event_that_is_over_stops_nothing():
    found = steps(Planned([5 * MS]))
    found.check(5 * MS)
    assert int(found.state["stop"]) == 100


def test_a_member_of_one_length_of_steps_cannot_be_split():
    found = steps(Planned([6 * MS, 5 * MS, 5 * MS]), period=4 * MS, begin=0)
    assert found.fixed_step_members == ["a"]
    expected = (
        "m1, m2: a clock ticks at t = 5 ms, between communication points of 4 ms, and a cannot make a shorter step. "
        "Use a communication step of 1 ms."
    )
    with pytest.raises(SimulationError) as caught:
        found.check(0)
    assert str(caught.value) == expected
    later = steps(Planned([8 * MS], announced=5 * MS), period=4 * MS)
    assert made(later)[0][2] == 100, "an announced event may come somewhat late"


def variable_steps(events, **fields):
    """The link of events and variable steps of 4 ms, from 100 ms on."""
    state = np.zeros(1, loop.RECORD)[0]
    state["divisions"] = 8
    for name, value in fields.items():
        state[name] = value
    past = (ctypes.c_double * PAST)(*[1.0] * PAST)
    plan = SimpleNamespace(members={"x": 0, "m0": 0, "m1": 0}, past=ctypes.addressof(past))
    found = VariableStepEvents(events, plan, state, 100 * MS, 4 * MS)
    assert (int(state["events"]), events.steps) == (4711, found)
    found.memory = past
    return found


@every_case(
    ("fields", "time", "is_part"),
    [
        ({}, 100 * MS, True),
        ({"position": 3}, 101_500_000, True),
        ({"tick": 5, "position": 7}, 123_500_000, True),
        ({"tick": 5, "position": 8}, 124 * MS, False),
        ({"tick": 5, "position": 8, "off": 1, "now": 0.1231}, 123_100_000, True),
        ({"off": 1, "now": 0.1}, 100 * MS, True),
    ],
)
def test_the_time_between_two_ticks_is_that_of_the_division_or_of_the_event(fields, time, is_part):
    found = variable_steps(Planned([999 * MS]), **fields)
    assert (found.time(), found.is_part) == (time, is_part)


def test_an_event_due_at_the_same_float_is_due_now():
    """At a late time neighboring floats are more than a nanosecond apart."""
    due = 90_000_000_000_000_007
    found = variable_steps(Planned([due]), off=1, now=due / 1e9)
    assert found.time() == due
    found.events.due += 1_000_000
    assert found.time() != due


@every_case(
    ("events", "due"),
    [
        (Planned(), np.inf),
        (Planned([150 * MS]), 0.15),
        (Planned([101 * MS]), 0.101),
        (Planned([100 * MS]), np.inf),
        (Planned([150 * MS], announced=120 * MS), 0.12),
    ],
)
def test_no_step_crosses_the_next_event(events, due):
    found = variable_steps(events)
    found.check(100 * MS)
    assert (found.state["due"], int(found.state["finished"])) == (due, 0)
    assert list(found.memory) == [1.0] * PAST


def test_after_an_event_a_member_may_end_the_run_or_have_jumped():
    events = Planned([150 * MS, 160 * MS], ended="m1")
    found = variable_steps(events)
    events.order[1].has_jumped = True
    found.check(100 * MS)
    assert (int(found.state["member"]), int(found.state["finished"])) == (2, 1)
    assert list(found.memory) == [0.0] * PAST, "earlier points are no basis for extrapolation"
