import numpy as np
import pytest
from fmus.rotary_drive.model import RotaryDrive
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.component import ERROR, OK

H = 1e-3


def run(drive, seconds, speed=0.0, h=H):
    """Move the target from where it is at a constant speed; errors of the frame's angle [rad]."""
    start = float(drive.target_position)
    errors = []
    for step in range(round(seconds / h)):
        drive.target_position = start + speed * (step + 1) * h
        assert drive.advance(step * h, h) == OK
        errors.append(float(drive.target_position - drive.angle))
    return np.array(errors)


@pytest.mark.parametrize("speed", [0.2513, 1.2566])
def test_csp_follows_both_ways_within_the_backlash(native, speed):
    drive = native(RotaryDrive)
    drive.start(0.0)
    forth = run(drive, 3.0, speed)[1500:]
    run(drive, 0.5)
    back = run(drive, 3.0, -speed)[1500:]

    # the encoder does not see the teeth change sides and give; samples at 0 and 0.5 ms of a step see the target of its end
    wanted = drive.backlash + 2 * 0.52 / drive.mesh_stiffness - 2 * 0.75e-3 * speed
    assert forth.mean() - back.mean() == pytest.approx(wanted, abs=3e-4)
    assert np.ptp(forth) < 2e-3
    assert np.ptp(back) < 2e-3


def test_csv_follows_the_target_velocity(native):
    drive = native(RotaryDrive, mode_of_operation=9, target_velocity=-0.8)
    drive.start(0.0)
    run(drive, 1.0)
    begin = float(drive.angle)
    run(drive, 1.0)
    assert drive.angle - begin == pytest.approx(-0.8, rel=0.01)
    assert drive.velocity_actual_value == pytest.approx(-0.8, rel=0.05)


def test_holds_against_a_load(native):
    drive = native(RotaryDrive, load_torque=1.0)
    drive.start(0.0)
    run(drive, 3.0)
    assert abs(drive.angle) < 0.02
    # what friction does not hold, the motor does
    assert 0.4 < -drive.torque * drive.gear_ratio < 1.6


def test_friction_holds_the_frame_exactly(native):
    drive = native(RotaryDrive, velocity_gain=0.0, velocity_integral=0.0, load_torque=0.49)
    drive.start(0.0)
    run(drive, 0.5)
    assert drive.angle == 0.0
    drive.load_torque = 0.51
    run(drive, 0.5)
    assert drive.angle > 0.0


def test_teeth_transmit_the_ratio_and_the_backlash(native):
    """Without friction a current turns both bodies like one of their joined inertia, after the backlash."""
    drive = native(
        RotaryDrive,
        friction_coulomb=0.0,
        friction_viscous=0.0,
        motor_friction=0.0,
        position_gain=0.0,
        velocity_gain=1e4,
        velocity_integral=0.0,
        current_maximum=0.5,
        feedforward=0.0,
        mode_of_operation=9,
        target_velocity=5.0,
    )
    drive.start(0.0)
    run(drive, 0.05)
    begin = float(drive.angular_velocity)
    run(drive, 0.1)
    joined = drive.frame_inertia + drive.motor_inertia * drive.gear_ratio**2
    assert (drive.angular_velocity - begin) / 0.1 == pytest.approx(0.5 * 0.091 * 5.0 / joined, rel=0.01)
    gap = drive.motor_angle / drive.gear_ratio - drive.angle
    assert gap == pytest.approx(0.5 * drive.backlash, abs=5e-4)
    assert gap > 0.5 * drive.backlash


@pytest.mark.parametrize("h", [0.2e-3, 0.7e-3])
def test_other_steps_and_modes_are_errors(native, h):
    drive = native(RotaryDrive)
    drive.start(0.0)
    assert drive.advance(0.0, h) == ERROR
    for mode in (1, 7, 11):
        drive.mode_of_operation = mode
        assert drive.advance(0.0, H) == ERROR


@settings(max_examples=40, deadline=None)
@given(
    targets=st.lists(
        st.tuples(
            st.floats(-20.0, 20.0),
            st.floats(-10.0, 10.0),
            st.floats(-3.0, 3.0),
            st.floats(-2.0, 2.0),
            st.sampled_from((8, 9, 10)),
        ),
        min_size=1,
        max_size=20,
    )
)
def test_any_target_and_load_keeps_the_limits(native, targets):
    drive = native(RotaryDrive)
    drive.start(0.0)
    for position, velocity, load, torque, mode in targets:
        drive.target_position, drive.target_velocity, drive.target_torque = position, velocity, torque
        drive.load_torque, drive.mode_of_operation = load, mode
        for step in range(20):
            assert drive.advance(step * H, H) == OK
            assert abs(drive.current) <= drive.current_maximum * (1.0 + 1e-12)
            # teeth do not let go: their deflection is what peak torque and the frame's inertia make of it
            gap = abs(drive.motor_angle / drive.gear_ratio - drive.angle)
            assert gap < 0.5 * drive.backlash + 0.05


# ------------------------------------------------------------------------------------------------- supply and torque


def losses(drive, speed):
    """Torque of all frictions at the motor [N*m], at a speed of the frame."""
    frame = drive.friction_coulomb + drive.friction_viscous * abs(speed)
    return float(drive.motor_friction + frame / drive.gear_ratio)


@pytest.mark.parametrize("supply", [12.0, -24.0])
def test_the_top_speed_is_what_supply_and_friction_leave(native, supply):
    """At the motor: U = R i + k w, with the current that friction takes."""
    way = np.sign(supply)
    drive = native(RotaryDrive, supply_voltage=abs(supply), mode_of_operation=10, target_torque=way * 0.4)
    drive.start(0.0)
    run(drive, 3.0)
    current = losses(drive, drive.angular_velocity) / drive.torque_constant
    speed = (abs(supply) - 0.994 * current) / 0.091 / 5.0
    assert way * drive.angular_velocity == pytest.approx(speed, rel=2e-3)
    assert way * drive.current == pytest.approx(current, rel=0.02)


def test_a_stalled_motor_draws_what_the_resistance_lets_through(native):
    drive = native(RotaryDrive, supply_voltage=3.0, mode_of_operation=10, target_torque=0.4, load_torque=-1.37)
    drive.start(0.0)
    run(drive, 0.5)
    assert abs(drive.angular_velocity) < 1e-9
    assert drive.current == pytest.approx(3.0 / 0.994, rel=1e-6)


def test_electrical_power_is_loss_and_mechanical_power(native):
    """On the way to the top speed the whole supply is used: U i = R i^2 + M w."""
    drive = native(RotaryDrive, supply_voltage=12.0, mode_of_operation=10, target_torque=0.4)
    drive.start(0.0)
    run(drive, 0.2)
    for _ in range(20):
        run(drive, 0.01)
        speed, current = float(drive.rotor_velocity), float(drive.current)
        mechanical = float(drive.torque) * speed
        if current < 0.99 * 0.4 / 0.091:
            assert 12.0 * current == pytest.approx(0.994 * current**2 + mechanical, rel=5e-3)
    assert speed > 0.9 * 12.0 / 0.091 * 0.8


def test_the_integral_waits_while_the_voltage_is_at_its_limit(native):
    drive = native(RotaryDrive, supply_voltage=3.0, mode_of_operation=9, target_velocity=8.0)
    drive.start(0.0)
    run(drive, 2.0)
    assert drive.current_integral < 3.0 / 0.994
    drive.target_velocity = 2.0
    run(drive, 1.0)
    assert drive.velocity_actual_value == pytest.approx(2.0, rel=0.03)


def test_a_torque_turns_motor_and_frame_together(native):
    """In cst, after the backlash; the target is the motor's torque, the frame feels the gear ratio times as much."""
    drive = native(RotaryDrive, mode_of_operation=10, target_torque=0.25)
    drive.start(0.0)
    run(drive, 0.05)
    assert drive.torque == pytest.approx(0.25, rel=1e-9)
    begin = float(drive.angular_velocity)
    run(drive, 0.1)
    joined = drive.frame_inertia + drive.motor_inertia * drive.gear_ratio**2
    left = 5.0 * (0.25 - losses(drive, 0.5 * (begin + drive.angular_velocity))) / joined
    assert (drive.angular_velocity - begin) / 0.1 == pytest.approx(left, rel=0.01)


@pytest.mark.parametrize("mode", [8, 9])
def test_leaving_cst_does_not_jump(native, mode):
    drive = native(RotaryDrive, mode_of_operation=10, target_torque=0.3, load_torque=-1.5)
    drive.start(0.0)
    run(drive, 0.5)
    drive.mode_of_operation, drive.target_position = mode, drive.position_actual_value
    run(drive, H, h=H)
    assert drive.torque == pytest.approx(0.3, abs=5e-3)
    angle = float(drive.angle)
    run(drive, 0.3)
    assert drive.angle == pytest.approx(angle, abs=1e-4)
