"""The loop of fixed steps, interpreted over memory: what it calls at which communication point, and how a run ends."""

import ctypes

import numpy as np
import pytest

from tests.coupling.test_step_functions import Calls, state
from tests.every_case import every_case
from twin.coupling.execution import condition_loop, loop
from twin.coupling.execution.condition_loop import ARMED, MET, VALUE
from twin.coupling.execution.loop import DONE, FAILED, FINISHED, FULL, KINDS, NOTICED, TRIGGERED
from twin.coupling.execution.value_memory import bits
from twin.coupling.variable_step.record_layout import EARLY

ROWS = 8


class Fixed(Calls):
    """Communication points of 4 ms from 0.5 s on; a row of a recording is the tick and two values."""

    def __init__(self, operations, **fields):
        super().__init__()
        self.values, self.rows = np.array([1.5, -2.0, 0.0]), np.zeros((ROWS, 3))
        at = int(self.values.ctypes.data)
        table = operations(self)
        begin = int(self.rows.ctypes.data)
        common = {"begin_ns": 500, "step_ns": 4, "per_second": 1000, "every": 1, "stop": 4}
        recording = {"next_row": begin, "limit": begin + self.rows.nbytes, "row_bytes": 24}
        records = {"records": self.array([[at, 8, 2]]), "record_count": 1}
        rows = {"operations": self.array(table), "operation_count": len(table)}
        self.state = state(**common | recording | records | rows | fields)

    def run(self):
        return loop.run(self.state)

    def names(self):
        """Names of the calls, with the time [ms] from the begin of the run for steps."""
        return [f"{name} {(more[0] - 0.5) * 1000:g}" if len(more) == 3 else name for name, *more in self.journal]

    def recorded(self):
        """Ticks of the recorded rows."""
        count = (self.state.next_row - self.rows.ctypes.data) // 24
        return self.rows.view(np.int64)[:count, 0].tolist()

    def limits(self, low, high, index=1):
        """Let a value have limits."""
        at = int(self.values.ctypes.data) + 8 * index
        self.state.limits = self.array([[at, KINDS["f8"], 1, bits(low), bits(high)]])
        self.state.limit_count, self.scalar = 1, np.zeros(1)
        self.state.scalar = int(self.scalar.ctypes.data)

    def condition(self):
        """Let a condition be met as soon as the third value is not 0; return its phase."""
        self.stack, phase = np.zeros(2), np.zeros(2, np.int64)
        program = self.array([[VALUE, int(self.values.ctypes.data) + 16, KINDS["f8"]]])
        self.state.conditions = self.array([[program, 1, 0, 0, int(phase.ctypes.data)]])
        self.state.condition_count, self.state.stack = 1, int(self.stack.ctypes.data)
        return phase


def one_step(calls):
    """One member "a", number 6."""
    return [calls.operation(steps=[calls.step("a", 6)], h=0.004)]


def test_operations_are_executed_in_their_order_when_they_are_due():
    """A fast member publishes right after its step; one of two communication points takes inputs at the first of them
    and publishes at the end of the second.
    """

    def operations(calls):
        publish = calls.array([calls.access("get a", 6, 5), calls.access("get more", 6, 6)])
        step = calls.step("a", 6)
        step[4:6] = publish, 2
        return [
            calls.operation(accesses=[calls.access("set a", 6), calls.access("set b", 6)], steps=[step], h=0.004),
            calls.operation(accesses=[calls.access("set slow", 7)], steps=[calls.step("slow", 7)], divider=2, h=0.008),
            [2, 1, *calls.operation(accesses=[calls.access("get slow", 7)])[2:]],
        ]

    fixed = Fixed(operations)
    assert fixed.run() == DONE
    fast = [["set a", "set b", f"a {t}", "get a", "get more"] for t in (0, 4, 8, 12)]
    slow = [["set slow", f"slow {t}"] for t in (0, 8)]
    assert fixed.names() == [
        *(*fast[0], *slow[0], *fast[1], "get slow"),
        *(*fast[2], *slow[1], *fast[3], "get slow"),
    ]
    assert fixed.journal[0] == ("set a", 11, 12, 13, 14, 3)
    assert fixed.journal[3] == ("get a", 11, 12, 13, 14, 5)
    assert [call for call in fixed.journal if call[0] in ("a", "slow")][:3] == [
        ("a", 0.5, 0.004, True),
        ("slow", 0.5, 0.008, True),
        ("a", 0.504, 0.004, True),
    ]
    assert (fixed.state.tick, fixed.recorded()) == (4, [1, 2, 3, 4])
    assert (fixed.state.member, fixed.state.status, fixed.state.finished) == (0, 0, 0)


def test_values_move_before_the_members_step_and_are_recorded_after_it():
    def operations(calls):
        at, f8 = int(calls.values.ctypes.data), KINDS["f8"]
        converts = [[at + 16, f8, at + 8, f8, 1, bits(-2.0), bits(0.5)]]
        return [calls.operation([[at, at + 16, 1]], converts=converts)]

    fixed = Fixed(operations, every=2)
    fixed.state.record_converts = fixed.array(
        [[int(fixed.values.ctypes.data) + 16, KINDS["f8"], 16, KINDS["f8"], 1, bits(10.0), bits(0.0)]]
    )
    fixed.state.record_convert_count = 1
    assert fixed.run() == DONE
    assert fixed.values.tolist() == [1.5, -2.5, 1.5]
    assert fixed.recorded() == [2, 4], "every second communication point"
    assert fixed.rows[:2, 1:].tolist() == [[1.5, 15.0]] * 2
    assert fixed.state.next_row == fixed.rows.ctypes.data + 48
    assert not fixed.rows[2:].any()


@every_case(("status", "result", "tick"), [(0, DONE, 4), (1, DONE, 4), (2, FAILED, 0), (3, FAILED, 0)])
@every_case("refusing", ["set", "a", "get"])
def test_a_status_above_a_warning_ends_the_run_at_its_call(refusing, status, result, tick):
    def operations(calls):
        step = calls.step("a", 6)
        step[4:6] = calls.array([calls.access("get", 6)]), 1
        return [calls.operation(accesses=[calls.access("set", 6)], steps=[step, calls.step("b", 7)], h=0.004)]

    fixed = Fixed(operations)
    fixed.answers[refusing] = status
    assert fixed.run() == result
    assert (fixed.state.tick, len(fixed.recorded())) == (tick, tick)
    assert (fixed.state.member, fixed.state.status) == ((6, status) if result == FAILED else (0, 0))
    if result == FAILED:
        assert fixed.journal[-1][0] == refusing
        address = ctypes.c_int64.from_address(fixed.state.at).value
        assert address == fixed.functions[refusing], "the row of the call, for crash reports"


def test_the_recording_may_fill_up_and_the_run_go_on():
    fixed = Fixed(one_step)
    fixed.state.limit = fixed.state.next_row + 48
    assert fixed.run() == FULL
    assert (fixed.state.tick, fixed.names()) == (2, ["a 0", "a 4"])
    fixed.state.limit += 48
    assert fixed.run() == DONE
    assert (fixed.state.tick, fixed.recorded()) == (4, [1, 2, 3, 4])
    assert fixed.run() == DONE
    assert len(fixed.journal) == 4, "nothing is left to do"


def test_a_member_that_ends_the_run_ends_it_after_the_communication_step():
    fixed = Fixed(lambda calls: [calls.operation(steps=[calls.step("a", 6, (0, 1, 0, 0.0)), calls.step("b", 7)])])
    assert fixed.run() == FINISHED
    assert (fixed.state.member, fixed.state.finished, fixed.state.tick) == (6, 1, 1)
    assert (fixed.names(), fixed.recorded()) == (["a 0", "b 0"], [1])


@pytest.mark.parametrize(("reached", "result"), [(0.504, DONE), (0.503, FAILED)])
def test_a_member_that_returned_early_ends_the_run(reached, result):
    fixed = Fixed(lambda calls: [calls.operation(steps=[calls.step("a", 6, (0, 0, 1, reached))])], stop=1)
    flags = ctypes.c_int64.from_address(ctypes.c_int64.from_address(fixed.state.operations + 72).value + 24).value
    fixed.state.early_returns, fixed.state.early_return_count = fixed.array([[flags, bits(0.004), 6]]), 1
    assert fixed.run() == result
    failed = (6, EARLY, reached, 0, [])
    reported = fixed.state.member, fixed.state.status, fixed.state.until, fixed.state.tick, fixed.recorded()
    assert reported == (failed if result == FAILED else (0, 0, 0, 1, [1]))


@pytest.mark.parametrize(
    ("low", "fires", "expected"),
    [(-9.0, 0.0, DONE), (-1.0, 0.0, NOTICED), (-9.0, 1.0, TRIGGERED), (-1.0, 1.0, NOTICED)],
)
def test_conditions_are_evaluated_even_where_a_limit_is_violated(low, fires, expected):
    """The second value is -2."""
    fixed = Fixed(one_step)
    fixed.limits(low, 9.0)
    phase, fixed.values[2] = fixed.condition(), fires
    assert fixed.run() == expected
    assert fixed.state.tick == (4 if expected == DONE else 1)
    assert phase[0] == (MET if fires else ARMED)
    assert fixed.state.beyond == (fixed.state.limits if expected == NOTICED else 0)


@pytest.mark.parametrize("watched", ["limits", "condition"])
def test_one_of_both_suffices_to_be_checked(watched):
    fixed = Fixed(one_step)
    if watched == "limits":
        fixed.limits(-1.0, 9.0)
    else:
        fixed.condition()
        fixed.values[2] = 1.0
    assert fixed.run() == (NOTICED if watched == "limits" else TRIGGERED)
    assert (fixed.state.tick, fixed.recorded()) == (1, [1]), "the row of that point is there"


def test_conditions_are_evaluated_before_the_first_step_too():
    fixed = Fixed(one_step, tick=3)
    phase, fixed.values[2] = fixed.condition(), 1.0
    assert (condition_loop.start(fixed.state), phase.tolist()) == (1, [MET, 4])
