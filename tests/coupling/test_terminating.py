"""A member that ends the run by discarding its step, and values that are checked for being finite."""

import numpy as np
import pytest

from tests.coupling.mock import DISCARD, Mock, scalar
from tests.coupling.test_going_back import MS, pair
from tests.coupling.test_linear_equations import ThreeToTwo
from twin.compiler import machine
from twin.component import Component, Int32, local, output
from twin.coupling import Access, Algorithm, RecordMember
from twin.coupling.execution.finite_value_monitor import finite_variables, value_reader


class Quitter(Mock):
    """Discards the step that reaches 12 ms, and says that it got to `reached` [s] and has had enough."""

    def __init__(self, reached):
        super().__init__("b")
        self.reached = reached

    def step(self, instance, t, h, *flags):
        if t + h > 0.012 - 1e-9:
            self.memory[2] = -1.0 if self.reached is None else self.reached
            return DISCARD
        return super().step(instance, t, h, *flags)

    def finish_reason(self):
        return "enough"

    def last_successful_time(self, reached):
        return self.reached


@pytest.mark.parametrize(
    ("reached", "ended", "rows"),
    [
        (0.012, "12 ms", [0.0, 4.0, 8.0, 12.0]),
        (0.010, "10 ms", [0.0, 4.0, 8.0]),
        (0.008, "8 ms", [0.0, 4.0, 8.0]),
        (None, "8 ms", [0.0, 4.0, 8.0]),
        (0.2, "8 ms", [0.0, 4.0, 8.0]),  # it cannot have got there
    ],
)
def test_a_discarded_step_may_end_the_run_at_the_time_reached(build, reached, ended, rows):
    run = pair(build, Quitter(reached), Algorithm.jacobi)
    assert (run.finished, run.failure) == (True, f"b ended the simulation at {ended}: enough")
    recorded = run.recording()
    assert (1e3 * recorded.time).tolist() == pytest.approx(rows)
    assert recorded.signals["b.t"].tolist() == pytest.approx([t / 1e3 for t in rows]), "what it computed in it counts"


def test_all_members_are_stepped_to_the_time_that_it_reached(build):
    run = pair(build, Quitter(0.010), Algorithm("iterative"))
    assert run.finished
    assert run.failure == "b ended the simulation at 10 ms: enough"
    assert run.members["b"].steps[-1] == pytest.approx((0.008, 0.002))


class Ender(Mock):
    """Ends the run in the step to 12 ms, and writes that it got to `reached` [s]."""

    def __init__(self, reached):
        super().__init__("b", ends=0.012)
        self.reached = reached

    def step(self, instance, t, h, *flags):
        status = super().step(instance, t, h, *flags)
        if t + h > 0.012 - 1e-9:
            machine.write_float(flags[-1], self.reached)
        return status


@pytest.mark.parametrize(
    ("reached", "ended", "rows"),
    [
        (0.012, "12 ms", [0.0, 4.0, 8.0, 12.0]),
        (0.010, "10 ms", [0.0, 4.0, 8.0]),  # values of a later time are not those of 12 ms
        (0.008, "12 ms", [0.0, 4.0, 8.0, 12.0]),  # nothing was written
        (0.5, "12 ms", [0.0, 4.0, 8.0, 12.0]),
    ],
)
def test_a_member_ends_the_run_at_the_time_that_it_writes(build, reached, ended, rows):
    run = pair(build, Ender(reached), Algorithm.jacobi)
    assert (run.finished, run.failure) == (True, f"b ended the simulation at {ended}")
    assert (1e3 * run.recording().time).tolist() == pytest.approx(rows)


class Spread(Component):
    """Real numbers with whole ones and an array between."""

    y = output("", "out", shape=(3,))
    n = local(0, "", "a whole number", type=Int32)
    z = local(0.0, "", "memory")
    a = local(0.0, "", "an array", shape=(2,))

    def step(self, t, h):
        self.y[0] = t


@pytest.mark.parametrize("cls", [Spread, ThreeToTwo])
def test_each_value_that_must_be_finite_is_read_in_place(cls):
    member = RecordMember("m", cls())
    variables = finite_variables(member)
    assert {v.name for v in variables} == {
        v.name
        for v in cls.variables
        if v.role.value in ("output", "local", "state", "derivative") and v.type == "Float64"
    }
    reader = value_reader(member, variables)
    assert sum(values.size for values in reader.values) == sum(v.size for v in variables)
    assert len(reader.values) <= len(variables)
    assert not reader.is_bad()
    for variable in variables:
        values = (
            np.ravel(member.component.views[variable.name])
            if not variable.shape
            else member.component.views[variable.name]
        )
        for index in np.ndindex(variable.shape or (1,)):
            for bad in (np.nan, np.inf, -np.inf):
                view = member.component.views[variable.name]
                view[index if variable.shape else ()] = bad
                assert reader.is_bad()
                view[index if variable.shape else ()] = 0.0
        assert np.isfinite(values).all()
    assert not reader.is_bad()


@pytest.mark.parametrize(("status", "bad"), [(0, True), (1, True), (2, False), (3, False)])
def test_values_that_a_member_refuses_are_not_judged(status, bad):
    """A member that has failed may refuse its values; those of a warning count."""
    journal = []

    def get(_instance, _references, count, values, size):
        journal.append((count, size))
        machine.write_float(values + 8, float("nan"))
        return status

    function = machine.ACCESS(get)
    member = Mock("m")
    member.address = lambda _: 0
    address = machine.ctypes.cast(function, machine.ctypes.c_void_p).value
    member.access = lambda names, write: Access(address, np.zeros(len(names), np.uint32), len(names), len(names))
    reader = value_reader(member, [scalar("y", "output"), scalar("t", "output")])
    assert reader.is_bad() is bad
    assert journal == [(2, 2)]


def test_the_last_step_of_a_run_is_no_longer_than_it(build):
    run = pair(build, Mock("b"), Algorithm.jacobi, stop=8 * MS)
    assert run.members["b"].steps == [(0.0, 0.004), (0.004, 0.004)]
    assert not run.finished
