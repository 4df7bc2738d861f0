"""Inputs over time of a member that is integrated, and the solvers: each by itself."""

import numpy as np
import pytest

from tests.every_case import every_case
from tests.fmi.linear_member import LinearMember, real
from twin.errors import FMUError
from twin.fmi.csv_tables import InputColumn, Inputs
from twin.fmi.model_exchange import solvers
from twin.fmi.model_exchange.inputs import Followed
from twin.fmi.model_exchange.solvers import Equations

# --- inputs over time


def followed(member_inputs, times, linear, rows):
    """A member whose input follows a table."""
    member = LinearMember("a", [[0]], [[1] * member_inputs])
    member.is_initializing, member.seen = True, []
    member.set = lambda name, value: member.seen.append((name, np.array(value).tolist()))
    variable = member.variables["u"] if linear else real("u", "input", 2, member_inputs, "discrete")
    column = InputColumn(variable, np.array(rows, float).reshape(len(times), -1))
    return member, Followed(member, Inputs(np.array(times, float), [column]))


@every_case(
    ("times", "linear", "rows", "jumps"),
    [
        ([0, 1, 2], True, [0, 5, 5], []),
        ([0, 1, 1, 2], True, [0, 5, 7, 7], [1]),
        ([0, 0, 2, 2], True, [1, 2, 3, 4], [0, 2]),
        ([0, 1, 2, 3], False, [0, 5, 5, 6], [1, 3]),
        ([0, 1, 1, 2], False, [0, 5, 5, 5], [1]),
        ([0], False, [3], []),
    ],
)
def test_jumps_of_inputs(times, linear, rows, jumps):
    """Two rows at one time; of a held input every change."""
    _, inputs = followed(1, times, linear, rows)
    assert inputs.jumps.tolist() == jumps
    assert [inputs.due(t) for t in (-1.0, *jumps)] == [*jumps, np.inf]
    for jump in jumps:
        assert inputs.due(np.nextafter(jump, -1.0)) == jump


def test_a_jump_has_two_limits():
    """Until the jump the value before it, from then on the one after; between rows linear."""
    member, inputs = followed(1, [0, 1, 1, 2], True, [0, 4, 10, 20])
    slot = member.slot("u")
    for t, value in (
        (0.0, 0.0),
        (0.5, 2.0),
        (1.0, 4.0),
        (np.nextafter(1.0, 2.0), 10.0),
        (1.5, 15.0),
        (2.0, 20.0),
        (3.0, 20.0),
    ):
        inputs.move_to(t)
        assert slot.values[0] == slot.applied[0] == member.u[0] == pytest.approx(value)
    inputs.apply(1.0)
    assert member.seen == [("u", 10.0)]
    inputs(0.5)
    assert member.seen[1:] == [("u", 2.0)]
    member.is_initializing = False
    inputs(0.5)
    assert len(member.seen) == 2


def test_arrays_and_held_inputs():
    member, inputs = followed(2, [0, 1], False, [[1, 2], [3, 4]])
    inputs.move_to(0.5)  # nothing: it is held
    assert member.slots == {}
    inputs.apply(1.0)
    assert member.seen == [("u", [3.0, 4.0])]


# --- solvers


def decay(jacobian=None, failure=None):
    """y' = -y in two states."""

    def derivatives(t, y):
        if failure is not None and t > 0.0:
            raise failure
        return -y

    return Equations(derivatives, jacobian, 1e-8, np.full(2, 1e-10))


@pytest.mark.parametrize("name", solvers.NAMES)
def test_every_solver_stops_at_its_bound_and_interpolates(name):
    if name in (*solvers.CVODE, *solvers.ARKODE):
        pytest.importorskip("sksundae" if name in solvers.CVODE else "SundialsPy")
    calls = []

    def jacobian(t, y):
        calls.append(t)
        return -np.eye(2)

    solver = solvers.make(name, decay(jacobian))
    solver.begin(0.0, np.array([1.0, 2.0]), 1e-3)
    t, y = 0.0, None
    for _ in range(500):
        last, (t, y) = t, solver.step(0.25)
        assert last < t <= 0.25
        if t == 0.25:
            break
    assert t == 0.25
    assert y == pytest.approx([np.exp(-0.25), 2 * np.exp(-0.25)], rel=1e-6)
    middle = (last + t) / 2
    assert solver.at(middle) == pytest.approx([np.exp(-middle), 2 * np.exp(-middle)], rel=1e-5)
    assert bool(calls) == (name in ("Radau", "BDF", "CVODE"))


def test_the_first_step_that_is_asked_for():
    solver = solvers.make("RK45", decay())
    solver.begin(0.0, np.ones(2), 1e-4)
    assert solver.step(1.0)[0] == pytest.approx(1e-4)
    solver.begin(0.0, np.ones(2), 0.0)
    assert solver.step(1.0)[0] != pytest.approx(1e-4)


@pytest.mark.parametrize("name", ["CVODE", "CVODE_Adams", "ARKODE", "ARKODE_ERK"])
def test_what_fails_in_a_callback_of_native_code_is_raised(name):
    pytest.importorskip("sksundae" if name in solvers.CVODE else "SundialsPy")
    solver = solvers.make(name, decay(failure=KeyError("mine")))
    solver.begin(0.0, np.ones(2), 1e-3)
    with pytest.raises(KeyError, match="mine"):
        solver.step(1.0)


def test_names_of_solvers():
    assert solvers.check("radau") == "Radau"
    assert solvers.check("CVODE_adams") == "CVODE_Adams"
    with pytest.raises(FMUError, match=r"solver 'Radu' is not known\. Did you mean 'Radau'\?"):
        solvers.check("Radu")
    solver = solvers.make("RK45", Equations(lambda t, y: y, None, 1e-6, np.zeros(0)))
    assert isinstance(solver, solvers.Stateless)
    assert (solver.step(0.5)[0], len(solver.step(0.5)[1]), len(solver.at(0.2))) == (0.5, 0, 0)
