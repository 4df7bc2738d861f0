"""Filters: the Kalman filter where the model is linear, the falling body of the literature, bounds."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from twin.follow.filters import Ensemble, Extended, Unscented

FREE = np.full(3, np.inf)
F = np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.1], [0.0, -0.2, 0.9]])
H = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 1.0]])
NOISE, WALK = np.array([0.3, 0.2]), np.array([0.01, 0.05, 0.1])
MEAN, DEVIATION = np.array([1.0, -1.0, 0.5]), np.array([0.5, 1.0, 2.0])


def kalman(measurements):
    """The Kalman filter; process noise enters at the begin of an interval."""
    mean, covariance = MEAN, np.diag(DEVIATION**2)
    for measured in measurements:
        mean, covariance = F @ mean, F @ (covariance + np.diag(WALK**2)) @ F.T
        expected = H @ covariance @ H.T + np.diag(NOISE**2)
        gain = covariance @ H.T @ np.linalg.inv(expected)
        innovation = measured - H @ mean
        nis = innovation @ np.linalg.solve(expected, innovation)
        mean, covariance = mean + gain @ innovation, (np.eye(3) - gain @ H) @ covariance
        yield mean, covariance, nis


def filtered(filter_, measurements):
    for measured in measurements:
        points = filter_.spread(WALK) @ F.T
        update = filter_.update(points, points @ H.T, measured, NOISE)
        yield filter_.mean, filter_.covariance, update.nis


def test_the_unscented_filter_of_a_linear_model_is_the_kalman_filter():
    measurements = np.random.default_rng(1).normal(size=(40, 2))
    for wanted, found in zip(
        kalman(measurements), filtered(Unscented(MEAN, DEVIATION, -FREE, FREE), measurements), strict=True
    ):
        for one, other in zip(wanted, found, strict=True):
            assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


def test_a_large_ensemble_of_a_linear_model_tends_to_the_kalman_filter():
    measurements = np.random.default_rng(1).normal(size=(20, 2))
    (*_, wanted), (*_, found) = (
        list(kalman(measurements)),
        list(filtered(Ensemble(MEAN, DEVIATION, -FREE, FREE, 5_000, 0), measurements)),
    )
    deviation = np.sqrt(np.diag(wanted[1]))
    assert np.all(abs(found[0] - wanted[0]) < 0.05 * deviation)
    assert np.sqrt(np.diag(found[1])) == pytest.approx(deviation, rel=0.03)


# Falling body: Athans, Wishner and Bertolini, IEEE Trans. Autom. Control 13(5), 1968; values as in Julier, Uhlmann and
# Durrant-Whyte, IEEE Trans. Autom. Control 45(3), 2000
GAMMA, RADAR_HEIGHT, RADAR_DISTANCE = 5e-5, 1e5, 1e5  # [1/ft], [ft], [ft]
TRUE = np.array([3e5, 2e4, 1e-3])
GUESS, GUESS_DEVIATION = np.array([3e5, 2e4, 3e-5]), np.array([1e3, 2e3, 1e-2])


def fall(x, steps=64):
    """One second by Runge and Kutta: altitude [ft], speed downwards [ft/s], ballistic coefficient."""

    def slope(x):
        return np.array([-x[1], -np.exp(-GAMMA * x[0]) * x[1] ** 2 * x[2], 0.0])

    for _ in range(steps):
        h = 1.0 / steps
        k1 = slope(x)
        k2 = slope(x + h / 2 * k1)
        k3 = slope(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3))
    return x


def distance(x):
    return np.array([np.hypot(RADAR_DISTANCE, x[0] - RADAR_HEIGHT)])


@pytest.mark.slow
def test_the_falling_body_of_the_literature():
    random = np.random.default_rng(3)
    points = MerweScaledSigmaPoints(3, alpha=1.0, beta=0.0, kappa=1.0)
    reference = UnscentedKalmanFilter(3, 1, 1.0, distance, lambda x, _: fall(x), points)
    reference.x, reference.P = GUESS.copy(), np.diag(GUESS_DEVIATION**2)
    reference.Q, reference.R = np.zeros((3, 3)), np.array([[1e4]])
    own = Unscented(GUESS, GUESS_DEVIATION, -FREE, FREE)
    true = TRUE
    for _ in range(30):
        true = fall(true)
        measured = distance(true) + 100.0 * random.standard_normal(1)
        moved = np.array([fall(x) for x in points.sigma_points(reference.x, reference.P)])
        reference.predict()
        reference.sigmas_f = moved  # filterpy draws them anew, which is not needed without process noise
        reference.update(measured)
        moved = np.array([fall(x) for x in own.spread(np.zeros(3))])
        own.update(moved, np.array([distance(x) for x in moved]), measured, np.array([100.0]))
        assert own.mean == pytest.approx(reference.x, rel=1e-6)
        assert own.covariance == pytest.approx(reference.P, rel=1e-5, abs=1e-12)
    assert np.all(abs(own.mean - true) < 3.0 * own.deviation)
    assert own.deviation[0] < 100.0


@pytest.mark.parametrize("make", [Unscented, lambda *bounds: Ensemble(*bounds, 30, 0)])
def test_estimates_keep_their_bounds(make):
    low, high = np.array([0.9, -2.0, 0.0]), np.array([1.1, 2.0, 0.6])
    filter_ = make(MEAN, DEVIATION, low, high)
    for measured in np.random.default_rng(1).normal(scale=5.0, size=(10, 2)):
        points = filter_.spread(WALK)
        assert np.all((points >= low) & (points <= high))
        moved = np.clip(points @ F.T, low, high)
        filter_.update(moved, moved @ H.T, measured, NOISE)
        assert np.all((filter_.mean >= low) & (filter_.mean <= high))


@pytest.mark.parametrize("make", [Unscented, Extended, lambda *bounds: Ensemble(*bounds, 200, 0)])
def test_an_estimate_leaves_its_bound_again(make):
    """Its deviation at the bound is at least that of the Kalman filter, 0.1 / sqrt(n), and never zero."""
    noise, random = np.array([0.1]), np.random.default_rng(1)
    filter_ = make(np.array([0.5]), np.array([0.5]), np.zeros(1), np.full(1, np.inf))
    for true in 40 * [-1.0] + 400 * [1.0]:
        points = filter_.spread(np.zeros(1))
        filter_.update(points, points.copy(), true + noise * random.standard_normal(1), noise)
        if true == -1.0:
            at_bound = filter_.mean, filter_.deviation
    assert at_bound[0] == 0.0
    assert 0.98 * 0.1 / np.sqrt(40.0) < at_bound[1] < 0.1
    assert filter_.mean == pytest.approx(1.0, abs=0.2)


def test_a_measurement_without_information_changes_no_estimate_at_its_bound():
    filter_ = Unscented(np.zeros(2), np.ones(2), np.zeros(2), FREE[:2])
    for _ in range(5):
        points = filter_.spread(np.zeros(2))
        filter_.update(points, np.zeros((5, 1)), np.zeros(1), np.ones(1))
    assert filter_.mean == pytest.approx([0.0, 0.0], abs=1e-12)
    assert filter_.covariance == pytest.approx(np.eye(2))


def test_spread_of_an_estimate():
    """Standard deviations are roots of the covariance's diagonal; those of an ensemble count one point less."""
    root = np.array([[3.0, 4.0], [0.0, 2.0]])
    own = Unscented(np.zeros(2), np.ones(2), -FREE[:2], FREE[:2])
    own.root = root
    assert own.deviation == pytest.approx([5.0, 2.0])
    assert own.covariance == pytest.approx(np.array([[25.0, 8.0], [8.0, 4.0]]))
    points = Ensemble(np.zeros(2), np.ones(2), np.array([-9.0, 0.5]), FREE[:2], 3, 0)
    points.points = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]])
    assert points.mean == pytest.approx([2.0, 0.5])  # within the bounds
    assert points.deviation == pytest.approx([7.0**0.5, 0.0])
    assert points.covariance == pytest.approx(np.array([[7.0, 0.0], [0.0, 0.0]]))
    assert points.draw(np.random.default_rng(0), 5)[:, 0].tolist() == [0.0, 1.0, 5.0, 0.0, 1.0]
