"""Components of the measured machines: start from a measurement, friction, lag, slack tendons."""

import math

import pytest

from fmus.instruments.steerable_tip.model import SteerableTip, static_position
from fmus.instruments.tendon_segments.model import TendonSegments

MM = 1e-3


def test_a_roll_out_starts_at_the_measured_position():
    tip = SteerableTip(tendon_displacement=2 * MM, start_x=-12 * MM, start_velocity=0.1)
    tip.start()
    assert tip.tip_x == -12 * MM


def test_the_tip_lies_on_an_arc():
    tip = SteerableTip(start_x=20 * MM)
    tip.start()
    # 58 mm of arc, 20 mm across: angle 0.7208 rad
    assert tip.tip_z == pytest.approx(-4 * MM + 53.1 * MM, abs=0.1 * MM)


def test_friction_holds_the_tip_back_in_both_directions():
    tip = SteerableTip(start_x=-0.5 * MM)
    tip.start()
    at_zero = []
    for target in (3.0, 0.0, -3.0, 0.0):
        begin = tip.tendon_displacement
        for k in range(1, 101):
            tip.tendon_displacement = begin + (target * MM - begin) * k / 100
            tip.advance(0.0, 2 * MM)
        for _ in range(100):
            tip.advance(0.0, 2 * MM)
        if target == 0.0:
            at_zero.append(tip.tip_x - tip.offset)
    # positive displacement moves the tip to negative x: on the way back it lags behind on that side
    assert at_zero == pytest.approx([-tip.friction, tip.friction], rel=0.01)


def test_the_lag_of_a_run_follows_from_a_fast_start():
    late = SteerableTip(lag=0.05, lag_deviation=0.01, start_x=-12 * MM, start_velocity=0.2)
    late.start()
    assert 0.025 <= late.delay <= 0.075
    assert late.delay != late.lag


def test_a_delay_at_the_start_goes_on_in_motion_and_ends_at_rest():
    """A tip that is 9 ms late at 0.4 m/s is so while the tendon moves on; at half the speed back it is half on the other side."""
    tip = SteerableTip(lag=1e-3, lag_deviation=6e-3, friction=0.0, start_x=3.2 * MM, start_velocity=-0.4)
    tip.start()
    errors = []
    for velocity in (0.4 / 6.6, 0.0, -0.2 / 6.6, 0.0):
        for _ in range(10):
            tip.tendon_displacement += velocity * 2 * MM
            tip.advance(0.0, 2 * MM)
        errors.append((tip.tip_x - static_position(tip, tip.tendon_displacement)) / MM)
    assert errors == pytest.approx([3.6, 0.0, -1.75, 0.0], abs=0.15)


def test_slack_tendons_do_not_push():
    robot = TendonSegments()
    robot.start()
    straight = robot.tip_z
    robot.displacement[:] = -10 * MM
    robot.start()
    assert robot.tip_z == pytest.approx(straight)
    assert straight == pytest.approx(sum(robot.length))


def test_a_slack_robot_rests_on_the_side_of_the_last_pull():
    """Moments of bending k a, friction f and tendon r (d - 3 r a), with the tendon past all three segments."""
    k, f, r, d = 5e-6, 5e-7, 4.5e-3, 3 * MM
    robot = TendonSegments(direction=(0.0, 2.1, -2.1) * 3, friction=(f,) * 3)
    robot.displacement[:] = -10 * MM
    robot.start()
    for pull, expected in ((d, (r * d - f) / (k + 3 * r**2)), (-10 * MM, f / k)):
        robot.displacement[8] = pull
        robot.advance(0.0, 1.0)
        for i in range(3):
            x, y = robot.angle[2 * i : 2 * i + 2]
            assert math.hypot(x, y) == pytest.approx(expected, rel=1e-3)
            assert math.atan2(y, x) == pytest.approx(-2.1, abs=1e-6)


def test_a_pulled_tendon_bends_to_its_side():
    robot = TendonSegments(direction=(0.0, 2.1, -2.1) * 3)
    robot.displacement[:] = -10 * MM
    robot.displacement[0] = 3 * MM
    robot.start()
    assert robot.tip_x > 50 * MM
    assert abs(robot.tip_y) < 1e-9
