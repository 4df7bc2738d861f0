"""Force controllers of the comparison `docs/explanation/operating_range.md`, on a heart that is a formula and a tip without friction."""

import numpy as np
import pytest
from fmus.adaptive_harmonic_control.model import AdaptiveHarmonicControl, adapt
from fmus.lqg_control.model import LqgControl
from fmus.preview_control.model import AHEAD, PreviewControl, solve_program
from fmus.repetitive_control.model import RepetitiveControl
from scipy.optimize import minimize

PERIOD, STIFFNESS, LATE = 5e-3, 11.2, 3  # [s], [N/m], periods from a demand until the sensor's value shows it
KNOWN = {"delay": LATE * PERIOD, "play": 0.0, "lead": 0.0}  # of this plant
NO_HYSTERESIS = {"alpha_x": 1.0, "alpha": 0.0, "beta": 0.0, "delta": 0.0}
RIVALS = [AdaptiveHarmonicControl, LqgControl, RepetitiveControl]


def heart(t):
    """Beat of 1.2 Hz with two harmonics, breath of 0.35 Hz [m]."""
    beat = 4e-3 * np.sin(2 * np.pi * 1.2 * t) + 2e-3 * np.sin(4 * np.pi * 1.2 * t + 2.8)
    return beat + 2e-3 * np.sin(2 * np.pi * 0.35 * t)


def hold(control, until, motion=heart, sensor=lambda force: force, preview=None):
    """Force error [N] of a tip that is where it was asked to be `LATE` periods ago, and the velocities asked for [m/s]."""
    noise = 1e-3 * np.random.default_rng(1).standard_normal(round(until / PERIOD))
    places, errors, velocities = [0.0] * LATE, [], []
    if preview is not None:
        control.heart_position = motion(preview)
    control.start(0.0)
    for k in range(round(until / PERIOD)):
        force = STIFFNESS * (places[-LATE] - motion(k * PERIOD))
        control.force = sensor(0.2 + force + noise[k])
        if preview is not None:
            control.heart_position = motion(k * PERIOD + preview)
        control.advance(k * PERIOD, PERIOD)
        velocities.append(float(control.target_velocity))
        places.append(places[-1] + PERIOD * velocities[-1])
        errors.append(force)
    return np.array(errors), np.array(velocities)


@pytest.fixture(params=RIVALS, ids=lambda cls: cls.__name__)
def cls(request):
    return request.param


@pytest.mark.slow
def test_what_repeats_is_learned_and_both_rates_are_found(cls, native):
    control = native(cls, **KNOWN)
    errors, velocities = hold(control, 30.0)
    alone, learned = np.std(errors[400:800]), np.std(errors[5000:])
    assert learned < 0.1 * alone
    assert control.rate == pytest.approx(1.2, abs=0.01)
    assert control.breath == pytest.approx(0.35, abs=0.02)
    assert np.abs(np.diff(velocities)).max() <= 10.0 * PERIOD * (1 + 1e-9)


@pytest.mark.slow
def test_what_does_not_repeat_is_left_to_feedback(cls, native):
    steps = np.cumsum(np.random.default_rng(2).standard_normal(8000))
    drift = np.convolve(steps, np.ones(40) / 40, mode="same")
    drift *= 4e-3 / drift.std()
    errors, _ = hold(native(cls, **KNOWN), 35.0, lambda t: np.interp(t, PERIOD * np.arange(8000), drift))
    alone = native(cls, **KNOWN, rate_maximum=0.71)  # no beat is found
    least, _ = hold(alone, 35.0, lambda t: np.interp(t, PERIOD * np.arange(8000), drift))
    assert np.std(errors[1000:]) < 1.5 * np.std(least[1000:])


@pytest.mark.slow_repetitions
def test_a_learned_motion_that_harms_is_given_up(cls, native):
    control = native(cls, **KNOWN)
    hold(control, 12.0)
    assert control.share == 1.0
    control.mean_square = 2.0 * control.feedback_mean_square
    control.force = 0.2001
    control.advance(12.0, PERIOD)
    assert control.rate == 0.0


def test_a_force_that_stays_the_same_is_no_sample(cls, native):
    control = native(cls, **KNOWN)
    hold(control, 12.0)
    doubt = [float(control.covariance[5, 5])]
    for k in range(20):
        control.force = 0.21
        control.advance(12.0 + k * PERIOD, PERIOD)
        doubt.append(float(control.covariance[5, 5]))
    assert np.all(np.diff(doubt[1:]) > 0.0)


def test_preview_makes_up_for_the_dead_time(native):
    ahead = {"preview": (AHEAD + LATE) * PERIOD}
    errors, _ = hold(native(PreviewControl, **NO_HYSTERESIS, delay=LATE * PERIOD), 10.0, **ahead)
    late, _ = hold(native(PreviewControl, **NO_HYSTERESIS, delay=LATE * PERIOD), 10.0, preview=0.0)
    assert np.std(errors[400:]) < 0.25 * np.std(late[400:])


def test_feedback_of_the_preview_controller_removes_an_offset(native):
    control = native(PreviewControl, **NO_HYSTERESIS, delay=LATE * PERIOD, correction=0.5)
    errors, _ = hold(control, 5.0, lambda t: np.where(t > 1.0, 3e-3, 0.0))
    assert abs(np.mean(errors[800:])) < 1e-3


@pytest.mark.parametrize("size", [1e-3, 1e-1, 3.0], ids=["free", "acceleration", "velocity too"])
def test_the_quadratic_program_is_solved(size):
    control = PreviewControl(weight=2.0, velocity_maximum=0.1)
    control.start(0.0)
    control.velocity = 0.03
    error = size * np.random.default_rng(3).standard_normal(AHEAD)
    control.error[...] = error
    active = solve_program(control, PERIOD)

    sums = np.tril(np.ones((AHEAD, AHEAD)))
    places = sums @ sums

    def cost(change):
        return np.sum((error - places @ change) ** 2) + 2.0 * np.sum(change**2)

    most = 10.0 * PERIOD
    limits = [{"type": "ineq", "fun": lambda x, sign=sign: 0.1 - sign * (0.03 + sums @ x)} for sign in (1.0, -1.0)]
    best = minimize(
        cost,
        np.zeros(AHEAD),
        bounds=[(-most, most)] * AHEAD,
        constraints=limits,
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 500},
    )
    assert np.allclose(control.change, best.x, atol=2e-6)
    assert active == bool(np.any(np.abs(best.x) > most - 1e-9) or np.any(np.abs(0.03 + sums @ best.x) > 0.1 - 1e-9))


@pytest.mark.parametrize("frequency", [0.25, 1.0, 7.0])
def test_the_reference_of_each_harmonic_is_filtered_by_the_loop(frequency):
    control = AdaptiveHarmonicControl(lead=0.0, delay=20e-3, learning=0.5)
    control.start(0.0)
    omega, gain = 2 * np.pi * frequency, STIFFNESS * control.proportional
    dead_time = np.exp(-0.02j * omega)
    loop = STIFFNESS * dead_time * 1j * omega / (1j * omega + gain * dead_time)  # force error per wanted position [N/m]
    steps = 400
    for angle in 2 * np.pi * np.arange(steps) / steps:
        control.error = (loop * np.exp(1j * angle)).imag
        adapt(control, 0, omega, angle, 1.0 / frequency / steps)
    assert control.sine_part[0] == pytest.approx(0.5 / frequency, rel=1e-9)
    assert control.cosine_part[0] == pytest.approx(0.0, abs=1e-9)
