"""Rollback: members that claim it and are tried, and log lines, of which those of steps that are rolled back are dropped."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.mock import Mock, scalar
from tests.every_case import every_case
from twin.compiler import machine
from twin.coupling import Algorithm, MemberVariable, StateAccess
from twin.coupling.variable_step.explicit_step import ACCEPTED, RESTORED, SAVED
from twin.coupling.variable_step.rollback import (
    BufferedLog,
    StepLogs,
    cannot_go_back,
    check_rollback,
    is_free,
    unfaithful,
    verify_rollback,
)
from twin.errors import CouplingError

OK, WARNING, DISCARD, ERROR = range(4)


class Tried(Mock):
    """A member that is asked for its state by calls; `fault`: what it does wrong, and the status of its calls."""

    def __init__(self, fault="", status=DISCARD):
        super().__init__("a", longest=0.5)
        self.fault, self.status, self.slot, self.copies, self.calls = fault, status, ctypes.c_void_p(), {}, []
        self.inputs = []
        self._calls = machine.STATE(self.give), machine.STATE(self.take)

    def give(self, _instance, address):
        self.calls.append("get")
        self.copies[77] = self.memory.copy()
        ctypes.c_int64.from_address(address).value = 77
        return self.status if self.fault == "get" else OK

    def take(self, _instance, state):
        self.calls.append("set")
        if self.fault != "forgets":
            self.memory[:] = self.copies[state]
        if self.fault == "drifts":
            self.memory[3] += 1.0
        return self.status if self.fault == "set" else OK

    def step(self, instance, t, h, *flags):
        self.calls.append(f"step {t:g} {h:g}")
        self.inputs.append(float(self.memory[0]))
        status = super().step(instance, t, h, *flags)
        self.memory[1] += self.memory[3]  # which no state has
        return status

    def state_access(self, count):
        called = [ctypes.cast(one, ctypes.c_void_p).value for one in self._calls]
        return StateAccess(get=called[0], set=called[1], pointer_addresses=(ctypes.addressof(self.slot),) * count)


@pytest.mark.parametrize("moved", [False, True])
def test_a_step_that_is_made_again_gives_the_same(moved):
    member = Tried()
    member.memory[:3] = 2.0, 1.0, 0.25
    assert verify_rollback(member, 0.25, 0.01, moved) == ""
    assert member.calls == ["get", "step 0.25 0.01", "set", "step 0.25 0.01", "set"]
    assert member.inputs == [3.0 if moved else 2.0] * 2
    assert member.memory[:3].tolist() == [2.0, 1.0, 0.25], "it is where it was"


@every_case(
    ("fault", "h", "problem"),
    [
        ("forgets", 0.01, "y is 1.0 at first and 1.1 after going back"),
        ("drifts", 0.01, "y is 1.1 at first and 2.1 after going back"),
        ("get", 0.01, "it does not give its state"),
        ("set", 0.01, "it refuses to go back"),
        ("", 0.75, "its step by 0.75 s returns 3"),
    ],
)
def test_what_is_wrong_with_a_rollback_is_told(fault, h, problem):
    member = Tried(fault)
    member.memory[:2] = 2.0, 1.0
    assert verify_rollback(member, 0.0, h) == problem


@pytest.mark.parametrize("fault", ["get", "set"])
def test_a_warning_is_no_refusal(fault):
    assert verify_rollback(Tried(fault, WARNING), 0.0, 0.01) == ""


@pytest.mark.parametrize(
    ("variable", "free"),
    [
        (scalar("u", "input"), True),
        (scalar("y", "output"), False),
        (MemberVariable("n", "input", "discrete", "Int32", np.dtype(np.int32)), False),
        (MemberVariable("u", "input", "continuous", "Float64", np.dtype(np.float64), maximum=1.0), False),
    ],
)
def test_inputs_that_may_be_moved_for_a_trial(variable, free):
    assert is_free(variable) is free


def test_members_without_rollback_are_named_unless_they_have_a_period():
    members = {name: SimpleNamespace(has_fmu_state=name == "a") for name in "abcd"}
    plain = "jacobi, gauss_seidel"
    check_rollback(Algorithm("jacobi"), members, [])
    check_rollback(Algorithm("step_doubling"), members, ["b", "c", "d"])
    with pytest.raises(CouplingError) as caught:
        check_rollback(Algorithm("step_doubling"), members, ["c"])
    algorithm = Algorithm("step_doubling")
    assert caught.value.problems == [cannot_go_back(name, algorithm) for name in ("b", "d")]
    assert cannot_go_back("b", algorithm).startswith(
        "b: cannot go back to the begin of a step, which step_doubling needs. Use "
    )
    assert plain.split(", ", maxsplit=1)[0] in unfaithful("b", "it forgets", algorithm)
    assert "step_doubling" not in unfaithful("b", "it forgets", algorithm)
    assert unfaithful("b", "it forgets", algorithm).startswith(
        "b: says that it can go back to the begin of a step, and cannot: it forgets. Use "
    )


def logs():
    """Logs of two members, and what reached their outer logs."""
    outer = {"a": ["before"], "b": []}
    members = [SimpleNamespace(log=log) for log in outer.values()]
    return StepLogs(members), members, outer


def told(step_logs, what, slot=0):
    """Report the outcome of a step."""
    assert step_logs._on_step_outcome(None, None, what, None, slot) == 0


def test_lines_of_a_step_are_passed_on_when_it_is_accepted():
    step_logs, (a, b), outer = logs()
    a.log.append("at once")
    assert outer == {"a": ["before", "at once"], "b": []}
    with step_logs.stepping():
        assert step_logs.pending[0] == 0
        a.log.append("first")
        assert step_logs.pending[0] == 1
        b.log.append("second")
        assert outer["a"][-1] == "at once"
        told(step_logs, ACCEPTED)
        assert (outer["a"][-1], outer["b"]) == ("first", ["second"])
        assert step_logs.pending[0] == 0
        a.log.append("last")
    assert outer["a"][-1] == "last", "no rollback follows the end"
    assert (a.log, step_logs.is_stepping, step_logs.pending[0]) == (["before", "at once", "first", "last"], False, 0)


@every_case(
    ("outcomes", "kept"),
    [
        ([(SAVED, 0), "x", (RESTORED, 0), "y"], ["y"]),
        (["x", (SAVED, 0), "y", (RESTORED, 0)], ["x"]),
        (["x", (RESTORED, 0), "y"], ["y"]),  # nothing was saved: all of them
        ([(SAVED, 0), "x", (SAVED, 1), "y", (RESTORED, 1), "z"], ["x", "z"]),
        ([(SAVED, 0), "x", (SAVED, 1), "y", (RESTORED, 0), "z"], ["z"]),
        ([(SAVED, 0), "x", (RESTORED, 0), "x", (RESTORED, 0), "x"], ["x"]),
        (["x", (ACCEPTED, 0), "y", (RESTORED, 0)], ["x"]),
        (["w", (SAVED, 0), (ACCEPTED, 0), "y", (RESTORED, 0)], ["w"]),  # an accepted step has no mark any more
    ],
)
def test_lines_of_a_step_that_is_rolled_back_are_dropped(outcomes, kept):
    step_logs, (a, b), outer = logs()
    with step_logs.stepping():
        for outcome in outcomes:
            if isinstance(outcome, str):
                a.log.append(outcome)
                b.log.append(outcome.upper())
            else:
                told(step_logs, *outcome)
    assert a.log == outer["a"] == ["before", *kept]
    assert b.log == outer["b"] == [line.upper() for line in kept]


def test_lines_of_a_trial_are_dropped():
    step_logs, (a, _), outer = logs()
    with step_logs.discarding():
        a.log.append("trial")
    assert (a.log, outer["a"], step_logs.is_stepping) == (["before"], ["before"], False)
    a.log.append("later")
    assert outer["a"] == ["before", "later"]


def test_an_outer_log_has_the_last_lines_and_is_never_buffered_twice():
    step_logs, (a, _), outer = logs()
    for number in range(25):
        a.log.append(str(number))
    assert outer["a"] == [str(number) for number in range(5, 25)]
    again = StepLogs([a])
    assert isinstance(a.log, BufferedLog)
    assert a.log.outer is outer["a"]
    with again.stepping():
        a.log.append("new")
    assert outer["a"][-2:] == ["24", "new"]
    state = np.zeros(1, [("pending", np.int64), ("log_callback", np.int64)])[0]
    again.connect(state)
    assert int(state["pending"]) == again.pending.ctypes.data
    assert machine.call_access(int(state["log_callback"]), 0, 0, ACCEPTED, 0, 1) == 0
    assert step_logs is not again
