import numpy as np
import pytest
from fmus.servomotor.model import Servomotor

from twin.component import ERROR, OK

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


@pytest.mark.parametrize("mode", [1, 7, 11])
def test_unknown_mode_is_an_error(native, mode):
    motor = native(Servomotor, mode_of_operation=mode)
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
    motor = native(Servomotor, target_velocity=0.05, load_force=-40.0, supply_voltage=48.0)
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
    motor = native(Servomotor, target_velocity=0.05, load_force=-40.0, supply_voltage=48.0)
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


@pytest.mark.slow
def test_continuous_force_is_held_without_end(native):
    motor = native(Servomotor, load_force=-(9.0 + 1.5))
    motor.start(0.0)
    run(motor, 120.0)
    assert not motor.limited
    assert abs(motor.position) < 2e-3
    assert 0.9 < motor.overload < 1.0


# --------------------------------------------------------------------------------------------------- supply and force

BACK_EMF = 9.5  # between phases, amplitude [V*s/m], LM 2070 datasheet, recalled: not a number of the component
FREE = {"stroke": 1e3, "velocity_maximum": 10.0, "thermal_time": 1e6}


def drop(motor):
    """Voltage between phases, amplitude, for one ampere (rms): two phases in series, each with half the resistance."""
    return np.sqrt(3.0) * np.sqrt(2.0) * 0.5 * float(motor.resistance)


@pytest.mark.parametrize("supply", [12.0, 24.0, 48.0])
@pytest.mark.parametrize("way", [1, -1])
def test_the_top_speed_is_what_supply_and_friction_leave(native, supply, way):
    motor = native(Servomotor, supply_voltage=supply, mode_of_operation=10, target_force=way * 27.0, **FREE)
    motor.start(0.0)
    run(motor, 3.0)
    friction = (motor.friction_coulomb + motor.friction_viscous * abs(motor.velocity)) / motor.force_constant
    assert way * motor.velocity == pytest.approx((supply - drop(motor) * friction) / BACK_EMF, rel=1e-3)
    assert way * motor.current == pytest.approx(friction, rel=1e-3)


def test_a_stalled_motor_draws_what_the_resistance_lets_through(native):
    motor = native(Servomotor, target_velocity=0.05, load_force=-40.0)
    motor.start(0.0)
    run(motor, 0.5)
    assert motor.current == pytest.approx(24.0 / drop(motor), rel=1e-6)
    assert motor.current == pytest.approx(1.809, abs=1e-3)
    assert motor.force == pytest.approx(21.06, abs=0.01)


def phases(motor):
    """Voltages and currents of three phases over a turn of the field, from phase quantities alone."""
    angles = np.linspace(0.0, 2.0 * np.pi, 361)[:, None] - 2.0 * np.pi / 3.0 * np.arange(3)
    current = np.sqrt(2.0) * float(motor.current) * np.sin(angles)
    back_emf = float(motor.velocity) * BACK_EMF / np.sqrt(3.0) * np.sin(angles)
    return 0.5 * float(motor.resistance) * current + back_emf, current, back_emf


@pytest.mark.slow
def test_electrical_power_is_loss_and_mechanical_power(native):
    """While the supply is the limit, voltage between two phases reaches it and never goes beyond."""
    motor = native(Servomotor, mode_of_operation=10, target_force=27.0, **FREE)
    motor.start(0.0)
    for _ in range(40):
        run(motor, 0.01)
        voltage, current, back_emf = phases(motor)
        between = np.max(voltage[:, 0] - voltage[:, 1])
        assert between == pytest.approx(24.0, rel=2e-3)  # the speed is that after the last substep
        power, mechanical = (voltage * current).sum(axis=1), (back_emf * current).sum(axis=1)
        assert mechanical == pytest.approx(np.full(361, float(motor.force * motor.velocity)), rel=1e-3)
        loss = 1.5 * float(motor.resistance) * float(motor.current) ** 2
        assert power == pytest.approx(np.full(361, float(motor.force * motor.velocity) + loss), rel=1e-3)


def test_back_emf_helps_to_brake(native):
    motor = native(
        Servomotor, supply_voltage=12.0, current_maximum=5.0, mode_of_operation=10, target_force=40.0, **FREE
    )
    motor.start(0.0)
    run(motor, 2.0)
    speed = float(motor.velocity)
    assert speed > 0.85
    motor.target_force = -40.0
    run(motor, 5e-3)
    assert motor.current < -1.5 * 12.0 / drop(motor)
    assert motor.current == pytest.approx(-(12.0 + BACK_EMF * motor.velocity) / drop(motor), rel=0.05)
    assert motor.velocity < speed


def test_pushed_beyond_the_top_speed_it_brakes_whatever_is_demanded(native):
    """The diodes of the power stage: also without any demand, and without a supply the motor is short-circuited."""
    for supply in (0.0, 12.0):
        motor = native(Servomotor, supply_voltage=supply, mode_of_operation=10, load_force=25.0, **FREE)
        motor.start(0.0)
        run(motor, 3.0)
        assert BACK_EMF * motor.velocity > supply
        assert motor.current == pytest.approx((supply - BACK_EMF * motor.velocity) / drop(motor), rel=2e-3)


def test_the_integral_waits_while_the_voltage_is_at_its_limit(native):
    motor = native(Servomotor, supply_voltage=12.0, target_velocity=3.0, **FREE)
    motor.start(0.0)
    run(motor, 3.0)
    assert abs(motor.current_integral) < 12.0 / drop(motor)
    motor.target_velocity = 0.5
    speeds = []
    for _ in range(500):
        run(motor, H)
        speeds.append(float(motor.velocity))
    assert min(speeds) > 0.4
    assert speeds[-1] == pytest.approx(0.5, abs=5e-3)


@pytest.mark.parametrize("force", [3.0, -6.0])
def test_a_force_is_there_after_the_lag_of_the_current(native, force):
    motor = native(Servomotor, mode_of_operation=10)
    motor.start(0.0)
    motor.target_force = force
    run(motor, 0.5e-3, 0.5e-3)
    assert motor.force == pytest.approx(force * (1.0 - np.exp(-1.0)), rel=1e-6)
    run(motor, 20e-3)
    assert motor.force == pytest.approx(force, rel=1e-9)
    before = float(motor.velocity)
    run(motor, 20e-3)
    friction = np.sign(force) * 1.5 + 2.0 * 0.5 * (before + float(motor.velocity))
    assert (motor.velocity - before) / 20e-3 == pytest.approx((force - friction) / 0.65, rel=1e-3)


def test_force_is_limited_like_any_current(native):
    motor = native(Servomotor, mode_of_operation=10, target_force=-100.0, load_force=50.0, supply_voltage=48.0)
    motor.start(0.0)
    run(motor, 0.5)
    assert motor.current == pytest.approx(-2.37)
    run(motor, 3.0)
    assert motor.limited
    assert motor.current == pytest.approx(-0.79, rel=1e-3)


@pytest.mark.parametrize("mode", [8, 9])
def test_leaving_cst_does_not_jump(native, mode):
    """The load is held all the time: the velocity loop begins with the current that is there."""
    motor = native(Servomotor, mode_of_operation=10, target_force=7.0, load_force=-7.0)
    motor.start(0.0)
    run(motor, 0.2)
    motor.mode_of_operation, motor.target_position, motor.target_velocity = mode, motor.position_actual_value, 0.0
    for _ in range(200):
        run(motor, H)
        assert motor.force == pytest.approx(7.0, abs=0.01)
    assert abs(motor.position) < 1e-5
    motor.mode_of_operation = 10
    run(motor, 0.1)
    assert motor.force == pytest.approx(7.0, rel=1e-6)


def test_a_load_that_is_no_number_is_not_taken_for_friction(native):
    part = native(Servomotor)
    part.start()
    part.load_force = float("nan")
    assert part.advance(0.0, 1e-3) == 0
    assert np.isnan(part.position)
