"""Motors of the twin behind one face."""

from dataclasses import replace

import pytest

from hw_bridge.drive.motor import CYCLE, Motor
from hw_bridge.profiles import profile
from twin.members import Form

LM2070 = profile("faulhaber_v3").motor


def run(motor, cycles):
    for cycle in range(cycles):
        motor.advance(cycle * CYCLE)


def test_without_power_there_is_no_current(build):
    motor = Motor(LM2070, build=build)
    motor.load(5.0)
    run(motor, 50)
    assert motor.current == 0.0
    assert motor.position > 1e-3  # the load moves it


def test_current_is_what_was_demanded(build):
    for demand in (0.3, -0.5):
        motor = Motor(LM2070, build=build)
        motor.follow_current(demand, 2.0)
        run(motor, 10)
        assert motor.current == pytest.approx(demand, rel=1e-6)


@pytest.mark.parametrize("limit", [0.4, 99.0])
def test_the_limit_holds(build, limit):
    motor = Motor(LM2070, build=build)
    motor.follow_velocity(1.0, limit)
    run(motor, 5)
    assert motor.current == pytest.approx(min(limit, 2.37), rel=1e-3)


def test_interpreted_and_compiled_are_the_same(build):
    found = []
    for form in (Form.interpreted, Form.compiled):
        motor = Motor(LM2070, form, build, position=0.01)
        motor.follow_position(0.012, 1.0)
        run(motor, 20)
        found.append((motor.position, motor.measured_velocity, motor.current))
    assert found[0] == found[1]


def test_behind_a_gear_the_motor_counts(build):
    geared = Motor(replace(LM2070, ratio=5.0), build=build)
    geared.follow_position(0.05, 2.0)
    run(geared, 400)
    assert geared.measured_position == pytest.approx(0.05, abs=5e-5)
