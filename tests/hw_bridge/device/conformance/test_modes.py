"""Rules of CiA 402 (parts 2 and 3, IEC 61800-7-201): modes of operation and homing.

Each check names its object or function. What a vendor's drive does not offer is skipped.
"""

import pytest

from hw_bridge.dictionary import Code, Mode
from tests.hw_bridge.device.conformance.motions import (
    BIT_12,
    BIT_13,
    EVERY,
    LIMITED,
    REACHED,
    has,
    place,
    room,
    units,
    velocity,
)
from tests.hw_bridge.device.conformance.service_requests import abort
from tests.hw_bridge.profiles import fast

# ----------------------------------------------------------------------------------------------------- pp and pv


@pytest.mark.slow_repetitions
@EVERY
def test_the_set_point_handshake(bench):
    """pp: bit 4 of the controlword, bits 12 and 10 of the statusword."""
    bench.write(0x6067, units(bench, place(bench) / 10))
    bench.enable(Mode.PP)
    bench.write(0x607A, units(bench, place(bench)))
    bench.control(0x1F)
    assert bench.read(0x6041) & (BIT_12 | REACHED) == BIT_12
    bench.control(0x0F)
    assert not bench.read(0x6041) & BIT_12
    bench.go(3000)
    assert bench.read(0x6041) & REACHED
    assert bench.read(0x6064) == pytest.approx(units(bench, place(bench)), rel=0.1)


def test_a_target_without_an_edge_is_not_gone_to(bench):
    """pp: a level of bit 4 is no new set-point."""
    bench.enable(Mode.PP)
    bench.control(0x1F)
    bench.write(0x607A, units(bench, place(bench)))
    bench.control(0x1F)
    bench.go(500)
    assert abs(bench.read(0x6064)) < units(bench, place(bench) / 10)


def test_a_relative_target(bench):
    """pp: bit 6."""
    bench.enable(Mode.PP)
    bench.write(0x607A, units(bench, place(bench)))
    for _ in range(2):
        bench.control(0x5F)
        bench.go(2000)
        bench.control(0x0F)
    assert bench.read(0x6064) == pytest.approx(2 * units(bench, place(bench)), rel=0.1)


def test_halt_in_pp(bench):
    """Controlword bit 8; bit 10 when it stands."""
    bench.write(0x6081, velocity(bench))
    bench.enable(Mode.PP)
    bench.write(0x607A, units(bench, 3 * place(bench)))
    bench.control(0x1F)
    bench.go(60)
    bench.control(0x11F)
    bench.go(500)
    halted = bench.read(0x6064)
    assert bench.read(0x6041) & REACHED
    assert 0 < halted < units(bench, 2.9 * place(bench))
    bench.control(0x1F)
    bench.go(3000)
    assert bench.read(0x6064) == pytest.approx(units(bench, 3 * place(bench)), rel=0.1)


@EVERY
def test_a_target_outside_the_software_limits(bench):
    """607Dh: not passed; told by bit 11 or an error."""
    bench.write(0x607D, units(bench, -place(bench)), 1)
    bench.write(0x607D, units(bench, place(bench)), 2)
    bench.enable(Mode.PP)
    bench.write(0x607A, units(bench, 3 * place(bench)))
    bench.control(0x1F)
    bench.go(1500)
    assert bench.read(0x6064) <= 1.05 * units(bench, place(bench))
    assert bench.read(0x6041) & LIMITED or bench.emergencies()


def test_pv_reaches_its_target(bench):
    """pv: 60FFh, bit 10; bit 12 is "speed is 0"."""
    bench.enable(Mode.PV)
    bench.go(300)
    assert bench.read(0x6041) & BIT_12
    bench.write(0x60FF, velocity(bench))
    bench.go(600)
    assert bench.read(0x6041) & (BIT_12 | REACHED) == REACHED
    assert bench.read(0x606C) == pytest.approx(velocity(bench), rel=0.15)


def test_halt_in_pv(bench):
    """pv: bit 8; bit 10 and 12 when it stands."""
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(300)
    bench.control(0x10F)
    bench.go(600)
    assert abs(bench.drive.axis.velocity) < 0.02 * velocity(bench) * bench.drive.axis.units.velocity
    assert bench.read(0x6041) & BIT_12


def test_the_ramp_of_pv(bench):
    """6083h: the demand 606Bh after half of the ramp."""
    bench.write(0x6083, velocity(bench) * 5)  # a ramp of 0.2 s
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(97)
    assert bench.read(0x606B) == pytest.approx(velocity(bench) / 2, rel=0.15)


# ---------------------------------------------------------------------------------------------------- csp to cst


@pytest.mark.parametrize("mode", [Mode.CSP, Mode.CSV, Mode.CST])
def test_the_drive_follows_the_command(bench, mode):
    """csp, csv, cst: statusword bit 12."""
    has(bench, mode)
    bench.write(0x6060, mode)
    bench.go(2)
    assert not bench.read(0x6041) & BIT_12
    bench.enable(mode)
    bench.go(2)
    assert bench.read(0x6041) & BIT_12


# -------------------------------------------------------------------------------------------------------- homing


@EVERY
def test_methods_that_there_are_not(bench):
    """6098h: 06090030h to 32h."""
    for method in {15, 16, 31, 32, 36} - bench.profile.homing.keys():
        assert abort(bench.write, 0x6098, method) in (Code.VALUE_RANGE, Code.VALUE_TOO_HIGH)


def homed(bench, method, milliseconds=20_000):
    """Home; bits 10, 12 and 13 at its end."""
    bench.write(0x6098, method)
    bench.write(0x6099, velocity(bench) // 2, 1)
    bench.write(0x6099, velocity(bench) // 4, 2)
    bench.enable(Mode.HM)
    bench.control(0x1F)
    while milliseconds > 0 and not bench.read(0x6041) & (BIT_12 | BIT_13):
        bench.go(20)
        milliseconds -= 20
    bench.go(300)
    return bench.read(0x6041) & (REACHED | BIT_12 | BIT_13)


SWITCHED = [*range(1, 15), *range(17, 31)]
FAST = (1, 5, 14, 17, 18, 21)  # each switch, with and without index, from either side


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("method", fast(*FAST, of=SWITCHED))
def test_methods_with_switches(bench, method):
    """6098h = 1 to 14 and 17 to 30: the reference is where the method says, in the motor's coordinate."""
    if method not in bench.profile.homing:
        pytest.skip("not of this vendor")
    span = place(bench) * 5
    switches = bench.drive.axis.switches
    switches.negative, switches.positive, switches.home = -span, span, (0.4 * span, 0.6 * span)
    if (
        3 <= method <= 14 and bench.profile.name != "epos4"
    ):  # an index pulse lies between the home switch and either limit switch
        switches.negative, switches.positive = -3.5 * span, 3.5 * span
    if method in (5, 6, 21, 22):  # they begin beyond the switch, on their way in negative direction
        switches.home = (-0.6 * span, -0.4 * span)
    bench.enable(Mode.HM)
    assert bench.read(0x6041) & (BIT_12 | BIT_13) == 0
    assert homed(bench, method) == REACHED | BIT_12
    ends = {17: -span, 18: span}
    if method in ends:
        assert bench.drive.axis.origin == pytest.approx(ends[method], abs=0.05 * span)
    elif method >= 19:
        low, high = switches.home
        assert min(abs(bench.drive.axis.origin - end) for end in (low, high)) < 0.05 * span


@EVERY
def test_the_homing_offset(bench):
    """607Ch: the position at the reference, after homing where the motor stands (35 or 37)."""
    if 0x607C not in bench.drive.dictionary:
        pytest.skip("the vendor has another object")
    bench.write(0x607C, 1234)
    method = next(method for method in (37, 35) if method in bench.profile.homing)
    assert homed(bench, method) == REACHED | BIT_12
    assert bench.read(0x6064) == pytest.approx(1234, abs=10)


@pytest.mark.parametrize("method", [19, 21, 33, 34])
def test_a_limit_switch_that_the_method_does_not_name_ends_homing(bench, method):
    """hm: homing error, bit 13, and it stands; no drive passes a limit switch because it homes."""
    if method not in bench.profile.homing:
        pytest.skip("not of this vendor")
    switches = bench.drive.axis.switches
    near = place(bench) / 2
    if bench.profile.name == "epos4":
        near = 0.5
    switches.negative, switches.positive = -near, near
    if method in (33, 34):  # the index is at 0: begin on the side away from it
        bench.drive.axis.motor.offset = {33: -0.2, 34: 0.2}[method] * near
        bench.go(2)
    assert homed(bench, method) & (BIT_12 | BIT_13) == BIT_13
    assert abs(bench.drive.axis.velocity) < 1e-2 * velocity(bench) * bench.drive.axis.units.velocity
    assert abs(bench.drive.axis.motor.position) < near + room(bench)
