"""Attempts of a step, their acceptance and the acceleration of iterations, interpreted: calls, errors, sizes, differences."""

import numpy as np
import pytest

from tests.coupling.test_step_functions import Calls, state
from tests.coupling.test_variable_steps import ADDRESS, DISCARD, ERROR, WARNING, Script
from tests.every_case import every_case
from twin.coupling.variable_step import implicit_step, stepping
from twin.coupling.variable_step.record_layout import (
    COMPARED,
    DEPTH,
    DOUBLING,
    END,
    PREDICTED,
    RESIDUAL,
    SCALE,
    UNSOLVED,
)


def elements(now, compared=None, guess=None, scale=None):
    """Values of elements in the five vectors."""
    vectors = np.zeros((5, len(now)))
    vectors[0] = now
    for row, values in ((COMPARED, compared), (END, guess), (SCALE, scale)):
        vectors[row] = 0.0 if values is None else values
    return vectors


@every_case(
    ("control", "error", "fields", "expected"),
    [  # accepted, stride of the next step, missed
        (PREDICTED, 1.0, {}, (1, 2, 0)),
        (PREDICTED, 1.01, {}, (0, 2, 0)),
        (PREDICTED, 1.01, {"least": 2}, (1, 2, 1)),
        (PREDICTED, 1.01, {"limited": 1}, (1, 2, 1)),
        (PREDICTED, 1.01, {"limited": 2}, (0, 2, 0)),
        (PREDICTED, np.nan, {}, (0, 2, 0)),
        (PREDICTED, 0.2, {}, (1, 4, 0)),  # twice the step of order 1 has four times the error, with a margin of 0.9
        (PREDICTED, 0.21, {}, (1, 2, 0)),
        (PREDICTED, 0.2, {"stride": 4}, (1, 4, 0)),
        (PREDICTED, 0.2, {"divisions": 2}, (1, 2, 0)),
        (PREDICTED, 0.45, {"order": 0}, (1, 4, 0)),
        (PREDICTED, 0.46, {"order": 0}, (1, 2, 0)),
        (DOUBLING, 3.0, {}, (1, 2, 0)),  # Richardson: the error of two halves is a third of the difference
        (DOUBLING, 3.01, {}, (0, 2, 0)),
        (DOUBLING, 0.27, {}, (1, 4, 0)),
        (DOUBLING, 0.28, {}, (1, 2, 0)),
        (DOUBLING, 1.01, {"order": 0}, (0, 2, 0)),
        (DOUBLING, 7.0, {"order": 2}, (1, 2, 0)),
    ],
)
def test_a_step_of_two_divisions_is_judged_by_its_largest_error(control, error, fields, expected):
    """Three elements of size 2, 1 and 1, of which the last is not judged; tolerance 0.1."""
    vectors = elements([2.0, -1.0, 1.0], [2.0 + 0.01, -1.0 + 0.1 * error, 50.0])
    calls = Calls()
    own = {"order": 1, "least": 1, "stride": 2, "divisions": 8, "tick": 6, **fields}
    now = state(
        control=control,
        tolerance=0.1 * (1 + 1e-12),
        vectors=vectors.ctypes.data,
        elements=3,
        judged=calls.array([0, 1]),
        judged_count=2,
        **own,
    )
    assert (stepping.judge(now, 2), now.stride, now.missed) == expected
    assert now.passed == 2
    assert now.missed_tick == 6 * now.missed
    if np.isnan(error):
        vectors[COMPARED, :2] = np.nan, -1.0
        assert stepping.judge(now, 2) == 0, "whatever the elements after it say"
    if now.missed:
        now.tick = 7
        stepping.judge(now, 2)
        assert (now.missed, now.missed_tick) == (2, 6)


def test_a_step_that_is_judged_by_energy_is_always_kept(monkeypatch):
    chosen = []
    monkeypatch.setattr(stepping, "choose_step", lambda *given: chosen.append(given))
    now = state(control=RESIDUAL)
    assert stepping.judge(now, 4) == 1
    assert chosen == [(now, 4)]


def test_the_size_of_an_element_is_its_largest_value():
    vectors = elements([-3.0, 0.5, 1e301], scale=[2.0, 1.0, 4.0])
    calls = Calls()
    own = state(vectors=vectors.ctypes.data, elements=3, moving=calls.array([0, 1, 2]), moving_count=3, floor=0.1)
    assert [implicit_step.size_of(own, i) for i in range(2)] == [3.0, 1.0]
    own.floor = 1.5
    assert [implicit_step.size_of(own, i) for i in range(2)] == [3.0, 1.5]
    stepping.update_scales(own)
    assert vectors[SCALE].tolist() == [3.0, 1.0, 4.0], "a number that is hardly finite is no size"


def test_a_step_that_is_taken_back_is_counted_and_followed_by_a_shorter_one():
    own = state(stride=8, limited=1, rejected=2)
    assert stepping.shorten(own, 4) == 0
    assert (own.stride, own.limited, own.rejected) == (4, 0, 3)
    stepping.shorten(own, 0)
    assert own.stride == 1


def implicit(now, guess, scale=1.0, **fields):
    """State of torn connections: elements 0 and 2 of three."""
    vectors, calls = elements(now, guess=guess, scale=scale), Calls()
    solver = np.zeros((3 + 2 * DEPTH + 1) * 2 + 4 + DEPTH * (DEPTH + 2))
    own = state(
        vectors=vectors.ctypes.data,
        elements=3,
        torn=calls.array([0, 2]),
        torn_count=2,
        solver=solver.ctypes.data,
        coupling_tolerance=0.5,
        **fields,
    )
    own.memory = vectors, solver, calls
    return own


def test_the_difference_of_an_iteration_is_relative_to_sizes_and_tolerance():
    own = implicit([1.0, 9.0, -4.0], [0.5, 0.0, 0.0], [1.0, 1.0, 8.0])  # differences 0.5 and -4
    solver = own.memory[1]
    assert implicit_step.difference(own, own.solver) == 1.0
    assert solver[:2].tolist() == [0.5, -4.0]
    own.memory[0][0, 2] = -6.0
    assert implicit_step.difference(own, own.solver) == pytest.approx(6.0 / 8.0 / 0.5)
    assert implicit_step.product(own, own.solver, own.solver + 8) == 0.5 * -6.0 + (-6.0 / 8.0) * (0.0 / 8.0)
    implicit_step.step_by(own, own.solver, 2.0)
    assert own.memory[0][END].tolist() == [1.5, 0.0, -12.0]


@pytest.mark.parametrize("element", [0, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_never_agrees(element, value):
    own = implicit([1.0] * 3, [1.0] * 3)
    assert implicit_step.difference(own, own.solver) == 0.0
    own.memory[0][0, element] = value
    assert implicit_step.difference(own, own.solver) > 1.0


def iterate(accelerate, own, function, count):
    """Fixed-point iterations of `function` of the two guesses; the guesses after each."""
    vectors, found = own.memory[0], []
    for k in range(count):
        vectors[0, [0, 2]] = function(vectors[END, [0, 2]])
        implicit_step.difference(own, own.solver)
        accelerate(own, k)
        found.append(vectors[END, [0, 2]].copy())
    return found


MATRIX, RIGHT = np.array([[0.5, -0.8], [0.9, 0.2]]), np.array([1.0, -2.0])


def linear(x):
    return MATRIX @ x + RIGHT


def test_anderson_solves_two_linear_equations_in_three_iterations():
    """As GMRES does: Walker and Ni 2011, theorem 2.2."""
    own = implicit([0.0] * 3, [0.0] * 3)
    found = iterate(implicit_step.anderson, own, linear, 4)
    np.testing.assert_allclose(found[0], RIGHT)
    np.testing.assert_allclose(found[2], np.linalg.solve(np.eye(2) - MATRIX, RIGHT), rtol=1e-9)


def test_anderson_is_as_fast_for_small_differences():
    """Its regularization is relative to the largest product of differences, here 1e-20."""
    own = implicit([0.0] * 3, [0.0] * 3)
    found = iterate(implicit_step.anderson, own, lambda x: MATRIX @ x + 1e-10 * RIGHT, 4)
    np.testing.assert_allclose(found[2], 1e-10 * np.linalg.solve(np.eye(2) - MATRIX, RIGHT), rtol=1e-9)


def test_aitken_follows_irons_and_tuck():
    own, relaxations = implicit([0.0] * 3, [0.0] * 3, [1.0, 1.0, 1.0], floor=1e300), [1.0]
    own.floor = 100.0  # one size for all, so that products are plain ones

    def step(state, k):
        relaxations.append(implicit_step.aitken(state, k, relaxations[-1]))

    found = iterate(step, own, linear, 4)
    x, before, relaxation = np.zeros(2), None, 1.0
    for k in range(4):
        residual = linear(x) - x
        if k:
            change = residual - before
            relaxation *= -(before @ change) / (change @ change)
        x, before = x + relaxation * residual, residual
        np.testing.assert_allclose(found[k], x, rtol=1e-12)
        assert relaxations[k + 1] == pytest.approx(relaxation)


@pytest.mark.parametrize(
    ("fields", "calls"),
    [
        ({}, ["read_connections", "begin", "sweep", "move"]),
        ({"outputs_current": 1}, ["begin", "sweep", "move"]),
        ({"recalls": 1}, ["read_connections", "begin", "prepare", "sweep", "move", "end"]),
        (
            {"recalls": 1, "control": PREDICTED},
            ["read_connections", "begin", "prepare", "predict", "sweep", "move", "end"],
        ),
        (
            {"recalls": 1, "control": RESIDUAL},
            ["read_connections", "begin", "prepare", "predict", "sweep", "move", "end"],
        ),
        ({"recalls": 1, "control": DOUBLING}, ["read_connections", "begin", "prepare", "sweep", "move", "end"]),
        ({"max_iterations": 5}, ["save_state", "read_connections", "begin", "solve"]),
        ({"max_iterations": 1, "recalls": 1}, ["save_state", "read_connections", "begin", "prepare", "solve", "end"]),
    ],
)
def test_parts_of_an_attempt(fields, calls, monkeypatch):
    names = "save_state read_connections begin prepare predict sweep solve end"
    script = Script(monkeypatch, implicit_step, names, vectors=1000, elements=3, feedback=ADDRESS, **fields)
    monkeypatch.setattr(implicit_step, "move", lambda address: script.journal.append(("move", address)))
    assert implicit_step.attempt(script.state, 3.0, 0.5, 1) == 0
    assert [entry[0] for entry in script.journal] == calls
    arguments = {name: tuple(values) for name, *values in script.journal}
    expected = {"sweep": (3.0, 0.5), "solve": (3.0, 0.5, 1), "move": (ADDRESS,), "prepare": (0.5,), "end": (0.5,)}
    expected |= {"save_state": (1,), "predict": (1000 + 8 * COMPARED * 3,), "begin": (), "read_connections": ()}
    assert arguments == {name: expected[name] for name in calls}
    assert script.state.outputs_current == 1
    if "solve" in calls:
        script.journal.clear()
        implicit_step.attempt(script.state, 3.0, 0.5, 0)
        assert script.journal[0] == ("begin",), "slot 0 is saved already"


@pytest.mark.parametrize(
    ("name", "status", "result", "is_ended"),
    [
        ("save_state", DISCARD, ERROR, False),
        ("solve", WARNING, WARNING, True),
        ("solve", DISCARD, DISCARD, False),
        ("solve", UNSOLVED, UNSOLVED, True),
        ("sweep", WARNING, WARNING, True),
        ("sweep", DISCARD, DISCARD, False),
    ],
)
def test_an_attempt_that_fails_has_no_end(name, status, result, is_ended, monkeypatch):
    names = "save_state read_connections begin prepare predict sweep solve end"
    fields = {"max_iterations": 0 if name == "sweep" else 5, "recalls": 1, "status": ERROR}
    script = Script(monkeypatch, implicit_step, names, {name: [status]}, **fields)
    monkeypatch.setattr(implicit_step, "move", lambda _: None)
    assert implicit_step.attempt(script.state, 3.0, 0.5, 1) == result
    assert (("end", 0.5) in script.journal) == is_ended == bool(script.state.outputs_current)
