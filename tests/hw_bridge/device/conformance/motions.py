"""What checks of CiA 402 share: states, and lengths and speeds that suit each drive's motor."""

import pytest

from hw_bridge.profiles import DRIVE_PROFILES
from tests.hw_bridge.profiles import fast

PROFILES = [name for name in DRIVE_PROFILES if name != "epos2"]  # those for which the checks have units and ranges
MASK = 0x6F
DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
WAYS = {DISABLED: [], READY: [0x06], SWITCHED_ON: [0x06, 0x07], ENABLED: [0x06, 0x07, 0x0F]}
REACHED, LIMITED, BIT_12, BIT_13 = 0x0400, 0x0800, 0x1000, 0x2000
FAST = {"epos4": 500}  # a target velocity in the drive's unit; 20 mm/s otherwise
PLACE = {"epos4": 30.0}  # of a switch [rad of the motor]; 2 mm otherwise
ROOM = {"epos4": 10.0}  # for stopping behind it [rad]; 3 mm otherwise


def on(*names):
    """A rule that differs between vendors: fast on these profiles, slow on the others."""
    return pytest.mark.parametrize("name", fast(*names, of=PROFILES))


EVERY = on(*PROFILES)


def shown(bench):
    word = bench.read(0x6041)
    return word & (MASK if word & 0x20 or (not word & 0x40 and not word & 0x08) else 0x4F)


def has(bench, mode):
    if not bench.read(0x6502) >> (mode - 1) & 1:
        pytest.skip(f"no {mode.name}")


def velocity(bench):
    return FAST.get(bench.profile.name, 20)


def place(bench):
    return PLACE.get(bench.profile.name, 2e-3)


def room(bench):
    return ROOM.get(bench.profile.name, 3e-3)


def units(bench, length):
    """A length [m or rad] in the drive's unit of position."""
    return round(length / bench.drive.axis.units.position)


def widened(bench):
    """Limits of the drive that are not what is tried."""
    bench.write(0x607D, units(bench, -10 * place(bench)), 1)
    bench.write(0x607D, units(bench, 10 * place(bench)), 2)
    if 0x6065 in bench.drive.dictionary:
        bench.write(0x6065, 0xFFFFFFFF)
