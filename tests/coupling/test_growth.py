"""Eigenvalues behind the growth of a deviation: of a map that can be applied, and of responses to it."""

import numpy as np
import pytest
from scipy.sparse.linalg import ArpackNoConvergence

from tests.every_case import every_case
from twin.coupling.stability.growth import DENSE, Growth, largest_eigenvalue
from twin.coupling.stability.growth_by_response import growth_of_responses, realize
from twin.coupling.variable_step.coupling_jacobian import derivatives_over_step
from twin.errors import CouplingError


def matrix_of(values, seed=1):
    """A matrix with given eigenvalues: real ones, and pairs of conjugate ones as (real, imaginary)."""
    size = sum(2 if isinstance(value, tuple) else 1 for value in values)
    blocks, at = np.zeros((size, size)), 0
    for value in values:
        if isinstance(value, tuple):
            blocks[at : at + 2, at : at + 2] = [[value[0], value[1]], [-value[1], value[0]]]
            at += 2
        else:
            blocks[at, at] = value
            at += 1
    basis = np.random.default_rng(seed).normal(size=(size, size))
    return basis @ blocks @ np.linalg.inv(basis)


SPECTRA = [([0.5, -0.9, 0.1], 0.9), ([1.2, 0.3], 1.2), ([(0.6, 0.8), 0.5], 1.0), ([(-0.3, 0.4), 0.2], 0.5)]


@pytest.mark.parametrize(("values", "modulus"), SPECTRA)
def test_the_largest_eigenvalue_of_a_map(values, modulus):
    matrix = matrix_of(values)
    value, vector = largest_eigenvalue(lambda x: matrix @ x, len(matrix))
    assert abs(value) == pytest.approx(modulus)
    np.testing.assert_allclose(matrix @ vector, value * vector, atol=1e-12)


@pytest.mark.parametrize("size", [DENSE, DENSE + 1])
def test_many_values_take_iterations_instead_of_a_matrix(size):
    """The map is applied less often than there are values; both ways find the same."""
    diagonal = np.concatenate([[1.25, -1.1], np.linspace(-0.9, 0.9, size - 2)])
    count = [0]

    def apply(x):
        count[0] += 1
        return diagonal * x.ravel()

    value, vector = largest_eigenvalue(apply, size)
    assert value == pytest.approx(1.25)
    assert np.argmax(np.abs(vector)) == 0
    assert count[0] == size if size == DENSE else count[0] < size


@pytest.mark.parametrize("size", [2, DENSE + 1])
def test_a_map_that_is_not_finite_has_no_eigenvalue(size):
    with pytest.raises(FloatingPointError):
        largest_eigenvalue(lambda x: np.full(size, np.nan), size)


def test_eigenvalues_that_do_not_converge(monkeypatch):
    """Those that do are taken; without any there is no growth to tell."""

    def unconverged(*values):
        def eigs(*_arguments, **_options):
            raise ArpackNoConvergence("too few iterations", np.array(values), np.eye(DENSE + 1, len(values)))

        monkeypatch.setattr("scipy.sparse.linalg.eigs", eigs)
        return largest_eigenvalue(lambda x: x, DENSE + 1)

    value, vector = unconverged(0.5, -1.5)
    assert (value, np.argmax(vector)) == (-1.5, 1)
    with pytest.raises(CouplingError, match=r"stability: no eigenvalue converged\. Linearize fewer members"):
        unconverged()


def responses(matrix, calls):
    """Responses of a map to a deviation, every `stride` steps."""

    def after(count, stride, direction):
        calls.append((count, stride))
        stepped = np.linalg.matrix_power(matrix, stride)
        rows = [direction.ravel()]
        for _ in range(count):
            rows.append(stepped @ rows[-1])
        return np.array(rows[1:])

    return after


@every_case(("values", "modulus"), [*SPECTRA, ([0.995, 0.2], 0.995), ([1.01, 0.3], 1.01)])
def test_the_growth_of_responses_is_that_of_their_map(values, modulus):
    """Near 1 a longer stride is taken, whose growth is that of one step to its power."""
    matrix, calls = matrix_of(values), []
    value, vector = growth_of_responses(responses(matrix, calls), len(matrix))
    assert abs(value) == pytest.approx(modulus, rel=1e-6)
    assert {stride for _, stride in calls} == ({1, 8} if abs(modulus - 1.0) <= 0.02 else {1})
    assert len(calls) == len(matrix) * len({stride for _, stride in calls})
    if abs(modulus - 1.0) > 0.02:
        np.testing.assert_allclose(matrix @ vector, value * vector, atol=1e-6 * np.abs(vector).max())


@pytest.mark.slow
def test_many_values_are_perturbed_in_some_directions_only():
    matrix, calls = np.diag([0.5, *np.linspace(0.0, 0.3, 40)]), []
    value, vector = growth_of_responses(responses(matrix, calls), 41)
    assert abs(value) == pytest.approx(0.5, rel=1e-3)
    assert np.argmax(np.abs(vector)) == 0
    assert len(calls) == 24


def test_responses_that_vanish_or_are_not_finite():
    value, vector = realize(np.zeros((24, 3, 2)))
    assert (value, vector.tolist()) == (0j, [0.0] * 3)
    with pytest.raises(FloatingPointError):
        growth_of_responses(lambda count, _stride, _direction: np.full((count, 2), np.inf), 2)


def test_a_growth_rate_is_the_logarithm_by_the_cycle():
    assert Growth(np.e, 0.5, ()).rate == pytest.approx(2.0)
    assert Growth(1.0, 0.5, ()).rate == 0.0
    assert Growth(0.0, 1.0, ()).rate == pytest.approx(-690.8, abs=0.1)


def test_derivatives_of_outputs_by_inputs_held_over_a_step():
    """A lag of 0.1 s over 0.05 s, with an output that also has a direct part: 3 (1 - exp(-0.5)) + 2."""
    one = np.ones((1, 1))
    found = derivatives_over_step(-10 * one, 10 * one, 3 * one, 2 * one, 0.05)
    assert found == pytest.approx(3 * (1 - np.exp(-0.5)) + 2)
    integrator = derivatives_over_step(0 * one, one, one, 0 * one, 0.25)
    assert integrator == pytest.approx(0.25)
