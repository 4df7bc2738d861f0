import numpy as np
import pytest
from fmus.bouc_wen_compensator.identify import (
    PAPER,
    Constants,
    Shape,
    correlation,
    from_shape,
    identify,
    shape,
    shape_slope,
    simulate,
    unseparated,
)
from fmus.bouc_wen_compensator.model import BoucWenCompensator

# slope alpha_x - g between 0.7 and 1.9 everywhere: the bound of the inverse is never met
ROUND = Constants(1.9, 1.2, 0.04, 0.04, 1.5)


def compensated(member, wanted):
    member.position = wanted[0]
    member.start(0.0)
    found = np.empty(wanted.size)
    for step, x in enumerate(wanted):
        member.position = x
        member.advance(step * 1e-3, 1e-3)
        found[step] = member.compensated_position
    return found


def heart(t):
    return 4e-3 * np.sin(2 * np.pi * t) + 2e-3 * (np.sin(4 * np.pi * t + 2.8) - np.sin(2.8))


def chirp(seconds):
    t = np.arange(0.0, seconds, 0.025)
    return 5e-3 * np.sin(2 * np.pi * (0.1 * t + 0.5 * 2.9 / seconds * t * t))


@pytest.mark.slow
def test_model_follows_the_paper_equations():
    """Against eqs. (1) and (2) in time, with a fine explicit integration."""
    t = np.linspace(0.0, 2.0, 200_001)
    x = 5e-3 * np.sin(2 * np.pi * t)
    h, dt = 0.0, t[1]
    for rate in 1e3 * 5e-3 * 2 * np.pi * np.cos(2 * np.pi * t[:-1]):
        size = abs(h)
        h += dt * (1.2 * rate - 0.05 * abs(rate) * (h * size**0.8 if size else 0.0) - 0.02 * rate * size**1.8)
    found = simulate((1.5, 1.2, 0.05, 0.02, 1.8), x)[-1]
    assert found == pytest.approx(1.5 * x[-1] - 1e-3 * h, abs=2e-6)


def test_model_does_not_depend_on_rate():
    t = np.linspace(0.0, 2.0, 2001)
    x = 5e-3 * np.sin(2 * np.pi * t)
    np.testing.assert_array_equal(simulate(PAPER, x), simulate(PAPER, x.copy()))
    assert simulate(PAPER, x)[-1] == pytest.approx(simulate(PAPER, np.repeat(x, 3))[-1], abs=1e-15)


def test_inverse_then_model_is_the_identity(native):
    wanted = heart(np.arange(0.0, 3.0, 1e-3))
    wanted -= wanted[0]
    path = compensated(native(BoucWenCompensator, **ROUND._asdict()), wanted)
    error = simulate(ROUND, path) - wanted
    assert np.abs(error).max() < 0.02e-3
    assert np.ptp(path) > 1.1 * np.ptp(wanted) / 1.9


@pytest.mark.slow
@pytest.mark.parametrize("duration", [180.0, pytest.param(600.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("constants", [{}, PAPER._asdict()])
def test_inverse_neither_drifts_nor_grows(native, constants, duration):
    """Minutes at a rate that divides nothing."""
    t = np.arange(0.0, duration, 1e-3)
    path = compensated(native(BoucWenCompensator, **constants), 1.3 * heart(1.37 * t))
    first, last = path[2000:62000], path[-60000:]
    assert last.mean() == pytest.approx(first.mean(), abs=0.02e-3)
    assert np.ptp(last) == pytest.approx(np.ptp(first), rel=1e-2)
    assert np.abs(path).max() < 20e-3


def test_speed_is_bounded_by_the_least_slope(native):
    wanted = heart(np.arange(0.0, 3.0, 1e-3))
    path = compensated(native(BoucWenCompensator), wanted)
    ratio = np.abs(np.diff(path)) / np.maximum(np.abs(np.diff(wanted)), 1e-9)
    assert ratio.max() <= 5.0 + 1e-6


@pytest.mark.slow
def test_identification_recovers_known_constants():
    truth = Constants(1.08, 1.0, 0.06, 0.04, 2.5)
    x_in = chirp(20.0)
    random = np.random.default_rng(1)
    x_out = simulate(truth, x_in) + 1.5e-3 + 2e-6 * random.standard_normal(x_in.size)
    fit = identify(x_in, x_out)
    np.testing.assert_allclose(fit.constants, truth, rtol=0.02)
    assert np.all(np.abs(np.subtract(fit.constants, truth)) < 5.0 * np.array(fit.standard_errors))
    assert fit.offset == pytest.approx(1.5e-3, abs=2e-6)
    assert fit.residual == pytest.approx(2e-6, rel=0.1)


def test_the_shape_is_another_way_to_say_the_constants():
    for constants in (ROUND, PAPER):
        again = from_shape(constants.alpha_x, constants.alpha, shape(constants), constants.gamma)
        np.testing.assert_allclose(again, constants, rtol=1e-12)
    assert np.isnan(shape(Constants(1.0, 1.0, 0.01, -0.02, 2.0))).all()


def test_h_saturates_at_the_amplitude():
    ramp = np.linspace(0.0, 60e-3, 6001)
    h = ROUND.alpha_x * ramp[-1] - simulate(ROUND, ramp)[-1]
    assert h == pytest.approx(1e-3 * shape(ROUND).amplitude, rel=1e-3)


def test_the_slope_of_the_shape_is_that_of_differences():
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-6
        ends = [Constants(*(np.array(ROUND) + side * step)) for side in (1.0, -1.0)]
        named = [np.array((c.alpha_x, c.alpha, *shape(c), c.gamma)) for c in ends]
        np.testing.assert_allclose((named[0] - named[1]) / 2e-6, shape_slope(ROUND)[:, i], rtol=1e-6, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_hides_beta_and_gamma_but_not_amplitude_and_share(seed):
    """The shipped constants and the tracker's noise: beta and gamma are said to be inseparable; the shape is found."""
    truth = Constants(1.076, 1.087, 0.0368, 0.0261, 3.6)
    x_in = chirp(80.0)
    x_out = simulate(truth, x_in) + 0.2e-3 * np.random.default_rng(seed).standard_normal(x_in.size)
    fit = identify(x_in, x_out)
    named = unseparated(fit)
    assert any(line.startswith("beta and gamma cannot be separated: correlation -0.9") for line in named), named
    assert not any("alpha" in line for line in named)
    relative = np.sqrt(np.diag(fit.shape_covariance)) / np.array(
        (fit.constants.alpha_x, fit.constants.alpha, *fit.shape, fit.constants.gamma)
    )
    assert fit.standard_errors.beta / fit.constants.beta > 0.12
    assert relative[2] < 0.015
    assert relative[3] < 0.08
    assert np.abs(np.subtract(fit.shape, shape(truth)) / shape(truth)).max() < 0.15
    assert np.abs(correlation(fit.shape_covariance)[np.triu_indices(5, 1)]).max() < 0.97
    assert isinstance(fit.shape, Shape)
