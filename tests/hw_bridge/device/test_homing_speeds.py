"""Speeds, ends and failures of homing, cycle by cycle, with a motor that follows exactly."""

import pytest

from hw_bridge.bus import MILLISECOND
from hw_bridge.device.homing import Homing
from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.device.ideal_motor import Turned


def homing(method, **values):
    turned = Turned(x6098=method, x6099_1=40, x6099_2=10, x609A=400, x607C=100, **values)
    turned.drive.axis.switches.negative, turned.drive.axis.switches.home = -0.020, (4e-3, 9e-3)
    turned.enable(Mode.HM)
    turned.go(2)
    return turned


def test_homing_goes_fast_to_the_switch_and_slowly_off_it():
    turned = homing(19)
    assert turned.bits == "10"
    turned.write(0x6040, 0x1F)
    assert turned.bits == ""
    before = len(turned.motor.calls)
    turned.go(2000)
    assert turned.bits == "10 12"
    speeds = [1e3 * call[1] for call in turned.motor.calls[before:]]
    assert {call[0] for call in turned.motor.calls[before:]} == {"velocity"}
    assert speeds[:3] == [pytest.approx(speed) for speed in (0.4, 0.8, 1.2)]
    assert (max(speeds), min(speeds), speeds[-1]) == (pytest.approx(40), pytest.approx(-10), 0.0)
    axis = turned.drive.axis
    assert axis.origin + 100e-6 == pytest.approx(4e-3, abs=20e-6)
    assert axis.referenced
    assert axis.position == pytest.approx(turned.motor.measured_position - axis.origin)


def test_a_reference_on_the_spot_counts_607ch():
    turned = homing(37)
    turned.motor.measured_position = 3e-3
    turned.write(0x6040, 0x1F)
    turned.go(1)
    assert (turned.bits, turned.read(0x6064)) == ("10 12", 100)
    assert turned.drive.axis.origin == pytest.approx(2.9e-3)


@pytest.mark.parametrize(("method", "index"), [(33, -24_000), (34, 0)])
def test_the_index_pulse_is_the_reference_exactly(method, index):
    turned = homing(method)
    turned.drive.axis.switches.negative = None
    turned.motor.measured_position = -1e-3
    turned.go(1)
    turned.write(0x6040, 0x1F)
    turned.go(3000)
    assert turned.bits == "10 12"
    assert turned.drive.axis.origin == pytest.approx(1e-6 * index - 100e-6, abs=1e-12)


def test_homing_ends_with_its_bit_or_a_halt_and_fails_at_a_limit_switch():
    for word in (0x0F, 0x11F):
        turned = homing(19)
        turned.write(0x6040, 0x1F)
        turned.go(50)
        turned.write(0x6040, word)
        turned.go(200)
        assert turned.bits == "10"
        assert turned.motor.measured_velocity == 0.0
    turned = homing(21)  # in negative direction, from below the home switch: to the limit switch
    turned.write(0x6040, 0x1F)
    turned.go(3000)
    assert turned.bits == "10 13"
    assert turned.motor.measured_position == pytest.approx(-0.020 - 0.040**2 / 0.8, abs=1e-4)
    turned.write(0x6040, 0x11F)  # no new start while it is halted
    turned.write(0x6040, 0x0F)
    turned.go(1)
    assert turned.bits == "10 13"


def test_a_motor_that_does_not_move_fails_after_a_fifth_of_a_second():
    turned = homing(19)
    turned.motor.advance = lambda _time: None
    turned.motor.measured_velocity = 0.0
    turned.write(0x6040, 0x1F)
    turned.go(200)
    assert "13" not in turned.bits
    turned.go(2)
    assert "13" in turned.bits


@pytest.mark.parametrize(("share", "fails"), [(1.9e-3, True), (2.1e-3, False)])
def test_standing_is_less_than_two_thousandths_of_the_speed(share, fails):
    turned = homing(19)
    turned.motor.advance = lambda _time: None
    turned.motor.measured_velocity = 0.040 * share
    turned.write(0x6040, 0x1F)
    turned.go(300)
    assert ("13" in turned.bits) is fails


def test_homing_in_another_mode_is_none():
    turned = homing(19)
    assert isinstance(turned.drive.mode, Homing)
    assert turned.drive.state is State.ENABLED
    turned.write(0x6060, Mode.PV)
    turned.go(1)
    assert not isinstance(turned.drive.mode, Homing)
    assert turned.read(0x6061) == Mode.PV
    assert turned.drive.now % MILLISECOND == 0
