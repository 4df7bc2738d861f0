"""Iterations of a coupled step on a linear coupling in memory, where theory says in how many of them they end.

The torn connections are some elements among others, out of order: an address that is off by one element is noticed.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from twin.coupling.variable_step import implicit_step
from twin.coupling.variable_step.record_layout import (
    AITKEN,
    ANDERSON,
    ASKING,
    DEPTH,
    END,
    FIXED,
    NEWTON,
    PREDICTED,
    RELAXED,
    UNSOLVED,
)

ELEMENTS = 7
TORN = {1: [4], 2: [5, 1], 3: [6, 0, 3], 4: [2, 6, 1, 4]}
H = 1e-3


class Linear:
    """What torn connections give by their guesses x: `gain @ x + constant`, as the record that a walk works on."""

    def __init__(self, monkeypatch, m, scheme, seed=0, reach=0.6, **changes):
        random = np.random.default_rng(seed)
        gain = random.normal(size=(m, m))
        self.gain = reach * gain / max(abs(np.linalg.eigvals(gain)))
        self.constant = random.normal(size=m) + 3.0
        self.exact = np.linalg.solve(np.eye(m) - self.gain, self.constant)
        self.torn = np.array(TORN[m], np.int64)
        self.vectors = random.normal(size=(5, ELEMENTS))
        self.vectors[END, self.torn] = 0.0
        self.others = np.setdiff1d(np.arange(ELEMENTS), self.torn)
        self.untouched = self.vectors[:, self.others].copy()
        self.memory = np.full(3 * m + max(2 * m * DEPTH + DEPTH * DEPTH + 2 * DEPTH, m * m + m), 9e9)
        self.sweeps = self.returns = 0
        self.failing, self.refusing = {}, {}  # status by the number of the sweep, of the rollback
        address = self.vectors.ctypes.data
        self.record = SimpleNamespace(
            vectors=address,
            elements=ELEMENTS,
            torn=self.torn.ctypes.data,
            torn_count=m,
            solver=self.memory.ctypes.data,
            scheme=scheme,
            max_iterations=50,
            coupling_tolerance=1e-10,
            floor=1.0,
            relaxation=0.7,
            control=FIXED,
            derives=0,
            jacobian=0,
            linear_at=0.0,
            status=0,
            feedback=0,
            **changes,
        )
        for name in ("predict", "move"):
            monkeypatch.setattr(implicit_step, name, lambda *_: None)
        monkeypatch.setattr(implicit_step, "sweep", self.sweep)
        monkeypatch.setattr(implicit_step, "restore_state", self.restore_state)

    def sweep(self, _record, _t, h):
        assert h == H
        self.sweeps += 1
        assert self.returns == self.sweeps - 1  # each but the first from where the step began
        self.vectors[0, self.torn] = self.gain @ self.vectors[END, self.torn] + self.constant
        return self.failing.get(self.sweeps, 0)

    def restore_state(self, _record, slot):
        assert slot == 1
        self.returns += 1
        return self.refusing.get(self.returns, 0)

    def run(self):
        status = implicit_step.solve(self.record, 0.5, H, 1)
        assert self.vectors[:, self.others].tobytes() == self.untouched.tobytes()
        return status

    def solved(self, rtol=1e-8):
        assert self.run() == 0
        np.testing.assert_allclose(self.vectors[0, self.torn], self.exact, rtol=rtol)
        return self.sweeps


@pytest.mark.parametrize("m", TORN)
@pytest.mark.parametrize("seed", [0, 1])
def test_newton_needs_one_linearization(m, seed, monkeypatch):
    """One sweep, one per unknown for the differences, and one that confirms; differences leave 1e-10 or so."""
    system = Linear(
        monkeypatch,
        m,
        NEWTON,
        seed,
        reach=3.0,
    )
    system.record.coupling_tolerance = 1e-7
    assert system.solved(1e-6) == m + 2


@pytest.mark.parametrize("m", TORN)
def test_differences_are_the_jacobian(m, monkeypatch):
    system = Linear(monkeypatch, m, NEWTON, reach=3.0)
    system.vectors[END, system.torn] = np.arange(1.0, m + 1.0)
    implicit_step.sweep(system.record, 0.5, H)
    guesses = system.vectors[END].copy()
    assert implicit_step.linearize(system.record, 0.5, H, 1) == 0
    assert (system.record.jacobian, system.record.linear_at) == (1, H)
    assert system.vectors[END].tobytes() == guesses.tobytes()
    right = system.constant - system.vectors[END, system.torn] + system.gain @ system.vectors[END, system.torn]
    system.memory[:m] = right
    implicit_step.newton(system.record)
    np.testing.assert_allclose(system.vectors[END, system.torn], system.exact, rtol=1e-6)


def test_a_singular_jacobian_becomes_a_plain_iteration(monkeypatch):
    system = Linear(monkeypatch, 2, NEWTON)
    system.gain, system.constant = np.eye(2), np.zeros(2)  # every guess is right: differences are exactly 1
    implicit_step.sweep(system.record, 0.5, H)
    assert implicit_step.linearize(system.record, 0.5, H, 1) == 0
    system.memory[:2] = 0.25, -0.5
    before = system.vectors[END, system.torn].copy()
    implicit_step.newton(system.record)
    assert (system.vectors[END, system.torn] - before).tolist() == [0.25, -0.5]


@pytest.mark.parametrize(
    ("derives", "jacobian", "linear_at", "control", "asks"),
    [
        (1, 0, 0.0, FIXED, True),
        (1, 1, H, FIXED, False),
        (1, 1, H / 2, FIXED, True),  # of a step of another length
        (1, 1, H / 2, PREDICTED, False),  # steps that change often make do with a neighbor's
        (0, 0, 0.0, FIXED, False),
        (0, 1, H / 2, FIXED, False),
    ],
)
def test_when_derivatives_are_asked_for(derives, jacobian, linear_at, control, asks, monkeypatch):
    system = Linear(monkeypatch, 2, NEWTON)
    m = 2
    system.memory[3 * m : 3 * m + m * m] = np.eye(m).ravel()
    system.memory[3 * m + m * m : 3 * m + m * m + m].view(np.int64)[:] = [0, 1]
    vars(system.record).update(
        derives=derives, jacobian=jacobian, linear_at=linear_at, control=control, max_iterations=2
    )
    assert (system.run() == ASKING) is asks


@pytest.mark.parametrize("m", TORN)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_anderson_ends_as_many_iterations_after_the_unknowns(m, seed, monkeypatch):
    """On a linear coupling it is GMRES without a restart as long as `DEPTH` differences span the space: Walker and Ni, 2011."""
    system = Linear(monkeypatch, m, ANDERSON, seed, reach=2.0)
    system.record.coupling_tolerance = 1e-6
    assert system.solved(1e-5) <= m + 2


def test_aitken_is_exact_for_one_unknown(monkeypatch):
    """The secant of a straight line: a relaxed step, one by the secant, and one that confirms."""
    system = Linear(monkeypatch, 1, AITKEN, reach=-2.5)
    assert system.solved() == 3
    assert system.record.relaxation == pytest.approx(1.0 / (1.0 - system.gain[0, 0]))


@pytest.mark.parametrize("scheme", [RELAXED, AITKEN, ANDERSON, NEWTON])
def test_all_come_to_the_same_in_less_than_fifty(scheme, monkeypatch):
    system = Linear(monkeypatch, 3, scheme, reach=0.5)
    assert system.solved() <= 40


def test_what_does_not_agree_in_time_is_told(monkeypatch):
    system = Linear(monkeypatch, 2, RELAXED, reach=0.9)
    system.record.max_iterations = 3
    assert system.run() == UNSOLVED
    assert (system.sweeps, system.returns) == (3, 2)


@pytest.mark.parametrize("status", [1, 2, 3])
@pytest.mark.parametrize("scheme", [RELAXED, NEWTON])
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("what", ["failing", "refusing"])
def test_a_status_above_a_warning_ends_the_iterations(what, count, scheme, status, monkeypatch):
    """Sweeps and rollbacks 2 and 3 of Newton's method are those of its differences."""
    system = Linear(monkeypatch, 2, scheme, reach=0.9)
    system.record.max_iterations = 4
    getattr(system, what)[count] = status
    result = system.run()
    if status > 1:
        assert result == status
        assert (system.sweeps, system.returns) == ((count, count - 1) if what == "failing" else (count, count))
    else:
        assert result in (0, UNSOLVED)
        assert system.sweeps >= 4


def test_a_jacobian_is_renewed_when_it_no_longer_helps(monkeypatch):
    """That of a step before: 0 instead of the gain, so that each iteration leaves 0.5 of the difference; 0.3 is too much."""
    for reach, sweeps in ((0.5, 4), (0.25, None)):
        system = Linear(monkeypatch, 1, NEWTON, reach=reach)
        system.gain = np.array([[reach]])
        system.exact = system.constant / (1.0 - reach)
        system.memory[3:4] = 1.0
        system.memory[4:5].view(np.int64)[:] = 0
        vars(system.record).update(jacobian=1, linear_at=H, coupling_tolerance=1e-7)
        total = system.solved(1e-6)
        assert total == sweeps if sweeps else total > 8, "differences that fall fast enough need no new one"


def test_of_no_iterations_at_all_nothing_is_solved(monkeypatch):
    system = Linear(monkeypatch, 1, RELAXED)
    system.record.max_iterations = 0
    assert (system.run(), system.sweeps) == (UNSOLVED, 0)
