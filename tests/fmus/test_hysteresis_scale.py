"""Width of a hysteresis, followed from noisy pairs, and the compensator that uses it."""

import numpy as np
import pytest
from fmus.hysteresis_scale.model import HysteresisScale
from fmus.hysteresis_scale.statistics import analysis
from fmus.prandtl_ishlinskii_compensator import identify as plays
from fmus.prandtl_ishlinskii_compensator.model import THRESHOLDS, WEIGHTS, PrandtlIshlinskiiCompensator
from scipy.stats import chi2

PERIOD = 25e-3
TIME = np.arange(0.0, 20.0, PERIOD)
GRIPPER = 5e-3 * np.sin(2 * np.pi * 0.9 * TIME)


def tip_of(scale, gripper=GRIPPER):
    return plays.simulate(WEIGHTS, gripper, scale * np.array(THRESHOLDS))


def follow(member, gripper, tip, status=None):
    """Scale, deviation and normalized innovation squared after each sample, (3, n)."""
    member.gripper_position, member.tip_position = gripper[0], tip[0]
    member.start(0.0)
    rows = []
    for k, (x, y) in enumerate(zip(gripper, tip, strict=True)):
        member.gripper_position, member.tip_position = x, y
        member.tip_status = 0 if status is None else int(status[k])
        member.advance(k * PERIOD, PERIOD)
        rows.append((member.scale, member.deviation, member.nis))
    return np.array(rows).T


def test_errors_and_innovations_are_as_large_as_the_estimator_says(native):
    """Constant scales and offsets that are drawn as the estimator assumes: NEES and NIS of 20 runs in their 95 % bands."""
    count, nees, nis = 20, [], []
    for seed in range(count):
        random = np.random.default_rng(seed)
        scale, offset = 1.0 + 0.1 * random.standard_normal(), 0.5e-3 * random.standard_normal()
        tip = tip_of(scale) + offset + 0.25e-3 * random.standard_normal(TIME.size)
        rows = follow(native(HysteresisScale, scale_walk=0.0), GRIPPER, tip)
        nees.append(((rows[0, -1] - scale) / rows[1, -1]) ** 2)
        nis.append(rows[2])
    low, high = chi2.ppf([0.025, 0.975], count) / count
    assert low < np.mean(nees) < high
    low, high = chi2.ppf([0.025, 0.975], count * TIME.size) / (count * TIME.size)
    assert low < np.mean(nis) < high


def test_a_width_that_grows_is_followed(native):
    tip = np.where(TIME < 5.0, tip_of(1.0), tip_of(1.4)) + 0.2e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    scale, deviation, _ = follow(native(HysteresisScale), GRIPPER, tip)
    assert abs(scale[round(5.0 / PERIOD) - 1] - 1.0) < 3.0 * deviation[-1]
    assert abs(scale[-1] - 1.4) < 3.0 * deviation[-1] < 0.1


def test_samples_that_are_not_valid_change_nothing_but_the_deviation(native):
    status = np.where(TIME < 10.0, 0, 2)
    tip = np.where(TIME < 10.0, tip_of(1.2), np.nan)
    scale, deviation, _ = follow(native(HysteresisScale), GRIPPER, tip, status)
    half = round(10.0 / PERIOD)
    assert np.all(scale[half:] == scale[half - 1])
    assert deviation[-1] ** 2 == pytest.approx(deviation[half - 1] ** 2 + 0.02**2 * 10.0, rel=1e-9)


def test_the_compensator_inverts_plays_of_another_width(native):
    wanted = 4e-3 * np.sin(2 * np.pi * np.arange(0.0, 3.0, 1e-3))
    weights = (0.4, 0.1, 0.1, 0.1, 0.2, 0.1, 0.0, 0.05)  # a first weight of zero has no exact inverse
    member = native(PrandtlIshlinskiiCompensator, weight=weights)
    member.position, member.scale = wanted[0], 1.4
    member.start(0.0)
    path = np.empty(wanted.size)
    for k, x in enumerate(wanted):
        member.position = x
        member.advance(k * 1e-3, 1e-3)
        path[k] = member.compensated_position
    np.testing.assert_allclose(plays.simulate(weights, path, 1.4 * np.array(THRESHOLDS)), wanted, atol=1e-12)
    assert np.std(plays.simulate(weights, path) - wanted) > 0.1e-3


def test_the_error_is_that_against_the_sample_before():
    error = analysis(np.array([1.0, 2.0, 4.0]), np.array([9.0, 1.5, 2.5]))["error"]
    assert error.tolist() == [0.0, 0.5, 0.5]
