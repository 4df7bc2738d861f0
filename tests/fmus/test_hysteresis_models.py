from pathlib import Path

import numpy as np
import pytest
from fmus.bouc_wen_compensator import identify as bouc_wen
from fmus.bouc_wen_compensator.identify import PAPER, Constants
from fmus.hysteresis_models import analysis, constants, least_slope
from fmus.prandtl_ishlinskii_compensator import identify as plays
from fmus.prandtl_ishlinskii_compensator.model import THRESHOLDS, PrandtlIshlinskiiCompensator
from fmus.rate_bouc_wen_compensator import identify as rate
from fmus.rate_bouc_wen_compensator.model import RateBoucWenCompensator
from fmus.sheath.model import Sheath

from twin.scenario import load_scenario

SAMPLE = 25e-3
ROUND = Constants(1.9, 1.2, 0.04, 0.04, 1.5)  # the slope bound of the inverse is never met
WEIGHTS = (0.4, 0.1, 0.1, 0.1, 0.2, 0.1, 0.0, 0.05)


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
    """Two harmonics, from zero."""
    return 4e-3 * np.sin(2 * np.pi * t) + 2e-3 * (np.sin(4 * np.pi * t + 2.8) - np.sin(2.8))


def chirp(seconds, sample=25e-3):
    """From 0.1 to 3 Hz."""
    t = np.arange(0.0, seconds, sample)
    return 5e-3 * np.sin(2 * np.pi * (0.1 * t + 0.5 * 2.9 / seconds * t * t))


@pytest.fixture(scope="module")
def recorded(native):
    """Gripper and true tip every 25 ms, the gripper on an ideal chirp of 40 s, or following the heart."""

    def record(path):
        sheath = native(Sheath)
        sheath.gripper_position = path[0]
        sheath.start(0.0)
        tip = np.empty(path.size)
        for k, x in enumerate(path):
            tip[k] = sheath.tip_position
            sheath.gripper_position = x
            sheath.advance(k * 1e-3, 1e-3)
        return path[::25], tip[::25]

    return {"chirp": record(chirp(40.0, 1e-3)), "heart": record(heart(1.6 * np.arange(0.0, 20.0, 1e-3)))}


@pytest.fixture(scope="module")
def measured(recorded):
    """The chirp's tip as the EM tracker sees it: 0.2 mm of noise."""
    return recorded["chirp"][1] + 0.2e-3 * np.random.default_rng(7).standard_normal(recorded["chirp"][1].size)


@pytest.fixture(scope="module")
def fits(recorded, measured):
    """Bouc-Wen with a lag, and the sum of plays, fitted to the noisy samples."""
    return rate.identify(recorded["chirp"][0], measured), plays.identify(recorded["chirp"][0], measured)


def test_sum_of_plays_is_inverted_exactly(native):
    """The closed form against the model, on a path that crosses itself."""
    wanted = heart(np.arange(0.0, 3.0, 1e-3))
    path = compensated(native(PrandtlIshlinskiiCompensator, weight=WEIGHTS), wanted)
    np.testing.assert_allclose(plays.simulate(WEIGHTS, path), wanted, atol=1e-12)
    assert np.ptp(path) > 1.1 * np.ptp(wanted) / sum(WEIGHTS)


def test_a_play_alone_is_inverted_at_a_bounded_speed(native):
    """A first weight of zero has no inverse; the raised one keeps slope and width of the loop."""
    weights = np.zeros(8)
    weights[4] = 1.0
    wanted = 6e-3 * np.sin(2 * np.pi * np.arange(0.0, 3.0, 1e-3))
    path = compensated(native(PrandtlIshlinskiiCompensator, weight=tuple(weights)), wanted)
    ratio = np.abs(np.diff(path)) / np.maximum(np.abs(np.diff(wanted)), 1e-9)
    assert ratio.max() == pytest.approx(5.0, rel=1e-6)
    assert path.max() == pytest.approx(6e-3 + THRESHOLDS[4], abs=1e-9)
    tip = plays.simulate(weights, path)
    moved = slice(300, None)
    assert np.std((tip - wanted)[moved]) < 0.5 * np.std((plays.simulate(weights, wanted) - wanted)[moved])


def test_plays_remember_extremes_and_forget_what_they_enclose():
    """Wiping out and congruency: a minor loop closes, and leaves nothing behind."""
    there = plays.simulate(WEIGHTS, 1e-3 * np.array([0.0, 5.0, 2.0, 4.0, 2.0]))
    assert there[2] == pytest.approx(there[4], abs=1e-15)
    straight, around = 1e-3 * np.array([0.0, 5.0, -5.0]), 1e-3 * np.array([0.0, 5.0, 2.0, 4.0, -5.0])
    assert plays.simulate(WEIGHTS, straight)[-1] == pytest.approx(plays.simulate(WEIGHTS, around)[-1], abs=1e-15)


def test_weights_are_recovered():
    x_in = chirp(20.0)
    noise = 1e-6 * np.random.default_rng(1).standard_normal(x_in.size)
    fit = plays.identify(x_in, plays.simulate(WEIGHTS, x_in) + 1.5e-3 + noise)
    np.testing.assert_allclose(fit.weights, WEIGHTS, atol=2e-3)
    assert fit.offset == pytest.approx(1.5e-3, abs=1e-6)


def test_lag_follows_a_ramp_by_its_time_constant():
    ramp = 0.1 * np.arange(0.0, 1.0, SAMPLE)
    assert ramp[-1] - rate.lagged(ramp, 10e-3)[-1] == pytest.approx(0.1 * 10e-3, rel=1e-6)
    assert rate.lagged(ramp, 0.0) is ramp
    both = rate.lagged(np.column_stack((ramp, 2.0 * ramp)), 10e-3)
    np.testing.assert_allclose(both[:, 1], 2.0 * rate.lagged(ramp, 10e-3))


@pytest.mark.slow
def test_constants_and_lag_are_recovered():
    truth, x_in = Constants(1.08, 1.0, 0.06, 0.04, 2.5), chirp(20.0)
    noise = 2e-6 * np.random.default_rng(1).standard_normal(x_in.size)
    fit = rate.identify(x_in, rate.simulate(truth, 12e-3, x_in) + 1.5e-3 + noise)
    np.testing.assert_allclose(fit.constants, truth, rtol=0.02)
    assert fit.lag == pytest.approx(12e-3, rel=0.01)
    assert fit.offset == pytest.approx(1.5e-3, abs=2e-6)


def test_lag_and_hysteresis_are_inverted(native):
    wanted = heart(np.arange(0.0, 3.0, 1e-3))
    path = compensated(native(RateBoucWenCompensator, **ROUND._asdict(), lag=8e-3), wanted)
    late = rate.simulate(ROUND, 8e-3, path, 1e-3) - wanted
    assert np.abs(late[100:]).max() < 0.06e-3  # half a sample of a difference
    unaware = rate.simulate(
        ROUND, 8e-3, compensated(native(RateBoucWenCompensator, **ROUND._asdict(), lag=0.0), wanted), 1e-3
    )
    assert np.abs(late[100:]).max() < 0.2 * np.abs(unaware - wanted).max()


def test_only_the_lag_makes_the_model_depend_on_rate():
    """Eq. (2) is linear in |dx|: the same path in twice the time is the same loop."""
    t = np.arange(0.0, 4.0, 1e-3)
    slow, fast = 5e-3 * np.sin(2 * np.pi * t), 5e-3 * np.sin(4 * np.pi * t[:2000])
    for lag, alike in ((0.0, True), (6e-3, False)):
        a, b = rate.simulate(ROUND, lag, slow, 1e-3)[::2], rate.simulate(ROUND, lag, fast, 1e-3)
        assert bool(np.abs(a - b).max() < 0.02e-3) is alike


def test_printed_model_is_not_monotone_after_a_reversal():
    """The paper's own constants on the paper's own chirp: the tip would go back while the gripper goes on."""
    path = 5e-3 * np.sin(2 * np.pi * np.arange(0.0, 1.4, 1e-3))
    tip = bouc_wen.simulate(PAPER, path)
    assert path[1330] < path[1250] - 0.5e-3  # back from the second crest
    assert tip[1330] > tip[1250] + 0.5e-3
    assert least_slope(PAPER, path) < -2.0
    assert least_slope(ROUND, path) > 0.0


@pytest.mark.slow
def test_fits_to_noisy_samples_hold_for_the_true_tip_and_for_a_heart_that_they_have_not_seen(recorded, fits):
    lagging, sum_of_plays = fits
    assert lagging.lag == pytest.approx(6e-3, abs=1.5e-3)  # the sheath's drag over its stiffness is 5.5 ms
    assert 0.19e-3 < lagging.residual < 0.22e-3  # the noise is 0.2 mm
    for name, bound in (("chirp", 0.06e-3), ("heart", 0.08e-3)):
        gripper, true_tip = recorded[name]
        with_lag = np.std(rate.simulate(lagging.constants, lagging.lag, gripper) - true_tip)
        without = np.std(plays.simulate(sum_of_plays.weights, gripper) - true_tip)
        assert with_lag < bound
        assert 2.0 * with_lag < without < 0.25e-3


@pytest.mark.slow
def test_kept_constants_fit_a_recording_with_other_noise(recorded, measured, fits):
    """Weights and constants of the components are those that the scenario finds, within what noise does."""
    x_in, _ = recorded["chirp"]
    kept = rate.simulate(constants(RateBoucWenCompensator), float(RateBoucWenCompensator.lag.start), x_in)
    assert np.std(measured - kept) < 1.03 * fits[0].residual
    sum_of_plays = plays.simulate(PrandtlIshlinskiiCompensator.weight.start, x_in)
    assert np.std(measured - sum_of_plays) < 1.03 * fits[1].residual


@pytest.mark.slow
def test_comparison_names_every_model(recorded):
    found = analysis(*recorded["heart"])
    assert set(found) == set(analysis.outputs)
    assert np.std(found["rate_bouc_wen"]) < np.std(found["bouc_wen"])


def test_scenario_has_the_constants_that_the_comparison_judges():
    scenario = load_scenario(Path(__file__).parents[2] / "scenarios" / "hysteresis_models.yaml")
    cases = [one for one in scenario.variants if one.variant.endswith("+drive") and one.seed == 1]
    assert len(cases) == 3
    for case in cases:
        given = case.members["compensator"].parameters
        assert [given[name] for name in Constants._fields] == pytest.approx(rate.WITH_DRIVE)
        assert given["lag"] == f"{1e3 * rate.LAG_WITH_DRIVE:.1f} ms"
