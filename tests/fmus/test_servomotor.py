import numpy as np
import pytest

from fmus.servomotor.model import Servomotor
from twin.solver import ERROR, OK

H = 1e-3


def run(motor, seconds, h=H):
    for step in range(round(seconds / h)):
        assert motor.advance(step * h, h) == OK


@pytest.mark.parametrize("velocity", [0.04, -0.01])
def test_csv_follows_the_target_velocity(native, velocity):
    motor = native(Servomotor, target_velocity=velocity, load_force=-3.0)
    motor.start(0.0)
    run(motor, 0.4)
    begin = float(motor.position)
    run(motor, 0.2)
    assert motor.position - begin == pytest.approx(0.2 * velocity, rel=0.01)
    assert motor.velocity_actual_value == pytest.approx(velocity, abs=2e-3)


def test_csp_reaches_the_target_under_load(native):
    motor = native(Servomotor, mode_of_operation=8)
    motor.start(0.0)
    motor.target_position, motor.load_force = 5e-3, 3.0
    run(motor, 2.0)
    assert motor.position == pytest.approx(5e-3, abs=16e-6)
    assert motor.position_actual_value / 8e-6 == pytest.approx(round(float(motor.position_actual_value) / 8e-6))


def test_starts_at_rest_at_the_target(native):
    motor = native(Servomotor, mode_of_operation=8, target_position=7e-3)
    motor.start(0.0)
    run(motor, 0.1)
    assert motor.position == pytest.approx(7e-3, abs=8e-6)


def test_mode_can_be_switched_while_running(native):
    motor = native(Servomotor, target_velocity=0.02)
    motor.start(0.0)
    run(motor, 0.5)
    motor.target_position, motor.mode_of_operation = 0.0, 8
    run(motor, 2.0)
    assert motor.position == pytest.approx(0.0, abs=16e-6)


def test_step_may_hold_several_drive_samples(native):
    fine, coarse = native(Servomotor, target_velocity=0.03), native(Servomotor, target_velocity=0.03)
    for motor, h in ((fine, 0.5e-3), (coarse, 2.5e-3)):
        motor.start(0.0)
        run(motor, 0.1, h)
    assert fine.position == coarse.position
    assert fine.current == coarse.current


@pytest.mark.parametrize("h", [0.2e-3, 0.7e-3, 1.2e-3])
def test_other_steps_are_errors(native, h):
    motor = native(Servomotor)
    motor.start(0.0)
    assert motor.advance(0.0, h) == ERROR


def test_unknown_mode_is_an_error(native):
    motor = native(Servomotor, mode_of_operation=1)
    motor.start(0.0)
    assert motor.advance(0.0, H) == ERROR


def test_friction_holds_the_rod(native):
    motor = native(Servomotor, velocity_gain=0.0, velocity_integral=0.0, load_force=1.4)
    motor.start(0.0)
    run(motor, 0.2)
    assert motor.position == 0.0
    motor.load_force = 1.6
    run(motor, 0.2)
    assert motor.position > 0.0


def test_current_is_limited_and_the_integral_waits(native):
    motor = native(Servomotor, target_velocity=0.05, load_force=-40.0)
    motor.start(0.0)
    run(motor, 1.0)
    assert motor.position == pytest.approx(-40e-3)  # pushed to the end stop
    assert motor.current == pytest.approx(2.37)
    assert abs(motor.current_integral) < 2.37

    motor.load_force = 0.0
    run(motor, 0.3)
    assert motor.velocity == pytest.approx(0.05, abs=3e-3)
    assert np.isfinite(motor.force)


def test_peak_force_lasts_as_long_as_the_winding_takes_to_warm(native):
    motor = native(Servomotor, target_velocity=0.05, load_force=-40.0)
    motor.start(0.0)
    seconds = 0.0
    while not motor.limited:
        run(motor, 0.01)
        seconds += 0.01
    assert seconds == pytest.approx(15.0 * np.log(9.0 / 8.0), abs=0.05)  # (2.37 / 0.79)^2 = 9
    run(motor, 0.1)
    assert motor.current == pytest.approx(0.79)
    assert motor.force == pytest.approx(9.2, abs=0.01)
    run(motor, 60.0)
    assert motor.limited
    assert motor.overload == pytest.approx(1.0, abs=1e-3)

    motor.target_velocity = motor.load_force = 0.0
    run(motor, 15.0 * np.log(1.0 / 0.9) + 2.0)
    assert not motor.limited


def test_continuous_force_is_held_without_end(native):
    motor = native(Servomotor, load_force=-(9.0 + 1.5))
    motor.start(0.0)
    run(motor, 120.0)
    assert not motor.limited
    assert abs(motor.position) < 2e-3
    assert 0.9 < motor.overload < 1.0
