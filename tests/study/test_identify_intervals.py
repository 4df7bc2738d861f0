"""Intervals of a linear model: all three ways find those of linear regression; influence functions; correlated residuals."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.every_case import every_case
from tests.study.linear import MATRIX, TRUTH, Formula, straight
from twin.identify import Fit, Residuals, estimate_uncertainty
from twin.identify.intervals import inflation, inverse, psi, quantile

NOISE = 0.01
WIDTH = stats.t.ppf(0.95, len(MATRIX) - 2)  # 90 % confidence, 8 values, 2 unknowns
CUBIC = float(min(np.roots([400, 0, 2, -0.2]), key=lambda root: abs(root.imag)).real)  # 2 d + 400 d^3 = 0.2
ERRORS = 0.005 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0])


def optimum(model):
    """Where the sum of squares is least."""
    return np.linalg.lstsq(MATRIX, model.problem.outputs[0].values, rcond=None)[0]


def known(model, method, *, seed=1):
    position, steps = optimum(model), []
    fit = Fit(position, [NOISE])
    return position, estimate_uncertainty(model, fit, method, seed, lambda *step: steps.append(step)), steps


def test_covariance_of_a_linear_model_is_that_of_regression():
    model = straight(ERRORS, noise=NOISE)
    position, knowledge, steps = known(model, "jacobian")
    covariance = NOISE**2 * np.linalg.inv(MATRIX.T @ MATRIX)
    deviations = np.sqrt(np.diag(covariance))
    residuals = (model.problem.outputs[0].values - MATRIX @ position) / NOISE
    assert knowledge.method == "jacobian"
    assert knowledge.covariance == pytest.approx(covariance, rel=1e-6)
    assert knowledge.deviations == pytest.approx(deviations, rel=1e-6)
    assert knowledge.low == pytest.approx(position - WIDTH * deviations, rel=1e-6)
    assert knowledge.high == pytest.approx(position + WIDTH * deviations, rel=1e-6)
    correlation = covariance[0, 1] / deviations.prod()
    assert knowledge.correlation == pytest.approx(np.array([[1.0, correlation], [correlation, 1.0]]), rel=1e-6)
    assert knowledge.residual == pytest.approx(
        np.sqrt(np.sum(residuals**2) / 6)
    )  # less than 1: the stated noise counts
    assert knowledge.residual < 1.0
    assert knowledge.inflation == 1.0
    assert knowledge.effect.tolist() == [True, True]
    assert knowledge.rough.tolist() == [False, False]
    values, directions = np.linalg.eigh(covariance)
    assert knowledge.singular == pytest.approx(np.sqrt(values), rel=1e-6)  # the best known first
    assert np.abs(np.sum(knowledge.directions * directions.T, axis=1)) == pytest.approx([1.0, 1.0])
    assert set(steps) == {("covariance", 0.0)}


@pytest.mark.parametrize(("noise", "factor"), [(NOISE, 1.0), (NOISE / 10, 100.0), (None, 1.0)])
def test_residuals_larger_than_the_noise_widen_the_intervals(noise, factor):
    """With stated noise they never narrow them; without, the residuals alone count."""
    model = straight(ERRORS, noise=noise)
    position = optimum(model)
    sigma = noise or NOISE
    knowledge = estimate_uncertainty(model, Fit(position, [sigma]), "jacobian", 1, lambda *_: None)
    residual = float(np.sqrt(np.sum((model.problem.outputs[0].values - MATRIX @ position) ** 2) / 6))
    assert knowledge.residual == pytest.approx(residual / sigma)
    variance = sigma**2 if factor == 1.0 and noise else residual**2
    assert knowledge.covariance == pytest.approx(variance * np.linalg.inv(MATRIX.T @ MATRIX), rel=1e-5)


@pytest.mark.parametrize("noise", [NOISE, None])
@pytest.mark.parametrize("method", ["jacobian", "profile"])
def test_weights_change_the_estimate_and_not_the_noise(noise, method):
    """Linear regression with weights that are not those of the noise: its covariance is known, and far from the usual one."""
    weights = np.repeat([10.0, 1.0], len(MATRIX))
    first = MATRIX + np.array([0.3, -0.2])
    matrix = np.vstack([first, MATRIX])
    measured = matrix @ TRUTH + np.tile(ERRORS, 2)
    model = Formula(lambda x: [first @ x, MATRIX @ x], [*measured.reshape(2, -1)], noise=[noise, noise])
    object.__setattr__(model.problem.outputs[0], "weight", 10.0)
    position = np.linalg.lstsq(weights[:, None] * matrix, weights * measured, rcond=None)[0]
    sigma = NOISE if noise else np.sqrt(np.sum((measured - matrix @ position) ** 2) / (len(measured) - 2))
    gain = np.linalg.solve(matrix.T @ (weights[:, None] ** 2 * matrix), matrix.T * weights**2)
    deviations = sigma * np.sqrt(np.diag(gain @ gain.T))
    knowledge = estimate_uncertainty(model, Fit(position, [NOISE, NOISE]), method, 1, lambda *_: None)
    assert knowledge.deviations == pytest.approx(deviations, rel=1e-5)
    width = quantile(Residuals(model, [NOISE, NOISE])) * deviations
    assert knowledge.high - position == pytest.approx(width, rel=0.02)
    assert position - knowledge.low == pytest.approx(width, rel=0.02)


@pytest.mark.parametrize("errors", [ERRORS, 10 * ERRORS])
def test_profiles_of_a_linear_model_end_where_regression_says(errors):
    """The cost is a parabola: at a third of the way it has risen by a ninth of the limit."""
    model = straight(errors, noise=NOISE)
    position, wanted, _ = known(model, "jacobian")
    _, knowledge, steps = known(model, "profile")
    assert knowledge.method == "profile"
    assert knowledge.low == pytest.approx(wanted.low, abs=0.015 * np.max(wanted.high - wanted.low))
    assert knowledge.high == pytest.approx(wanted.high, abs=0.015 * np.max(wanted.high - wanted.low))
    for i, profile in knowledge.profiles.items():
        half = (wanted.high[i] - wanted.low[i]) / 2
        assert profile.above == pytest.approx(((profile.positions - position[i]) / half) ** 2, abs=2e-3)
        low, high = knowledge.low[i], knowledge.high[i]
        parts = [position[i] + part * (end - position[i]) for end in (low, high) for part in (0.0, 1 / 3, 2 / 3, 1.0)]
        assert all(np.min(np.abs(profile.positions - part)) < 1e-12 for part in parts)
        assert np.all(np.diff(profile.positions) > 0)
    assert list(dict.fromkeys(steps))[1:] == [
        ("profile of m.p0", 0.0),
        ("profile of m.p0", 0.25),
        ("profile of m.p1", 0.5),
        ("profile of m.p1", 0.75),
    ]


def test_a_profile_that_reaches_its_bound_is_open_there():
    """One unknown is measured so badly that its lower bound is as likely; the other changes nothing."""
    model = Formula(lambda x: [np.full(8, x[0])], [0.05 + 0.3 * np.array([1.0, -1.0] * 4)], noise=0.3)
    position = np.array([0.05, 0.5])
    fit = Fit(position, [0.3])
    knowledge = estimate_uncertainty(model, fit, "profile", 1, lambda *_: None)
    assert np.isnan(knowledge.low[0])
    width = WIDTH * 0.3 * np.sqrt(8 / 6) / np.sqrt(8)
    assert knowledge.high[0] == pytest.approx(0.05 + width, rel=0.02)
    assert knowledge.effect.tolist() == [True, False]
    assert np.isnan([knowledge.low[1], knowledge.high[1]]).all()
    assert list(knowledge.profiles) == [0]
    assert knowledge.profiles[0].positions[0] == 0.0
    assert knowledge.correlation.tolist() == [[1.0, 0.0], [0.0, 1.0]]


@every_case(
    ("width", "function", "low", "high"),
    [
        (0.9, lambda x: np.exp(10 * (x - 0.5)), 0.5 + np.log(0.1) / 10, 0.5 + np.log(1.9) / 10),
        (0.5, lambda x: np.exp(10 * (x - 0.5)), 0.5 + np.log(0.5) / 10, 0.5 + np.log(1.5) / 10),
        (1.1, lambda x: np.exp(10 * (x - 0.5)), np.nan, 0.5 + np.log(2.1) / 10),  # nothing is 1.1 below
        (0.2, lambda x: 2.0 * x + 400 * (x - 0.5) ** 3, 0.5 - CUBIC, 0.5 + CUBIC),
        (1e-4, lambda x: x, 0.5 - 1e-4, 0.5 + 1e-4),
    ],
)
def test_profiles_of_a_curved_model_end_at_their_limit(width, function, low, high):
    """The mean of eight values is known to `width`: the interval ends where the model is as far from its best value."""
    quantile_of_one = stats.t.ppf(0.95, 7)
    noise = width * np.sqrt(8) / quantile_of_one
    errors = 0.5 * noise * np.array([1.0, -1.0] * 4)  # smaller than stated
    model = Formula(lambda x: [np.full(8, function(x[0]))], [function(0.5) + errors], noise=noise, unknowns=1)
    knowledge = estimate_uncertainty(model, Fit(np.array([0.5]), [noise]), "profile", 1, lambda *_: None)
    found = [knowledge.low[0], knowledge.high[0]]
    for end, wanted in zip(found, (low, high), strict=True):
        if np.isnan(wanted):
            assert np.isnan(end)
        else:
            assert abs(function(end) - function(0.5)) == pytest.approx(width, rel=0.011)
            assert end - 0.5 == pytest.approx(wanted - 0.5, rel=0.03)
    (profile,) = knowledge.profiles.values()
    above = ((function(profile.positions) - function(0.5)) / width) ** 2
    assert profile.above == pytest.approx(above, rel=1e-6, abs=1e-9)


def test_bootstrap_of_a_linear_model_spreads_as_regression_says(monkeypatch):
    monkeypatch.setattr("twin.identify.intervals.RESAMPLED", 40)
    model = straight(np.random.default_rng(2).normal(0.0, NOISE, 8), noise=None)
    position, wanted, _ = known(model, "jacobian")
    _, knowledge, steps = known(model, "bootstrap")
    assert knowledge.method == "bootstrap"
    assert knowledge.samples.shape == (40, 2)
    assert np.std(knowledge.samples, axis=0) == pytest.approx(wanted.deviations, rel=0.3)
    assert np.mean(knowledge.samples, axis=0) == pytest.approx(position, abs=0.3 * np.max(wanted.deviations))
    ends = np.quantile(knowledge.samples, [0.05, 0.95], axis=0)
    assert np.array([knowledge.low, knowledge.high]) == pytest.approx(ends)
    assert steps[-1] == ("bootstrap", 39 / 40)
    # each sample is the regression of the model's values with residuals drawn anew, as wide as their degrees of freedom
    residuals = model.problem.outputs[0].values - MATRIX @ position
    residuals = (residuals - residuals.mean()) * np.sqrt(8 / 6)
    generator = np.random.default_rng(1)
    for sample in knowledge.samples[:3]:
        drawn = MATRIX @ position + residuals[generator.integers(0, 8, 8)]
        assert sample == pytest.approx(np.linalg.lstsq(MATRIX, drawn, rcond=None)[0], abs=1e-6)
    monkeypatch.setattr("twin.identify.intervals.RESAMPLED", 2)
    assert known(model, "bootstrap")[1].samples.tolist() == knowledge.samples[:2].tolist()
    assert known(model, "bootstrap", seed=2)[1].samples.tolist() != knowledge.samples[:2].tolist()


@every_case("loss", ["linear", "soft_l1", "huber", "cauchy", "arctan"])
def test_influence_is_the_derivative_of_the_cost(loss):
    residuals = Residuals(straight(np.zeros(8), loss=loss), [1.0])
    r = np.array([-3.0, -1.5, -0.9, -0.2, 0.0, 0.3, 0.8, 1.7, 4.0])
    influence, slope = psi(r, loss)
    h = 1e-5
    cost = [np.array([residuals.cost(np.array([x])) for x in r + step]) for step in (h, -h)]
    assert influence == pytest.approx((cost[0] - cost[1]) / (2 * h), abs=1e-8)
    assert slope == pytest.approx((psi(r + h, loss)[0] - psi(r - h, loss)[0]) / (2 * h), abs=1e-8)
    assert residuals.cost(np.array([1e-3])) == pytest.approx(0.5e-6, rel=1e-5)  # small residuals: half of the square


def of_parts(*parts):
    return inflation(SimpleNamespace(measured=parts), np.concatenate(parts))


def test_residuals_that_follow_each_other_inflate_the_variance():
    """(1 + r) / (1 - r) of the correlation with the next one, if that is more than chance; the mean by counts."""
    eights = np.repeat([1.0, -1.0], 8)  # r = (7 + 7 - 1) / 16
    assert of_parts(eights) == pytest.approx(29 / 3)
    assert of_parts(3.0 * eights + 5.0) == pytest.approx(29 / 3)
    assert of_parts(np.repeat([1.0, -1.0], 4)) == 1.0  # r = 5 / 8 of eight values may be chance: below 2 / sqrt(8)
    assert of_parts(np.array([1.0, -1.0] * 8)) == 1.0  # a negative correlation narrows nothing
    assert of_parts(np.full(8, 2.0)) == 1.0
    assert of_parts(eights, np.full(48, 2.0)) == pytest.approx((16 * 29 / 3 + 48) / 64)


def test_an_interval_is_as_wide_as_students_t_says():
    assert quantile(Residuals(straight(ERRORS), [1.0])) == pytest.approx(WIDTH)
    few = Formula(lambda x: [np.array([x[0]])], [[0.5]])
    assert quantile(Residuals(few, [1.0])) == pytest.approx(stats.t.ppf(0.95, 1))  # at least one degree of freedom


def test_what_changes_next_to_nothing_has_no_covariance():
    jacobian = np.array([[3.0, 0.0, 1e-8], [0.0, 2.0, 0.0], [4.0, 0.0, 0.0]])
    matrix, own, deviations, directions, growth = inverse(jacobian, 4.0, np.ones(3))
    assert matrix == pytest.approx(np.diag([4.0 / 25.0, 1.0, 0.0]))
    assert own.tolist() == [0, 1]
    assert deviations == pytest.approx([0.4, 1.0])
    assert growth == pytest.approx([4.0, 4.0, 1.0])
    assert np.abs(directions) == pytest.approx(np.eye(2))


def test_a_model_that_answers_small_changes_at_random_is_rough():
    """Its wide differences count: their covariance is as without the ripple."""
    ripple = 2e-4

    def function(x):
        return [MATRIX @ x + ripple * np.sin(x[0] / 1e-5) * MATRIX[:, 0]]

    model = Formula(function, [MATRIX @ TRUTH + ERRORS], noise=1e-4)
    knowledge = estimate_uncertainty(model, Fit(TRUTH, [1e-4]), "jacobian", 1, lambda *_: None)
    assert knowledge.rough.tolist() == [False, False]
    model = Formula(lambda x: [MATRIX @ x + 5e-3 * (x[0] > TRUTH[0]) * MATRIX[:, 0]], [MATRIX @ TRUTH], noise=1e-4)
    knowledge = estimate_uncertainty(model, Fit(TRUTH, [1e-4]), "jacobian", 1, lambda *_: None)
    assert knowledge.rough.tolist() == [True, False]
    assert knowledge.deviations[0] == pytest.approx(1e-4 * np.sqrt(np.linalg.inv(MATRIX.T @ MATRIX)[0, 0]), rel=0.3)
