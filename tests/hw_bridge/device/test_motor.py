"""Motors of the twin behind one face."""

import re
from dataclasses import replace
from math import sqrt

import pytest

from hw_bridge.device import Motor
from hw_bridge.device.motor import CYCLE, uneven
from hw_bridge.profiles import profile
from twin.errors import SimulationError
from twin.scenario import Backend

LM2070, EC_I_40 = profile("faulhaber_v3").motor, profile("epos4").motor


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
    for model in (LM2070, EC_I_40):
        for demand in (0.3, -0.5):
            motor = Motor(model, build=build)
            motor.follow_current(demand, 2.0)
            run(motor, 10)
            assert motor.current == pytest.approx(demand, rel=1e-6)


@pytest.mark.parametrize(("limit", "supply"), [(0.4, 24.0), (99.0, 24.0), (99.0, 48.0)])
def test_the_limit_holds(build, limit, supply):
    """Of the demand, of the motor, and of what its supply can drive."""
    motor = Motor(LM2070, build=build)
    motor.set("supply_voltage", supply)
    motor.follow_velocity(1.0, limit)
    run(motor, 5)
    possible = (supply - 9.5 * motor.get("velocity")) / (sqrt(1.5) * 10.83)
    assert motor.current == pytest.approx(min(limit, 2.37, possible), rel=2e-3)


def test_interpreted_and_compiled_are_the_same(build):
    found = []
    for form in (Backend.interpreted, Backend.compiled):
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


def test_the_ec_i_40_counts_before_its_gear(build):
    motor = Motor(EC_I_40, build=build)
    motor.follow_position(10.0, 15.0)
    run(motor, 1500)
    assert motor.measured_position == pytest.approx(10.0, abs=2.0 * EC_I_40.resolution)
    assert motor.get("angle") == pytest.approx(2.0, abs=3e-3)  # half of the backlash
    assert (LM2070.force_constant, EC_I_40.force_constant) == (11.64, 0.091)


@pytest.mark.parametrize("model", [LM2070, EC_I_40], ids=["LM 2070", "EC-i 40"])
def test_where_it_was_pushed_to_without_power_is_no_jump(build, model):
    """Power comes back with the place where the motor is as its target."""
    motor = Motor(model, build=build)
    motor.follow_position(0.0, 2.0)
    run(motor, 5)
    motor.off()
    motor.load(20.0)
    run(motor, 30)
    motor.load(0.0)
    run(motor, 2000)  # friction brakes the rig
    place = motor.measured_position
    assert abs(place) > 1e-3
    for cycle in range(50):
        motor.follow_position(place, 2.0)
        motor.advance(cycle * CYCLE)
        assert abs(motor.current) < 0.05
    assert motor.measured_position == pytest.approx(place, abs=2.0 * model.resolution)


@pytest.mark.parametrize(
    ("period", "problem"),
    [
        (0.3e-3, "drive_period 0.3 ms does not divide the drive's control cycle of 1 ms. Use 0.5 ms or 0.25 ms."),
        (0.7e-3, "drive_period 0.7 ms does not divide the drive's control cycle of 1 ms. Use 1 ms or 0.5 ms."),
        (2e-3, "drive_period 2 ms does not divide the drive's control cycle of 1 ms. Use 1 ms."),
        (0.5e-3, ""),
        (0.2e-3, ""),
        (1e-3, ""),
    ],
)
def test_a_sampling_time_that_does_not_divide_the_cycle_is_the_cause_that_is_named(build, period, problem):
    motor = Motor(replace(LM2070, parameters={"drive_period": period}), build=build)
    assert uneven(period) == problem
    if problem:
        with pytest.raises(SimulationError, match=re.escape(f"motor: {problem}")):
            motor.advance(0)
    else:
        motor.advance(0)


@pytest.mark.parametrize("index", [0x6072, 0x60E0, 0x60E1])
def test_the_smallest_torque_limit_bounds_the_current(faulhaber, index):
    """In thousandths of the rated current; limits that are larger do not matter."""
    faulhaber.write(index, 500)
    currents = faulhaber.drive.profile.currents(faulhaber.drive.dictionary)
    assert currents.peak == pytest.approx(0.5 * currents.continuous)


def test_a_sensor_with_an_offset_and_one_that_sticks(build):
    motor = Motor(replace(LM2070, ratio=5.0), build=build, position=0.02)
    assert motor.measured_position == motor.position == pytest.approx(0.02)
    motor.offset = 1e-3
    assert motor.measured_position == pytest.approx(0.021)
    motor.follow_position(0.03, 2.0)
    assert motor.get("target_position") == pytest.approx(0.029 / 5)
    run(motor, 20)
    assert motor.measured_velocity == pytest.approx(5.0 * motor.get("velocity_actual_value"))
    assert motor.measured_velocity > 0.0
    motor.stick()
    stuck = motor.measured_position
    run(motor, 100)
    assert (motor.measured_position, motor.measured_velocity) == (stuck, 0.0)
    assert motor.position > stuck


def test_loads_gains_and_limits_reach_the_component(build):
    motor = Motor(LM2070, build=build)
    motor.grip = 0.25
    motor.load(8.0)
    assert motor.get("load_force") == 2.0
    for force in (float("inf"), float("nan")):
        with pytest.raises(SimulationError, match=r"^motor: load_force is (inf|nan)\. Look at what it comes from\.$"):
            motor.load(force)
    gain = motor.get("velocity_gain")
    for factor in (2.0, 2.0, 0.5):
        motor.tune("velocity_gain", factor)
        assert motor.get("velocity_gain") == pytest.approx(gain * factor)
    motor.set("velocity_gain", 10.0)
    assert motor.get("velocity_gain") == 5.0  # tuned to a half
    motor.scale("velocity_gain", 3.0)
    assert motor.get("velocity_gain") == 15.0
    assert motor.strongest == 2.37
    assert motor.get("current_continuous") == pytest.approx(23.7)
    motor.set("supply_voltage", 30.0)
    assert motor.supply == 30.0


@pytest.mark.parametrize(("limit", "maximum"), [(1.0, 1.0), (9.0, 2.37)])
def test_commands_reach_the_component(build, limit, maximum):
    motor = Motor(LM2070, build=build)
    assert (motor.get("mode_of_operation"), motor.get("current_maximum")) == (9, 0.0)  # it begins switched off
    motor.follow_velocity(0.3, limit, current=0.5)
    assert [motor.get(name) for name in ("mode_of_operation", "target_velocity", "current_maximum")] == [
        9,
        0.3,
        maximum,
    ]
    assert (motor.get("current_integral"), motor.powered) == (0.5, True)
    motor.follow_velocity(0.3, limit, current=0.2)
    assert motor.get("current_integral") == pytest.approx(0.2)
    motor.follow_current(0.4, limit)
    assert (motor.get("mode_of_operation"), motor.get("target_force")) == (10, pytest.approx(0.4 * 11.64))
    motor.follow_velocity(0.3, limit, current=0.2)  # the integral was this current: it is added anew
    assert motor.get("current_integral") == pytest.approx(0.4)
    motor.off()
    names = ("mode_of_operation", "current_maximum", "current_integral")
    assert ([motor.get(name) for name in names], motor.powered) == ([9, 0.0, 0.0], False)
