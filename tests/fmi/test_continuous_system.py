"""Equations of several members in one solver, without FMUs: events at their times, values between members, inputs over time."""

import numpy as np
import pytest

from tests.every_case import every_case
from tests.fmi.linear_member import LinearMember, link
from twin.errors import CouplingError, SimulationError
from twin.fmi.model_exchange.solvers import Discarded
from twin.fmi.model_exchange.system import ContinuousSystem


def falling(start=1.0, level=None, **rest):
    """x falls by 1 every second, so that every solver is exact; y is x."""
    return LinearMember("a", [[0]], c=[[1]], e=[[1]], p=(-1,), start=(start,), level=level, **rest)


def started(*members, links=()):
    system = ContinuousSystem(list(members), list(links))
    system.start()
    return system


def run(system, stop, step):
    """The states at all communication points."""
    found = [system.y.copy()]
    for number in range(round(stop / step)):
        system.step(number * step, step)
        found.append(system.y.copy())
    return np.array(found)[:, 0]


# --- events


def test_a_state_event_is_just_after_its_indicator_changes_sign():
    member = falling(level=0.3)
    system = started(member)
    after = []
    member.reset = lambda x: after.append(float(x[0])) or x + 1.0
    states = run(system, 2.0, 0.25)
    assert member.log == pytest.approx([0.7, 1.7], abs=1e-9)
    assert all(0.3 - 1e-9 < x <= 0.3 for x in after)
    assert states == pytest.approx([1.0, 0.75, 0.5, 1.25, 1.0, 0.75, 0.5, 1.25, 1.0], abs=1e-9)
    assert 0.0 <= member.log[0] - 0.7 < 1e-12
    assert 0.7 - 1e-12 <= system.last_before - 1.0 + 1e-12 <= 0.7 + 2e-12


def test_a_rising_indicator_is_an_event_too_and_one_at_rest_is_none():
    member = LinearMember("a", [[0]], e=[[1]], p=(2,), start=(0,), level=1.0)
    run(started(member), 1.0, 0.1)
    assert member.log == pytest.approx([0.5], abs=1e-9)
    still = LinearMember("a", [[0]], start=(1,), level=1.0)
    run(started(still), 1.0, 0.1)
    assert still.log == []


@every_case("solver", ["Radau", "BDF", "RK23", "RK45", "DOP853"])
def test_a_curved_indicator(solver):
    """x = exp(-t) passes 0.5 at log(2)."""
    member = LinearMember("a", [[-1]], start=(1,), level=0.5)
    member.solver, member.tolerance = solver, 1e-8
    run(started(member), 1.0, 0.5)
    assert member.log == pytest.approx([np.log(2.0)], abs=1e-5)


@every_case(
    ("due", "times"),
    [
        (0.25, [0.25]),
        (0.3, [0.3]),
        (0.2, [0.2]),  # at a communication point
        (0.2 - 1e-15, [0.2]),  # as good as at it
        (0.2 + 1e-15, [0.2]),
        (0.05, [0.05]),
        (9.0, []),
    ],
)
def test_time_events(due, times):
    """The step ends at the time that was announced; what lies within rounding of a communication point is at it."""
    member = falling()
    member.due = due

    def reset(x):
        member.due = np.inf
        return x + 1.0

    member.reset = reset
    states = run(started(member), 0.4, 0.1)
    assert member.log == pytest.approx(times, abs=1e-14)
    assert states[-1] == pytest.approx(0.6 + len(times))
    assert states[2] == pytest.approx(0.8 + (due <= 0.2 + 1e-14))


def test_the_end_that_a_member_wants():
    member = falling(level=0.75)
    system = started(member)
    member.reset = lambda x: (setattr(member, "ends", True), x)[1]
    states = run(system, 1.0, 0.1)
    assert (system.ended, system.t) == (True, pytest.approx(0.25))
    assert states[3:] == pytest.approx([0.75] * 8)


def test_step_events():
    """A member may want Event Mode after a step of the solver."""
    member = falling()
    member.complete_step = lambda: (member.t > 0.15 and not member.log, False)
    run(started(member), 0.4, 0.1)
    assert len(member.log) == 1
    assert member.log[0] > 0.15


def test_events_without_an_end():
    member = falling(level=0.5)
    member.solver = "RK23"
    member.reset = lambda x: np.full(1, 0.5 + 1e-13)
    with pytest.raises(
        SimulationError, match=r"^a: events follow each other without end at t = 0\.5\d* s\. Stop before"
    ):
        run(started(member), 1.0, 0.1)
    many = falling()
    many.solver, many.due = "RK23", 0.0015

    def reset(x):
        many.due = many.t + 0.0015
        return x

    many.reset = reset
    run(started(many), 0.2, 0.1)  # many events in much time are none of these
    assert len(many.log) == 133


def test_iterations_of_an_event():
    """Until no member needs another; at most 100."""
    member, counts = falling(), []

    def update(needed):
        return lambda: (counts.append(1) or len(counts) < needed, False, np.inf)

    member.update = update(100)
    started(member)
    assert len(counts) == 100
    counts.clear()
    member.update = update(101)
    with pytest.raises(
        SimulationError, match=r"^a: the event at t = 0 s has no end after 100 iterations\. Look for values"
    ):
        started(member)


def test_the_next_time_event_is_the_first_of_all_members():
    first, second = falling(), LinearMember("b", [[0]])
    first.due, second.due = 0.3, 0.2
    assert started(first, second).due == 0.2


# --- members together


def test_one_solver_for_all():
    first, second = falling(), LinearMember("b", [[0]])
    assert ContinuousSystem([first, second], []).solver_name == "Radau"
    second.solver = "RK45"
    assert ContinuousSystem([first, second], []).solver_name == "RK45"
    first.solver = "RK45"
    assert ContinuousSystem([first, second], []).solver_name == "RK45"
    first.solver = "BDF"
    expected = (
        r"^a, b: are connected and integrated together, but with different solvers \(BDF, RK45\)\. Give all of them"
    )
    with pytest.raises(CouplingError, match=expected):
        ContinuousSystem([first, second], [])


@pytest.mark.parametrize(("given", "expected"), [((None, None), 1e-6), ((1e-4, None), 1e-4), ((1e-4, 1e-8), 1e-8)])
def test_the_tightest_tolerance_holds_for_all(given, expected):
    """Absolute tolerances are relative ones of the nominal values; 1 where that is 0."""
    first, second = falling(), LinearMember("b", [[0, 0], [0, 0]])
    first.tolerance, second.tolerance = given
    first.nominals, second.nominals = np.array([-20.0]), np.array([0.0, 0.5])
    equations = started(first, second).solver.equations
    assert equations.relative == expected
    assert equations.absolute.tolist() == pytest.approx([20.0 * expected, expected, 0.5 * expected])


def test_a_jacobian_that_cannot_be_had_is_left_out():
    member = falling()
    assert started(member).solver.equations.jacobian is not None
    member.capabilities = {"providesDirectionalDerivatives": False}
    assert started(member).solver.equations.jacobian is None
    member = falling()

    def refuse(*_):
        raise Discarded

    member.direction = refuse
    assert started(member).solver.equations.jacobian is None


def chain(**more):
    """b follows 2 y + 1 of a with a rate of 0."""
    a, b = falling(**more), LinearMember("b", [[0]], [[1, 1]])
    links = [link((a, "y"), (b, "u"), 2.0, 1.0, size=1, to=1)]
    return a, b, started(a, b, links=links)


def test_values_between_members():
    """Factor and offset, to an element; at the end of each step the slots hold the values there."""
    a, b, system = chain()
    assert b.u.tolist() == [0.0, 3.0]
    system.step(0.0, 0.5)
    assert b.u.tolist() == pytest.approx([0.0, 2.0])
    assert a.slots["y"].values.tolist() == pytest.approx([0.5])
    assert system.y.tolist() == pytest.approx([0.5, 3.0 * 0.5 - 0.25])


@every_case(
    ("key", "value", "element", "seen"),
    [
        (("a", "y"), 4.0, None, [0.0, 9.0]),
        (("a", "y"), [4.0], None, [0.0, 9.0]),
        (("b", "u"), 7.0, 0, [7.0, 2.0]),
        (("b", "u"), 7.0, 1, [0.0, 7.0]),
        (("b", "u"), [8.0, 9.0], None, [8.0, 9.0]),
        (("none", "u"), 1.0, None, [0.0, 2.0]),
    ],
)
def test_overrides(key, value, element, seen):
    """What others see of a variable, from the next step on, until it is taken back."""
    a, b, system = chain()
    system.override(key, value, element)
    assert b.u.tolist() == [0.0, 3.0]
    system.step(0.0, 0.5)
    assert b.u.tolist() == pytest.approx(seen)
    assert a.slots["y"].values.tolist() == pytest.approx([0.5])  # its own value stays
    system.override(key, None, element)
    system.step(0.5, 0.5)
    assert b.u[1] == pytest.approx(1.0)
    assert system.t == 1.0


def test_back_to_a_communication_point():
    a, b, system = chain()
    system.step(0.0, 0.25)
    saved, states, u = system.save(), system.y.copy(), b.u.copy()
    system.step(0.25, 0.25)
    after = system.y.copy()
    system.restore(saved)
    a.states[:], b.states[:] = states[:1], states[1:]
    b.u[:] = b.slots["u"].values[:] = u
    system.step(0.25, 0.25)
    assert system.y.tolist() == pytest.approx(after.tolist(), rel=1e-12)
    assert (system.t, system.is_restored, system.ended) == (0.5, False, False)


def test_a_step_is_made_once_for_all_members():
    a, _, system = chain(level=0.9)
    system.step(0.0, 0.5)
    before = system.y
    system.step(0.0, 0.5)
    assert system.y is before
    assert len(a.log) == 1


def test_an_input_from_outside_is_an_event():
    member = LinearMember("a", [[0]], [[1]])
    member.slot("u")
    system = started(member)
    system.step(0.0, 0.5)
    member.slots["u"].values[:] = 3.0
    system.step(0.5, 0.5)
    assert member.log == [0.5]
    assert system.y.tolist() == pytest.approx([1.5])
    system.step(1.0, 0.5)
    assert member.log == [0.5]


def test_equations_that_cannot_be_evaluated_end_it_with_the_time():
    member = falling()
    system = started(member)
    system.step(0.0, 0.5)

    def refuse():
        raise Discarded

    member.differentiate = refuse
    assert np.isnan(system.differentiate(0.5, system.y)).all()
    expected = r"^a: Radau cannot go on at t = 0\.5 s \(.*\)\. Use another solver, or another tolerance\.$"
    with pytest.raises(SimulationError, match=expected):
        system.step(0.5, 0.5)


@pytest.mark.parametrize(("sizes", "is_driven"), [([1], False), ([1, 1], False), ([2], True)])
def test_an_input_that_another_member_drives(sizes, is_driven):
    """A connection that gives all of it leaves nothing for others to set; elements of it do."""
    a = LinearMember("a", [[0]], c=[[1], [2]], e=[[1]], p=(-1,), start=(1,))
    b = LinearMember("b", [[0]], [[1, 1]])
    links = [link((a, "y"), (b, "u"), size=size, first=i, to=i) for i, size in enumerate(sizes)]
    system = started(a, b, links=links)
    assert b.slots["u"].is_driven is is_driven
    b.slots["u"].values[:] = 50.0
    system.step(0.0, 0.5)
    assert b.log == ([] if is_driven else [0.0])
    assert b.u[1] == pytest.approx(1.0 if sizes != [1] else 50.0)


def test_no_states():
    member = LinearMember("a", np.zeros((0, 0)), c=np.zeros((1, 0)))
    system = started(member)
    system.step(0.0, 0.5)
    assert (system.t, len(system.y)) == (0.5, 0)
