"""Offsets 60B1h and 60B2h in the cyclic modes: fed forward into the loops in csp and csv, as CiA 402 has it."""

import pytest

from hw_bridge.dictionary import Mode
from tests.hw_bridge.bench import Bench

LOAD = 5.0  # [N]


@pytest.fixture
def bench(build):
    def make(name):
        made = Bench(name, build)
        made.drive.dictionary.put(0x6065, 0xFFFFFFFF)  # what it lags behind is measured here, not watched
        made.write(0x60C2, 5, 1)
        made.enable(Mode.CSP)
        return made

    return make


def ramp(bench, speed, offset, cycles=200):
    """Mean following error at the end of a ramp [s of its speed]; targets and offset in device units each 5 ms."""
    units, get = bench.drive.axis.units, bench.drive.dictionary
    position, errors = 0.0, []
    for cycle in range(cycles):
        position += speed * 0.005
        get.put(0x607A, round(position / units.position))
        get.put(0x60B1, round(offset * speed / units.velocity))
        bench.drive.last_target_at = bench.drive.port.event_queue.now
        for _ in range(5):
            bench.go(1)
            if cycle >= cycles - 20:
                errors.append(bench.drive.axis.following_error)
    return sum(errors) / len(errors) / speed


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "speed", "gain", "own"),
    [("faulhaber_v3", 0.03, 50.0, 0.0), ("epos4", 10.0, 12.0, 1.0)],  # the rotary drive feeds its target's speed itself
)
def test_velocity_offset_in_csp_is_added_to_what_the_position_loop_asks_for(bench, name, speed, gain, own):
    for offset in (0.0, 0.5, 1.0):
        drive = bench(name)
        # the demand is that of the next cycle, while a target is compared with the one before: 1 ms
        assert ramp(drive, speed, offset) == pytest.approx((1.0 - own - offset) / gain, abs=2e-3)


def test_the_offset_does_not_kick_what_feeds_its_target_forward(bench):
    """The rotary drive differentiates its target: moved by offset / gain at once, it would ask for 80 times the speed."""
    drive = bench("epos4")
    drive.drive.dictionary.put(0x60B1, 100)
    fastest = 0.0
    for _ in range(300):
        drive.drive.last_target_at = drive.drive.port.event_queue.now
        drive.go(1)
        fastest = max(fastest, abs(drive.drive.axis.velocity))
    assert 0.3 * 100 * drive.drive.axis.units.velocity < fastest < 1.5 * 100 * drive.drive.axis.units.velocity


def test_velocity_offset_in_csp_is_within_the_largest_speed(bench):
    drive = bench("faulhaber_v3")
    drive.drive.dictionary.put(0x607F, 100)
    drive.drive.dictionary.put(0x60B1, 5000)
    drive.go(500)
    # it rests where the position loop asks for as much in the other direction
    assert drive.drive.axis.position == pytest.approx(0.1 / 50.0, abs=1e-4)
    assert drive.word & 0x0800


@pytest.mark.parametrize("mode", [Mode.CSP, Mode.CSV])
def test_torque_offset_carries_a_load_that_the_loops_would_yield_to(bench, mode):
    yielded = {}
    for told in (False, True):
        drive = bench("faulhaber_v3")
        drive.write(0x6060, mode)
        drive.go(20)
        motor = drive.drive.axis.motor
        motor.load(-LOAD)
        if told:
            units, constant = drive.drive.axis.units, motor.model.force_constant
            drive.drive.dictionary.put(0x60B2, round(LOAD / constant / units.torque))
        before, yielded[told] = motor.position, 0.0
        for _ in range(100):
            drive.go(1)
            yielded[told] = max(yielded[told], abs(motor.position - before))
    assert yielded[False] > 30e-6
    assert yielded[True] < 0.1 * yielded[False]


def test_an_offset_ends_with_the_operation(bench):
    drive = bench("faulhaber_v3")
    drive.drive.dictionary.put(0x60B1, 20)
    drive.drive.dictionary.put(0x60B2, 100)
    drive.go(100)
    drive.control(0x02)
    drive.go(100)
    before = drive.drive.axis.motor.position
    drive.go(100)
    assert drive.drive.axis.motor.position == pytest.approx(before, abs=1e-5)
