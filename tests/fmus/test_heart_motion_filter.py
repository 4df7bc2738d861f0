"""The equations of the heart motion filter, beside filterpy's and numpy's."""

from types import SimpleNamespace

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from fmus.dense import cholesky, eigenvectors, solve
from fmus.heart_motion.model import HeartMotion
from fmus.quasi_periodic import BREATH, BREATH_MEMORY, BREATH_RATE, OFFSET, PHASE, QUADRATURE, RATE, N, ahead, predict
from fmus.unscented import average, correct

from tests.every_case import every_case
from twin.component import OK

H = 4e-3
NOISE = 0.6e-3


def positive_definite(n, seed):
    a = np.random.default_rng(seed).normal(size=(n, n))
    return a @ a.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("n", [1, 3, 7, 13])
def test_cholesky_and_solve(n):
    matrix = positive_definite(n, n)
    lower = np.full((n, n), np.nan)
    assert cholesky(matrix, lower, n)
    np.testing.assert_allclose(lower, np.linalg.cholesky(matrix), atol=1e-12)
    right = np.arange(1.0, n + 1.0)
    x = right.copy()
    solve(lower, x, n)
    np.testing.assert_allclose(matrix @ x, right, atol=1e-9)


def test_cholesky_says_what_is_not_positive_definite():
    lower = np.zeros((2, 2))
    assert not cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]), lower, 2)
    assert not cholesky(np.full((2, 2), np.nan), lower, 2)


@every_case("seed", range(20))
@every_case("n", [2, 3, 4])
def test_eigenvectors(n, seed):
    matrix = positive_definite(n, seed)
    values, vectors = matrix.copy(), np.full((n, n), np.nan)
    eigenvectors(values, vectors, n)
    np.testing.assert_allclose(values, np.diag(np.diag(values)), atol=1e-12)
    np.testing.assert_allclose(vectors @ np.diag(np.diag(values)) @ vectors.T, matrix, atol=1e-12)
    np.testing.assert_allclose(np.sort(np.diag(values)), np.linalg.eigvalsh(matrix), atol=1e-12)


def test_eigenvectors_of_equal_values_and_of_diagonals():
    for matrix in (np.eye(3), np.diag([3.0, 1.0, 2.0]), np.zeros((3, 3)), np.ones((3, 3))):
        values, vectors = matrix.copy(), np.empty((3, 3))
        eigenvectors(values, vectors, 3)
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(vectors @ np.diag(np.diag(values)) @ vectors.T, matrix, atol=1e-12)


def mean_and_covariance():
    """A filter somewhere in the middle of its work."""
    mean = np.array([0.2e-3, 1e-3, -2e-3, 1.5, 2 * np.pi * 1.2, 0.7, 4e-3, 0.3e-3, -1.9e-3, 0.4e-3, 0, 0.1e-3, 0.05e-3])
    size = np.array([1e-3, 1e-3, 1e-3, 0.2, 0.2, 0.1, *(0.3e-3,) * 7])
    return mean, np.outer(size, size) * (0.8 * np.eye(N) + 0.2)


def moved(x, h):
    """The state after h, as the equations say."""
    c, s = np.cos(x[BREATH_RATE] * h), np.sin(x[BREATH_RATE] * h)
    new = x.copy()
    new[BREATH] = c * x[BREATH] + s * x[QUADRATURE]
    new[QUADRATURE] = c * x[QUADRATURE] - s * x[BREATH]
    usual = 2 * np.pi * 0.25
    new[BREATH_RATE] = usual + np.exp(-h / BREATH_MEMORY) * (x[BREATH_RATE] - usual)
    new[PHASE] = x[PHASE] + h * x[RATE]
    return new


def displaced(x):
    """The motion, as the equations say."""
    i = np.arange(2, 5)
    higher = x[7::2] @ np.sin(i * x[PHASE]) + x[8::2] @ np.cos(i * x[PHASE])
    return np.array([x[OFFSET] + x[BREATH] + x[6] * np.sin(x[PHASE]) + higher])


@pytest.mark.slow
def test_the_filter_is_that_of_filterpy():
    """Points of equal weight are Merwe's for alpha 1, beta 0, kappa 0."""
    part = HeartMotion()
    mean, covariance = mean_and_covariance()
    part.mean[:], part.covariance[:] = mean, covariance

    points = MerweScaledSigmaPoints(N, alpha=1.0, beta=0.0, kappa=0.0)
    other = UnscentedKalmanFilter(dim_x=N, dim_z=1, dt=H, hx=displaced, fx=moved, points=points)
    other.x, other.P, other.R = mean.copy(), covariance.copy(), np.array([[NOISE**2]])
    breath = 2 * np.pi * part.breath_deviation * np.sqrt(2 / BREATH_MEMORY)
    walks = [
        part.offset_process_noise,
        part.breath_process_noise,
        part.breath_process_noise,
        breath,
        2 * np.pi * part.rate_process_noise,
        part.phase_process_noise,
    ]
    other.Q = H * np.diag([*walks, *(part.amplitude_process_noise,) * 7]) ** 2

    scale = np.sqrt(np.diag(covariance))
    chance = np.random.default_rng(3)
    for _ in range(50):
        measured = chance.normal() * 2e-3
        assert predict(part, H)
        expected, variance = average(part.values, N)
        innovation = measured - expected
        correct(part.points, part.values, part.mean, part.covariance, part.gain, innovation, variance + NOISE**2, N)
        other.predict()
        other.update(np.array([measured]))
        np.testing.assert_allclose(part.mean / scale, other.x / scale, atol=1e-9)
        np.testing.assert_allclose(
            part.covariance / np.outer(scale, scale), other.P / np.outer(scale, scale), atol=1e-9
        )
    assert variance + NOISE**2 == pytest.approx(other.S[0, 0], rel=1e-9)


def test_what_is_ahead_is_what_prediction_reaches():
    part = HeartMotion()
    part.mean[:] = mean_and_covariance()[0]
    x = part.mean.copy()
    for _ in range(25):
        x = moved(x, H)
    position, velocity, _ = ahead(part, 25 * H, 0.0)
    assert position == pytest.approx(displaced(x)[0], abs=2e-5)  # respiration's rate returns a little on the way
    before, after = (ahead(part, 25 * H + step, 0.0)[0] for step in (-1e-5, 1e-5))
    assert velocity == pytest.approx((after - before) / 2e-5, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(more, marks=pytest.mark.slow) for more in (1, 2))])
def test_it_tracks_as_well_as_filterpy_from_the_same_start(native, seed):
    """Both filters over eight seconds of a wandering beat: the same estimates."""
    chance = np.random.default_rng(seed)
    times = np.arange(round(14.0 / H)) * H
    turns = 2 * np.pi * (1.2 * times + 0.03 * np.sin(0.5 * times))
    wall = 4e-3 * np.sin(turns) + 2e-3 * np.sin(2 * turns + 2.8) + 0.4e-3 * np.sin(3 * turns + 2.8)
    part = native(HeartMotion, noise=NOISE)
    part.start(0.0)
    other = None
    found = SimpleNamespace(ours=[], theirs=[])
    for k, t in enumerate(times):
        before, level = part.mode, float(part.level)
        part.tip_position[2] = wall[k] + 0.5e-3 * chance.normal()
        assert part.advance(t, H) == OK
        if other is None:
            if before == 1:  # it follows: the other begins where it is
                points = MerweScaledSigmaPoints(N, alpha=1.0, beta=0.0, kappa=0.0)
                other = UnscentedKalmanFilter(dim_x=N, dim_z=1, dt=H, hx=displaced, fx=moved, points=points)
                other.x, other.P = part.mean.copy(), part.covariance.copy()
                breath = 2 * np.pi * part.breath_deviation * np.sqrt(2 / BREATH_MEMORY)
                walks = [part.offset_process_noise, part.breath_process_noise, part.breath_process_noise, breath]
                walks += [
                    2 * np.pi * part.rate_process_noise,
                    part.phase_process_noise,
                    *(part.amplitude_process_noise,) * 7,
                ]
                other.Q = H * np.diag(walks) ** 2
            continue
        other.predict()
        other.update(np.array([part.sample]), R=level)
        found.ours.append(displaced(part.mean)[0])
        found.theirs.append(displaced(other.x)[0])
    difference = np.array(found.ours) - np.array(found.theirs)
    assert len(difference) > 2000
    assert np.abs(difference).max() < 1e-6
