"""Homing methods with switches, index and end stops."""

from math import copysign

import pytest

from hw_bridge.dictionary import HomingEvent, Mode, cia402
from tests.matrix import covering

ENDED = cia402.BIT_12 | cia402.BIT_13  # attained, or an error
SHOWN = ENDED | cia402.TARGET_REACHED


def homed(bench, milliseconds):
    """Until it stands and has attained or failed, at the latest after this time; what the word shows then stays."""
    while milliseconds > 0 and not (bench.word & ENDED and bench.word & cia402.TARGET_REACHED):
        bench.go(50)
        milliseconds -= 50
    word = bench.word & SHOWN
    bench.go(200)
    assert bench.word & SHOWN == word


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("method", "place"),
    [
        (17, -0.010),
        (18, 0.012),
        (1, 0.0),
        (2, 0.0),
        (19, 0.004),
        (20, 0.004),
        (21, 0.006),
        (22, 0.006),
        (23, 0.004),
        (27, 0.006),
        (33, 0.0),
        (34, 0.024),
        (-3, -0.040),
        (-4, 0.040),
    ],
)
def test_homing_methods(faulhaber, method, place):
    bench = faulhaber
    switches = bench.drive.axis.switches
    switches.negative, switches.positive, switches.home = -0.010, 0.012, (0.004, 0.006)
    if method in (33, 34, -3, -4):
        switches.negative, switches.positive = None, None
    bench.write(0x6098, method)
    bench.write(0x6099, 40, 1)
    bench.write(0x607C, 100)
    bench.enable(Mode.HM)
    start = {33: 0.002, 21: 0.010, 22: 0.010}.get(method, 0.0)  # beside the index at 0, beyond the switch
    bench.drive.axis.motor._views["rod_position"][...] = start
    bench.go(3)
    bench.control(0x1F)
    assert bench.word & 0x3400 == 0
    homed(bench, 4000)
    assert bench.word & 0x3400 == 0x1400
    assert bench.drive.axis.origin + 100e-6 == pytest.approx(place, abs=1.2e-4)


HOME_SWITCH = [
    (7, (4, 6), 0),
    (8, (-2, 6), 0),
    (9, (-2, 6), 0),
    (10, (-4, -2), 0),
    (11, (-4, -2), 0),
    (12, (-2, 6), 0),
    (13, (-2, 6), 0),
    (14, (4, 6), 0),
    (23, (4, 6), 4),
    (24, (4, 6), 4),
    (25, (4, 6), 6),
    (26, (4, 6), 6),
    (27, (4, 6), 6),
    (28, (4, 6), 6),
    (29, (4, 6), 4),
    (30, (4, 6), 4),
]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("case", "start"), covering(HOME_SWITCH, [-8, 5, 9]))
def test_the_home_switch_is_found_from_either_side_and_from_on_it(faulhaber, case, start):
    """Methods 7 to 14 and 23 to 30 of CiA 402: the end of the switch and the index beside it, all in millimeters.

    A limit switch turns a search round that began on the wrong side.
    """
    (method, home, place), bench = case, faulhaber
    switches = bench.drive.axis.switches
    switches.negative, switches.positive, switches.home = -0.010, 0.012, (1e-3 * home[0], 1e-3 * home[1])
    bench.write(0x6098, method)
    bench.write(0x6099, 40, 1)
    bench.drive.axis.motor._views["rod_position"][...] = 1e-3 * start
    bench.enable(Mode.HM)
    bench.control(0x1F)
    homed(bench, 4000)
    assert bench.word & 0x3400 == 0x1400
    assert bench.drive.axis.origin == pytest.approx(1e-3 * place, abs=1.2e-4)


def test_homing_without_the_switch_fails(faulhaber):
    bench = faulhaber
    bench.write(0x6098, 17)
    bench.enable(Mode.HM)
    bench.control(0x1F)
    homed(bench, 2000)
    assert bench.word & 0x3400 == 0x2400
    assert bench.drive.axis.motor.position == pytest.approx(-0.040, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "place"), [(-1, -0.024), (-2, 0.024)])
@pytest.mark.parametrize("slow", [2, 10])
def test_the_index_is_found_after_a_long_push_at_the_stop(faulhaber, method, place, slow):
    """What the loops gathered at the stop does not hold the motor there when it has to come back, however slowly."""
    bench = faulhaber
    bench.write(0x6098, method)
    bench.write(0x6099, slow, 2)
    bench.drive.axis.motor._views["rod_position"][...] = 1.6 * place
    bench.enable(Mode.HM)
    bench.control(0x1F)
    homed(bench, 20_000 if slow == 2 else 6000)
    assert bench.word & 0x3400 == 0x1400
    assert bench.drive.axis.motor.measured_position == pytest.approx(place, abs=2e-3)
    assert abs(bench.drive.axis.position) < 2e-3


@pytest.fixture
def turning(make):
    """An EPOS4 whose frame is between two blocks, 6 rad of the motor from where it begins."""
    bench = make("epos4")
    motor = bench.drive.axis.motor

    def turned(method, threshold):
        bench.write(0x6098, method)
        bench.write(0x6099, 100, 1)
        bench.write(0x6099, 20, 2)
        bench.write(0x30B2, threshold)
        bench.enable(Mode.HM)
        bench.control(0x1F)
        for _ in range(10_000):
            place = motor.position
            motor.load(-copysign(200.0 * max(abs(place) - 6.0, 0.0), place))  # [N*m] for one radian of the motor
            bench.go(1)
            if bench.word & 0x3400 in (0x1400, 0x2400):
                return bench
        raise AssertionError(f"{bench.word:04X}")

    return turned


@pytest.mark.slow
@pytest.mark.parametrize(("method", "place"), [(-1, 0.0), (-2, 0.0), (-3, 6.0), (-4, -6.0)])
def test_homing_of_the_rotary_drive(turning, method, place):
    """On a block, and on the index at 0 behind it, with a current that overcomes the friction of the rig."""
    bench = turning(method, 2000)
    assert bench.word & 0x3400 == 0x1400
    assert bench.drive.axis.origin == pytest.approx(place, abs=0.03)
    assert bench.drive.axis.heat < 2.0**2


def test_friction_is_taken_for_the_block(turning):
    """The default threshold of 500 mA does not move the rig: what the drive then calls a block is none."""
    bench = turning(-3, 500)
    assert bench.word & 0x3400 == 0x1400
    assert abs(bench.drive.axis.origin) < 0.1


def test_homing_is_interrupted_by_its_bit(faulhaber):
    bench = faulhaber
    bench.write(0x6098, 18)
    bench.enable(Mode.HM)
    bench.control(0x1F)
    bench.go(50)
    bench.control(0x0F)
    bench.go(200)
    assert bench.word & 0x3400 == 0x0400
    assert abs(bench.read(0x606C)) < 2


def test_moves_name_conditions_in_the_order_of_the_switches(faulhaber):
    switches = faulhaber.drive.axis.switches
    switches.negative, switches.positive, switches.home = -1.0, 1.0, (-0.1, 0.1)
    for place, until in ((-2.0, HomingEvent.NEGATIVE), (2.0, HomingEvent.POSITIVE), (0.0, HomingEvent.HOME)):
        assert [number for number, closed in enumerate(switches.closed(place)) if closed] == [until]
