"""What a drive in csp does between a target and one that does not come: interpolate, go on for a while, hold, fail."""

import struct
from dataclasses import replace

import pytest

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.bench import Bench

PERIOD, STEP = 5, 1000  # [ms], increments of each target
OWN = 0x200  # RPDO1, mapped to the target position


def drive(build, vendor, periods):
    """In csp with 60C2h of 5 ms, told as many steps of one speed as there are; what it was told last [m or rad]."""
    made = Bench(vendor, build)
    axis = made.drive.axis
    axis.profile = replace(axis.profile, extrapolation=periods)
    made.write(0x60C2, PERIOD, 1)
    made.write(0x6065, 0xFFFFFFFF)  # how well the motor follows is not asked
    base = 0x1400
    made.write(base, 0x80000000 | OWN + made.node, 1)
    made.write(base, 255, 2)
    made.write(base + 0x200, 0)
    made.write(base + 0x200, 0x607A0020, 1)
    made.write(base + 0x200, 1)
    made.write(base, OWN + made.node, 1)
    made.nmt(1)
    made.enable(Mode.CSP)
    for k in range(1, 7):
        tell(made, k * STEP)
    return made


def tell(made, target):
    made.send(OWN + made.node, struct.pack("<i", target))
    made.go(PERIOD - 0.5)


def demand(made):
    return made.drive.axis.demand / made.drive.axis.units.position


@pytest.mark.parametrize("vendor", ["faulhaber_v3", "epos4"])
@pytest.mark.parametrize("periods", [0, 1, 2])
def test_a_late_target_is_gone_on_to_for_so_long(build, vendor, periods):
    made = drive(build, vendor, periods)
    assert demand(made) == pytest.approx(6 * STEP, abs=1)
    for late in range(1, 3):
        made.go(PERIOD)
        assert demand(made) == pytest.approx((6 + min(late, periods)) * STEP, abs=1)


def test_the_target_that_comes_in_the_end_is_gone_to_from_there(build):
    made = drive(build, "faulhaber_v3", 2)
    made.go(2)
    before = demand(made)
    assert before == pytest.approx(6.4 * STEP, abs=1)
    tell(made, 7 * STEP)
    assert demand(made) == pytest.approx(7 * STEP, abs=1)


def test_a_target_that_stays_is_not_gone_beyond(build):
    made = drive(build, "faulhaber_v3", 2)
    for _ in range(4):
        tell(made, 6 * STEP)
        assert demand(made) == pytest.approx(6 * STEP, abs=1)


@pytest.mark.parametrize(("vendor", "fails"), [("epos4", True), ("faulhaber_v3", False)])
def test_who_watches_for_targets_fails_all_the_same(build, vendor, fails):
    """Going on hides no silence: 8250h comes when it would have come without."""
    made = drive(build, vendor, 2)
    made.go(2 * PERIOD)
    assert made.state is State.ENABLED
    made.go(2 * PERIOD)
    assert (0x8250 in made.drive.active) is fails
    assert fails or made.drive.now - made.drive.axis.last_target_at > 4 * PERIOD * MILLISECOND
