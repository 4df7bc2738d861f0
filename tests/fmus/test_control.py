import numpy as np
import pytest
from fmus.pi_bouc_wen_control.model import PIBoucWenControl
from fmus.pi_control.model import PIControl
from fmus.pi_feedforward_control.model import PIFeedforwardControl

CONTROLLERS = [PIControl, PIFeedforwardControl, PIBoucWenControl]
PERIOD = 5e-3


def run(control, steps, **inputs):
    for name, value in inputs.items():
        setattr(control, name, value)
    found = []
    for _ in range(steps):
        control.advance(float(control._tick[0]) * PERIOD, PERIOD)
        found.append(float(control.target_velocity))
    return found


@pytest.mark.parametrize("cls", CONTROLLERS)
def test_proportional_law(cls):
    control = cls()
    control.start(0.0)
    assert control.target_velocity == 0.0
    assert run(control, 3, force=0.1) == pytest.approx([0.015] * 3)


@pytest.mark.parametrize("cls", CONTROLLERS)
def test_velocity_is_limited(cls):
    control = cls()
    control.start(0.0)
    assert run(control, 2, force=-10.0) == [0.5, 0.5]
    assert run(control, 2, force=10.0) == [-0.5, -0.5]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("cls", CONTROLLERS)
def test_integral_does_not_wind_up(cls):
    control = cls(integral=1.0)
    control.start(0.0)
    rising = run(control, 3, force=0.1)
    assert np.diff(rising) == pytest.approx([0.1 * PERIOD] * 2)

    # a minute at the limit leaves nothing to unwind
    run(control, 12000, force=-10.0)
    assert control.integral_part < 0.01
    assert run(control, 1, force=0.3)[0] < 0.0


@pytest.mark.parametrize("cls", CONTROLLERS[1:])
def test_a_steady_start_is_not_a_motion(cls):
    control = cls(heart_position=4e-3, force=0.2)
    control.start(0.0)
    assert run(control, 5) == [0.0] * 5


def test_feedforward_is_the_rate_of_the_heart():
    control = PIFeedforwardControl(force=0.2)
    control.start(0.0)
    for step in range(1, 10):
        assert run(control, 1, heart_position=2e-4 * step)[0] == pytest.approx(0.04)


def test_without_hysteresis_both_feedforwards_are_one(native):
    plain = native(PIFeedforwardControl, force=0.15)
    inverse = native(PIBoucWenControl, force=0.15, alpha_x=1.0, alpha=0.0, beta=0.0, delta=0.0)
    for control in (plain, inverse):
        control.start(0.0)
    for x in 5e-3 * np.sin(np.arange(300) * 0.03):
        assert run(inverse, 1, heart_position=x)[0] == pytest.approx(run(plain, 1, heart_position=x)[0], abs=1e-12)
