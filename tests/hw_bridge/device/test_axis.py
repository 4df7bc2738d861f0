"""An axis of a drive in numbers: actual values, limits of current, demands, switches, ramps and times."""

from math import inf, pi, sqrt

import pytest

from hw_bridge.bus import MILLISECOND
from hw_bridge.device.axis import Switches
from hw_bridge.dictionary import HomingEvent
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import axis

RPM = 2 * pi / 60


@every_case(
    ("switches", "position", "closed"),
    [
        (Switches(), 0.0, (False, False, False)),
        (Switches(negative=-1.0), -1.0, (True, False, False)),
        (Switches(negative=-1.0), -0.999, (False, False, False)),
        (Switches(positive=1.0), 1.0, (False, True, False)),
        (Switches(positive=1.0), 0.999, (False, False, False)),
        (Switches(negative=0.0, positive=0.0), 0.0, (True, True, False)),
        (Switches(home=(-1.0, 1.0)), -1.0, (False, False, True)),
        (Switches(home=(-1.0, 1.0)), 1.0, (False, False, True)),
        (Switches(home=(-1.0, 1.0)), -1.001, (False, False, False)),
        (Switches(home=(-1.0, 1.0)), 1.001, (False, False, False)),
    ],
)
def test_switches_close_at_their_edges(switches, position, closed):
    assert switches.closed(position) == closed


ACTUAL = {
    "faulhaber_v3": {
        (0x6064, 0): 2500,  # [um] from the origin
        (0x6062, 0): 3000,
        (0x606C, 0): -12,  # [mm/s]
        (0x606B, 0): 20,
        (0x60F4, 0): 500,
        (0x6063, 0): 375,  # increments of 8 um from where the sensor counts
        (0x6077, 0): 633,  # thousandths of 790 mA
        (0x6078, 0): 500,  # [mA]
        (0x2325, 7): 2350,  # [10 mV]
    },
    "mclm": {
        (0x6064, 0): 2500,
        (0x6062, 0): 3000,
        (0x606C, 0): -12,
        (0x606B, 0): 20,
        (0x6063, 0): 375,
        (0x2562, 0): 375,  # increments of the demand
        (0x6078, 0): 500,
        (0x2334, 0): 2370,  # [mA]
    },
}


@pytest.mark.parametrize("name", ACTUAL)
def test_actual_values_in_units_of_the_drive(name):
    turned = axis(name, **({"x2350_4": 24} if name == "mclm" else {}))
    motor = turned.motor
    motor.measured_position, motor.measured_velocity, motor.current, motor.supply = 3e-3, -12.4e-3, 0.5, 23.5
    turned.origin, turned.demand, turned.speed, turned.holds_position = 0.5e-3, 3e-3, 20e-3, True
    turned.measure()
    assert {address: turned.dictionary.values[address] for address in ACTUAL[name]} == ACTUAL[name]
    assert turned.following_error == pytest.approx(0.5e-3)


def test_actual_values_of_a_rotary_drive():
    turned = axis("epos4")
    motor = turned.motor
    motor.measured_position, motor.measured_velocity, motor.current, motor.supply = pi, 10 * RPM, -2.5, 23.96
    turned.heat = 12.5
    turned.measure()
    heat = 12.5 + (6.25 - 12.5) * (1 - 2.718281828459045 ** (-1e-3 / 4.0))
    expected = {
        (0x6064, 0): 1000,
        (0x6062, 0): 1000,
        (0x606C, 0): 10,
        (0x606B, 0): 0,
        (0x60F4, 0): 0,
        (0x6077, 0): -500,
        (0x30D1, 2): -2500,
        (0x2200, 1): 240,
        (0x3200, 1): round(100 * heat / 25),
    }
    assert {address: turned.dictionary.values[address] for address in expected} == expected
    assert turned.demand == turned.position  # no position is demanded: the demand follows


@pytest.mark.parametrize(("current", "shown"), [(1e3, 0x7FFF), (-1e3, -0x8000), (25.881, 32761)])
def test_actual_values_stay_within_their_type(current, shown):
    turned = axis()
    turned.motor.current = current
    turned.measure()
    assert turned.dictionary.get(0x6077) == shown


@pytest.mark.parametrize(("position", "inputs"), [(-0.02, 1), (0.02, 2), (0.005, 4), (0.0, 0)])
def test_switches_are_shown_in_60fdh(position, inputs):
    turned = axis()
    turned.switches = Switches(-0.01, 0.01, (0.004, 0.006))
    turned.motor.measured_position = position
    turned.measure()
    assert turned.dictionary.get(0x60FD) == inputs


@every_case(
    ("name", "values", "factors"),
    [
        ("faulhaber_v3", {}, {"velocity_gain": 1.0, "velocity_integral": 1.0}),
        ("faulhaber_v3", {"x2344_1": 2000}, {"velocity_gain": 2.0, "velocity_integral": 2.0}),
        ("faulhaber_v3", {"x2344_1": 500, "x2344_2": 160}, {"velocity_gain": 0.5, "velocity_integral": 0.25}),
        ("faulhaber_v3", {"x2344_1": 0}, {"velocity_gain": 1e-3, "velocity_integral": 1e-3}),  # 0 counts as 1
        (
            "epos4",
            {"x30A1_1": 3_000_000, "x30A2_1": 5_000, "x30A2_2": 1_500_000},
            {"position_gain": 2.0, "velocity_gain": 0.25, "velocity_integral": 3.0},
        ),
        ("mclm", {}, {}),
    ],
)
def test_gains_are_multiples_of_the_motors_own(name, values, factors):
    assert axis(name, **values).motor.tuned == factors


def test_i2t_takes_the_current_back_and_gives_it_again():
    """The mean square follows with the thermal time constant; from 100 % on the continuous current counts, below 81 % the peak."""
    turned = axis()
    continuous, peak = 0.79, 1.58
    turned.motor.current = peak
    cycles = 0
    while not turned.derated:
        assert turned.limit == pytest.approx(peak)
        turned.measure()
        cycles += 1
    # 1 - exp(-t/T) = (continuous/peak)^2 = 1/4, T = 15 s
    assert cycles == pytest.approx(15_000 * 0.28768207, abs=2)
    assert turned.limit == pytest.approx(continuous)
    assert turned.level == pytest.approx(1.0, abs=1e-3)
    turned.motor.current = 0.0
    while turned.derated:
        turned.measure()
        assert turned.level >= 0.8099 or not turned.derated
    assert turned.level == pytest.approx(0.81, abs=1e-3)
    assert turned.limit == pytest.approx(peak)


def test_a_drive_is_derated_at_exactly_its_continuous_current():
    turned = axis()
    turned.heat = turned.motor.current = 0.0
    square = turned.currents.continuous * turned.currents.continuous
    turned.heat, turned.motor.current = square, sqrt(square)
    turned._derate(turned.currents.continuous)
    assert turned.derated
    turned.heat, turned.derated = 0.81 * square, True
    turned._derate(0.9 * turned.currents.continuous)
    assert turned.level == pytest.approx(0.81)


@pytest.mark.parametrize(
    ("current", "powered", "limited"),
    [(1.5785, True, True), (-1.5785, True, True), (1.578, True, False), (1.58, False, False)],
)
def test_the_current_is_at_its_limit_from_999_thousandths_on(current, powered, limited):
    turned = axis()
    turned.motor.current, turned.motor.powered = current, powered
    turned.measure()
    assert turned.limited is limited


def test_the_limit_of_the_motor_counts_too():
    turned = axis()
    turned.motor.strongest, turned.motor.current, turned.motor.powered = 1.0, 1.0, True
    turned.measure()
    assert turned.limited


def test_without_a_rated_current_there_is_no_level():
    turned = axis(x6075=0)
    turned.measure()
    assert (turned.level, turned.limit) == (0.0, 0.0)


LIMITS = {"x607D_1": -1000, "x607D_2": 2000}  # [um]


@every_case(
    ("target", "demand", "clipped"),
    [(2e-3, 2e-3, False), (2.001e-3, 2e-3, True), (-1e-3, -1e-3, False), (-1.001e-3, -1e-3, True), (0.0, 0.0, False)],
)
def test_a_position_is_demanded_within_the_software_limits(target, demand, clipped):
    turned = axis(**LIMITS)
    turned.origin = 0.1
    turned.measure()
    turned.follow_position(target, 0.5, current=0.25)
    assert (turned.demand, turned.clipped, turned.speed, turned.holds_position) == (demand, clipped, 0.5, True)
    assert turned.motor.calls[-1] == ("position", pytest.approx(demand + 0.1), turned.limit, 0.0, 0.25)


@every_case(
    ("offset", "sent", "clipped"),
    [
        (0.0, 0.0, False),
        (2.0, 2.0, False),
        (2.1, 2.0, True),
        (-2.0, -2.0, False),
        (-2.1, -2.0, True),
        (0.5, 0.5, False),
    ],
)
def test_a_velocity_offset_is_within_the_largest_speed(offset, sent, clipped):
    turned = axis()
    turned.follow_position(0.0, offset=offset)
    assert (turned.motor.calls[-1][3], turned.clipped) == (pytest.approx(sent), clipped)


def test_a_clipped_target_stays_clipped_with_an_offset_that_is_not():
    turned = axis(**LIMITS)
    turned.follow_position(1.0, offset=0.5)
    assert turned.clipped


@every_case(("ahead", "heading"), [(4.01, 4.01), (4.0, 0.0), (-4.0, 0.0), (-4.01, -4.01), (0.0, 0.0)])
def test_a_position_asks_for_motion_from_four_increments_on(ahead, heading):
    turned = axis()
    turned.follow_position(ahead * turned.motor.model.resolution)
    assert turned.heading == pytest.approx(heading * turned.motor.model.resolution, abs=1e-12)


@every_case(
    ("velocity", "limit", "speed", "clipped", "heading", "current"),
    [
        (1.0, None, 1.0, False, 1.0, 1.58),
        (-1.0, 0.5, -1.0, False, -1.0, 0.5),
        (2.5, 9.0, 2.0, True, 2.0, 1.58),
        (-2.5, None, -2.0, True, -2.0, 1.58),
        (1e-6, None, 1e-6, False, 0.0, 1.58),
        (1.1e-6, None, 1.1e-6, False, 1.1e-6, 1.58),
        (-1.1e-6, None, -1.1e-6, False, -1.1e-6, 1.58),
    ],
)
def test_a_speed_is_demanded_within_the_largest_one(velocity, limit, speed, clipped, heading, current):
    turned = axis()
    turned.holds_position = True
    turned.follow_velocity(velocity, limit, 0.125)
    assert (turned.speed, turned.clipped, turned.heading) == (pytest.approx(speed), clipped, pytest.approx(heading))
    assert turned.holds_position is False
    assert turned.motor.calls[-1] == ("velocity", pytest.approx(speed), pytest.approx(current), 0.125)


@every_case(
    ("current", "velocity", "clipped", "heading"),
    [
        (0.5, -0.1, False, 0.5),
        (0.0, -0.1, False, -0.1),
        (0.0, 1e-6, False, 0.0),
        (0.0, -1.1e-6, False, -1.1e-6),
        (1.57999, 0.0, False, 1.57999),
        (-1.59, 0.0, True, -1.59),
        (1.59, 0.0, True, 1.59),
    ],
)
def test_a_current_is_demanded(current, velocity, clipped, heading):
    turned = axis()
    turned.velocity = velocity
    turned.holds_position = True
    turned.follow_current(current)
    assert (turned.speed, turned.clipped, turned.heading, turned.holds_position) == (velocity, clipped, heading, False)
    assert turned.motor.calls[-1] == ("current", current, pytest.approx(1.58))


def test_off_ends_every_demand():
    turned = axis()
    turned.follow_position(0.01, 0.5)
    turned.off()
    assert (turned.holds_position, turned.speed, turned.heading) == (False, 0.0, 0.0)
    assert turned.motor.calls[-1] == ("off",)


@every_case(
    ("position", "heading", "event"),
    [
        (-0.01, -1.0, HomingEvent.NEGATIVE),
        (-0.01, 1.0, None),
        (-0.01, 0.0, None),
        (0.01, 1.0, HomingEvent.POSITIVE),
        (0.01, -1.0, None),
        (0.0, 1.0, None),
        (0.0, -1.0, None),
    ],
)
@every_case("wired", [(-0.01, None), (None, 0.01), (-0.01, 0.01), (None, None)])
def test_the_closed_limit_switch_ahead(position, heading, event, wired):
    turned = axis()
    turned.switches = Switches(*wired)
    turned.motor.measured_position = position
    is_wired = {HomingEvent.NEGATIVE: wired[0], HomingEvent.POSITIVE: wired[1], None: None}[event] is not None
    assert turned.limit_switch(heading) is (event if is_wired else None)


@every_case(
    ("name", "values", "limits"),
    [
        ("faulhaber_v3", LIMITS, (-1e-3, 2e-3)),
        ("faulhaber_v3", {"x607D_1": 0, "x607D_2": 0}, (0.0, 0.0)),
        ("epos4", {}, (-inf, inf)),  # both 0: none
        ("epos4", {"x607D_2": 1000}, (0.0, pi)),
        ("epos4", {"x607D_1": -1000}, (-pi, 0.0)),
        ("mclm", {"x2350_4": 24}, (-9.996e-3, 9.996e-3)),
        ("mclm", {"x2338_3": 0}, (-inf, inf)),  # switched off
    ],
)
def test_software_limits(name, values, limits):
    assert axis(name, **values).range() == (pytest.approx(limits[0]), pytest.approx(limits[1]))


@pytest.mark.parametrize(
    ("values", "lacks", "largest"),
    [
        ({"x607F": 500, "x6080": 400}, (), 0.4),
        ({"x607F": 300, "x6080": 400}, (), 0.3),
        ({"x607F": 500}, (0x6080,), 0.5),
        ({}, (0x607F, 0x6080), 0xFFFFFFFF * 1e-3),
    ],
)
def test_the_largest_speed_is_the_smaller_of_607fh_and_6080h(values, lacks, largest):
    assert axis(lacks=lacks, **values).fastest() == pytest.approx(largest)


@every_case(
    ("index", "lacks", "rate"),
    [
        (0x6083, (), 1.0),
        (0x6084, (), 2.0),
        (0x6085, (), 4.0),
        (0x6085, (0x6085,), 2.0),
        (0x6085, (0x6085, 0x6084), 1.0),
        (0x609A, (0x609A,), 2.0),
        (0x6085, (0x6083, 0x6084, 0x6085), 1e-3),
    ],
)
def test_accelerations_and_what_replaces_them(index, lacks, rate):
    values = {"x6083": 1000, "x6084": 2000, "x6085": 4000}
    turned = axis(**values)
    for missing in lacks:
        turned.dictionary.remove(missing)
    assert turned.rate(index) == pytest.approx(rate)


def test_an_acceleration_of_0_is_the_smallest_one():
    turned = axis(x6083=0)
    assert turned.rate(0x6083) == pytest.approx(1e-3)


def test_a_condition_lasts_from_when_it_began():
    turned = axis()
    queue = turned.event_queue

    def at(time, condition):
        queue.advance(time)
        return turned.lasting(0x6065, condition, 3)

    assert at(0, False) is False
    assert [at(time * MILLISECOND, True) for time in (1, 2, 3)] == [False, False, False]
    assert at(4 * MILLISECOND - 1, True) is False
    assert at(4 * MILLISECOND, True) is True
    assert at(5 * MILLISECOND, False) is False
    assert [at(time * MILLISECOND, True) for time in (6, 8, 9)] == [False, False, True]
    assert turned.lasting(0x6067, True, 0) is True  # another condition, at once


def test_power_on_begins_where_the_motor_is():
    turned = axis()
    turned.motor.measured_position = 0.02
    turned.referenced, turned.heat, turned.derated, turned.windows = True, 5.0, True, {1: 2}
    turned.start()
    assert (turned.origin, turned.position, turned.demand, turned.referenced) == (0.02, 0.0, 0.0, False)
    assert (turned.heat, turned.derated, turned.limited, turned.clipped, turned.windows) == (
        0.0,
        False,
        False,
        False,
        {},
    )
