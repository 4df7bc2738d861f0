"""Rules of CiA 402 (parts 2 and 3, IEC 61800-7-201) on the simulated drives of all profiles.

Each check names its object or function. What a vendor's drive does not offer is skipped.
"""

import pytest

from hw_bridge.dictionary import Code, Mode, State, cia402
from tests.hw_bridge.device.conformance.test_cia301 import ERROR, abort

MASK = 0x6F
DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
WAYS = {DISABLED: [], READY: [0x06], SWITCHED_ON: [0x06, 0x07], ENABLED: [0x06, 0x07, 0x0F]}
REACHED, LIMITED, BIT_12, BIT_13 = 0x0400, 0x0800, 0x1000, 0x2000
FAST = {"epos4": 500}  # a target velocity in the drive's unit; 20 mm/s otherwise
PLACE = {"epos4": 30.0}  # of a switch [rad of the motor]; 2 mm otherwise
ROOM = {"epos4": 10.0}  # for stopping behind it [rad]; 3 mm otherwise


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


# ------------------------------------------------------------------------------------------------------- state machine


def test_a_drive_boots_into_switch_on_disabled(bench):
    """Transitions 0 and 1."""
    assert shown(bench) == DISABLED


@pytest.mark.parametrize(
    ("source", "word", "target"),
    [
        (DISABLED, 0x06, READY),
        (READY, 0x07, SWITCHED_ON),
        (READY, 0x0F, ENABLED),
        (SWITCHED_ON, 0x0F, ENABLED),
        (SWITCHED_ON, 0x06, READY),
        (READY, 0x00, DISABLED),
        (READY, 0x02, DISABLED),
        (ENABLED, 0x06, READY),
        (ENABLED, 0x07, SWITCHED_ON),
        (ENABLED, 0x00, DISABLED),
        (SWITCHED_ON, 0x00, DISABLED),
        (SWITCHED_ON, 0x02, DISABLED),
        (DISABLED, 0x07, DISABLED),
        (DISABLED, 0x0F, DISABLED),
        (DISABLED, 0x80, DISABLED),
        (ENABLED, 0x8F, ENABLED),
        (ENABLED, 0xF80F, ENABLED),
    ],
)
def test_transitions(bench, source, word, target):
    """Transitions 2 to 10, and controlwords that trigger none; at rest all options end in the same state."""
    bench.control(*WAYS[source])
    assert shown(bench) == source
    bench.write(0x6040, word)
    bench.go(100)
    assert shown(bench) == target


def test_a_quick_stop_that_stays(bench):
    """Transitions 11, 16 and 12, with 605Ah = 6."""
    if 0x605A not in bench.drive.dictionary:
        pytest.skip("605Ah is fixed")
    bench.write(0x605A, 6)
    bench.control(*WAYS[ENABLED])
    bench.write(0x6040, 0x02)
    bench.go(100)
    assert shown(bench) == QUICK_STOP
    bench.write(0x6040, 0x0F)
    assert shown(bench) == ENABLED
    bench.write(0x6040, 0x02)
    bench.go(100)
    bench.write(0x6040, 0x00)
    assert shown(bench) == DISABLED


def test_a_quick_stop_that_ends_disabled(bench):
    """Transition 12 by itself, with 605Ah = 2."""
    if 0x605A in bench.drive.dictionary:
        bench.write(0x605A, 2)
    bench.control(*WAYS[ENABLED])
    bench.write(0x6040, 0x02)
    bench.go(100)
    assert shown(bench) == DISABLED


@pytest.mark.parametrize("source", [DISABLED, READY, SWITCHED_ON, ENABLED])
def test_an_error_ends_in_fault(bench, source):
    """Transitions 13 and 14, from any state."""
    if bench.profile.masks:
        bench.write(0x2321, 0xFFFF, 2)
    bench.control(*WAYS[source])
    bench.drive.inject(ERROR[bench.profile.name])
    bench.go(300)
    assert shown(bench) == FAULT


def faulty(bench, lasting=False):
    if bench.profile.masks:
        bench.write(0x2321, 0xFFFF, 2)
    bench.drive.inject(ERROR[bench.profile.name], lasting)
    bench.go(100)


@pytest.mark.parametrize("word", [0x00, 0x06, 0x07, 0x0F, 0x02])
def test_no_command_but_the_reset_leaves_fault(bench, word):
    """Transition 15."""
    faulty(bench)
    bench.write(0x6040, word)
    bench.go(20)
    assert shown(bench) == FAULT


def test_the_reset_is_a_rising_edge(bench):
    """Transition 15, controlword bit 7."""
    bench.write(0x6040, 0x80)
    faulty(bench)
    bench.write(0x6040, 0x80)
    assert shown(bench) == FAULT
    bench.control(0x00, 0x80)
    assert shown(bench) == DISABLED


def test_a_cause_that_is_there_stays_a_fault(bench):
    """Transition 15: only without a fault condition."""
    faulty(bench, lasting=True)
    bench.control(0x00, 0x80)
    assert shown(bench) == FAULT


def test_the_error_code(bench):
    """603Fh: of the last error."""
    if 0x603F not in bench.drive.dictionary:
        pytest.skip("no 603Fh")
    bench.drive.inject(ERROR[bench.profile.name])
    assert bench.read(0x603F) == ERROR[bench.profile.name]


def test_reset_communication_leaves_the_motor_on(bench):
    """6007h = 0: losing the connection does nothing."""
    if 0x6007 not in bench.drive.dictionary:
        pytest.skip("6007h is fixed")
    bench.write(0x6007, 0)
    bench.control(*WAYS[ENABLED])
    bench.nmt(130)
    bench.go(200)
    assert shown(bench) == ENABLED


@pytest.mark.parametrize(("option", "state"), [(1, FAULT), (2, DISABLED)])
def test_the_abort_connection_option(bench, option, state):
    """6007h."""
    if 0x6007 not in bench.drive.dictionary:
        pytest.skip("6007h is fixed")
    bench.write(0x6007, option)
    bench.nmt(1)
    bench.control(*WAYS[ENABLED])
    bench.nmt(2)
    bench.go(200)
    bench.nmt(128)
    assert shown(bench) == state


# ------------------------------------------------------------------------------------------------- statusword, options


def test_remote_is_operational(bench):
    """Statusword bit 9: the controlword of the network is processed."""
    bench.nmt(1)
    assert bench.read(0x6041) & cia402.REMOTE


def test_voltage_enabled(bench):
    """Statusword bit 4."""
    bench.control(*WAYS[SWITCHED_ON])
    assert bench.read(0x6041) & cia402.VOLTAGE_ENABLED


@pytest.mark.parametrize("index", [0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007])
def test_options_that_there_are_not(bench, index):
    """605Ah to 605Eh, 6007h: 06090030h to 32h."""
    if index not in bench.drive.dictionary:
        pytest.skip("fixed by the vendor")
    assert abort(bench.write, index, 100) in (Code.VALUE_RANGE, Code.VALUE_TOO_HIGH)


@pytest.mark.parametrize(("option", "ramp"), [(0, False), (1, True)])
@pytest.mark.parametrize(("index", "word"), [(0x605B, 0x06), (0x605C, 0x07)])
def test_shutdown_and_disable_operation(bench, option, ramp, index, word):
    """605Bh and 605Ch: 0 the stage off at once, 1 slow down first."""
    if index not in bench.drive.dictionary:
        pytest.skip("fixed by the vendor")
    bench.write(index, option)
    bench.write(0x6084, max(bench.read(0x6084) // 10, 1))
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(300)
    bench.write(0x6040, word)
    assert bench.drive.axis.motor.powered is ramp


def test_supported_modes_are_those_that_are_taken(bench):
    """6502h and 6060h; 06090030h for others."""
    offered = bench.read(0x6502)
    for mode in range(1, 11):
        if offered >> (mode - 1) & 1:
            bench.write(0x6060, mode)
            bench.go(2)
            assert bench.read(0x6061) == mode
        else:
            assert abort(bench.write, 0x6060, mode) in (Code.VALUE_RANGE, Code.VALUE_TOO_HIGH)


def test_the_window_of_the_following_error(bench):
    """6065h, 60F4h and statusword bit 13 in pp: the motor is held."""
    if 0x6065 not in bench.drive.dictionary:
        pytest.skip("no 6065h")
    bench.write(0x6065, units(bench, place(bench) / 20))
    if bench.profile.name != "epos4":
        bench.write(0x6066, 5000)
    bench.enable(Mode.PP)
    bench.drive.axis.motor.load(1e3)
    bench.go(10)
    assert bench.read(0x6041) & BIT_13 or shown(bench) in (FAULT, 0x0F)


def test_outputs_follow_their_mask(bench):
    """60FEh."""
    if 0x60FE not in bench.drive.dictionary:
        pytest.skip("no 60FEh")
    bench.write(0x60FE, 5, 1)
    if 2 in bench.drive.dictionary.objects[0x60FE]:
        bench.write(0x60FE, 4, 2)
        assert bench.drive.outputs == 4
    else:
        assert bench.drive.outputs == 5


# ----------------------------------------------------------------------------------------------------------- pp and pv


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


# ----------------------------------------------------------------------------------------------------------- csp to cst


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


# -------------------------------------------------------------------------------------------------------------- homing


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


@pytest.mark.parametrize("method", SWITCHED)
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


# ------------------------------------------------------------------------------------------------------ digital inputs


def test_switches_are_digital_inputs(bench):
    """60FDh: bit 0 negative limit, bit 1 positive limit, bit 2 home."""
    switches = bench.drive.axis.switches
    seen = []
    for values in ((0.1, None, None), (None, -0.1, None), (None, None, (-0.1, 0.1))):
        switches.negative, switches.positive, switches.home = values
        bench.go(2)
        seen.append(bench.read(0x60FD) & 7)
    assert seen == [1, 2, 4]


def widened(bench):
    """Limits of the drive that are not what is tried."""
    bench.write(0x607D, units(bench, -10 * place(bench)), 1)
    bench.write(0x607D, units(bench, 10 * place(bench)), 2)
    if 0x6065 in bench.drive.dictionary:
        bench.write(0x6065, 0xFFFFFFFF)


MOTIONS = [Mode.PP, Mode.PV, Mode.CSP, Mode.CSV, Mode.CST]


def moved(bench, mode, sign, milliseconds=1500):
    """Move in a direction as far as it goes, in any mode."""
    axis = bench.drive.axis
    if mode in (Mode.PV, Mode.CSV):
        bench.write(0x60FF, sign * velocity(bench))
    elif mode is Mode.CST:
        bench.write(0x6071, sign * (700 if bench.profile.name == "epos4" else 300))
    elif mode is Mode.PP:
        bench.write(0x6081, velocity(bench))
        bench.write(0x607A, units(bench, axis.position + sign * 4 * place(bench)))
        bench.control(0x0F, 0x3F)
    if mode is not Mode.CSP:
        bench.go(milliseconds)
        return
    begin, step = axis.position, velocity(bench) * axis.units.velocity * 4e-3
    for k in range(milliseconds // 4):
        target = begin + sign * min(step * k, 4 * place(bench))
        if bench.state is State.ENABLED:
            bench.write(0x607A, units(bench, target))
        bench.go(1.5)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("mode", MOTIONS)
def test_a_limit_switch_stops_every_mode(bench, mode, sign):
    """60FDh bits 0 and 1: the drive does not go on into a closed limit switch, and says so (bit 11, or the vendor's error)."""
    has(bench, mode)
    switches, axis = bench.drive.axis.switches, bench.drive.axis
    widened(bench)
    switches.negative, switches.positive = -place(bench), place(bench)
    bench.enable(mode)
    moved(bench, mode, sign)
    assert abs(axis.velocity) < 0.02 * velocity(bench) * axis.units.velocity
    assert place(bench) - 1e-5 <= sign * axis.motor.position < place(bench) + room(bench)
    error = {1: 0x8A81, -1: 0x8A80}[sign]
    if error in bench.profile.faults:
        assert error in bench.emergencies()
        assert bench.state is State.FAULT
    else:
        assert bench.state is State.ENABLED
        assert bench.read(0x6041) & LIMITED


@pytest.mark.parametrize("mode", MOTIONS)
def test_the_way_out_of_a_limit_switch_is_free(bench, mode):
    """60FDh: the other direction is not blocked; after the vendor's error it is reset first."""
    has(bench, mode)
    switches, axis = bench.drive.axis.switches, bench.drive.axis
    widened(bench)
    switches.positive = place(bench)
    bench.enable(mode)
    moved(bench, mode, 1)
    if bench.state is State.FAULT:
        bench.control(0x00, 0x80)
        bench.write(0x607A, units(bench, axis.position))
        bench.write(0x60FF, 0)
        bench.write(0x6071, 0)
        bench.control(0x06, 0x07, 0x0F)
    assert bench.state is State.ENABLED
    inside = axis.motor.position
    moved(bench, mode, -1, 600)
    assert axis.motor.position < inside - place(bench) / 2
    assert bench.state is State.ENABLED


def test_without_limit_switches_nothing_stops(bench):
    """60FDh: open inputs limit nothing."""
    bench.write(0x607D, units(bench, -100 * place(bench)), 1)
    bench.write(0x607D, units(bench, 100 * place(bench)), 2)
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(1500)
    assert bench.drive.axis.motor.position > 2 * place(bench)
    assert not bench.read(0x6041) & LIMITED


# --------------------------------------------------------------------------------------------------------- touch probe


def probed(bench, function, back_and_forth=1):
    """With this function, once or more over a probe that is closed on [1, 2] of the place; what 60B9h tells."""
    if 0x60B8 not in bench.drive.dictionary:
        pytest.skip("no touch probe")
    axis = bench.drive.axis
    widened(bench)
    axis.switches.probes = ((place(bench), 2 * place(bench)), (1.5 * place(bench), 2 * place(bench)))
    bench.write(0x60B8, function)
    bench.write(0x6081, velocity(bench))
    bench.enable(Mode.PP)
    for _ in range(back_and_forth):
        for target in (3 * place(bench), 0):
            bench.write(0x607A, units(bench, target))
            bench.control(0x0F, 0x3F)
            bench.go(2000)
    return bench.read(0x60B9)


def near(bench, index, factor):
    assert bench.read(index) == pytest.approx(units(bench, factor * place(bench)), rel=0.05)


def test_a_touch_probe_that_is_off(bench):
    """60B8h bit 0; 60B9h."""
    assert probed(bench, 0x0030) == 0


def test_the_positive_edge(bench):
    """60B8h bits 0 and 4: 60BAh, 60B9h bits 0 and 1."""
    assert probed(bench, 0x0011) & 0x0707 == 0x0003
    near(bench, 0x60BA, 1.0)


def test_the_negative_edge(bench):
    """60B8h bits 0 and 5: 60BBh, 60B9h bits 0 and 2. The first one is on the far side."""
    assert probed(bench, 0x0021) & 0x0707 == 0x0005
    near(bench, 0x60BB, 2.0)


def test_both_edges_of_both_probes(bench):
    """60B8h bits 8, 12 and 13 as well: 60BCh, 60BDh, 60B9h bits 8 to 10."""
    assert probed(bench, 0x3131) & 0x0707 == 0x0707
    for index, factor in ((0x60BA, 1.0), (0x60BB, 2.0), (0x60BC, 1.5), (0x60BD, 2.0)):
        near(bench, index, factor)


def test_the_first_event_is_kept(bench):
    """60B8h bit 1 = 0: single."""
    probed(bench, 0x0011)
    first = bench.read(0x60BA)
    bench.drive.axis.switches.probes = ((1.3 * place(bench), 2 * place(bench)), None)
    bench.write(0x607A, units(bench, 3 * place(bench)))
    bench.control(0x0F, 0x3F)
    bench.go(1500)
    assert bench.read(0x60BA) == first


def test_continuous_takes_every_event(bench):
    """60B8h bit 1 = 1: the way back closes it on the far side."""
    probed(bench, 0x0013)
    near(bench, 0x60BA, 2.0)


def test_switching_it_off_and_on_begins_anew(bench):
    """60B9h bits 1 and 2 are 0 with 60B8h bit 0."""
    probed(bench, 0x0011)
    bench.write(0x60B8, 0)
    bench.go(2)
    assert bench.read(0x60B9) == 0
    bench.write(0x60B8, 0x0011)
    bench.go(2)
    assert bench.read(0x60B9) & 0x0707 == 0x0001


def test_the_index_pulse_triggers(bench):
    """60B8h bits 2 and 3 = 1: zero impulse of the position sensor."""
    if 0x60B8 not in bench.drive.dictionary:
        pytest.skip("no touch probe")
    pitch = bench.drive.axis.motor.model.index
    bench.drive.axis.motor.offset = -0.02 * pitch
    bench.go(2)
    bench.write(0x60B8, 0x0015)
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(300)
    assert bench.read(0x60B9) & 0x0003 == 0x0003


def test_touch_probes_are_process_data(bench):
    """60B8h into an RPDO, 60B9h to 60BDh into a TPDO."""
    objects = bench.drive.dictionary.objects
    if 0x60B8 not in objects:
        pytest.skip("no touch probe")
    assert all(objects[index][0].mappable for index in range(0x60B8, 0x60BE))
    assert [objects[index][0].access for index in range(0x60B8, 0x60BE)] == ["rw"] + ["ro"] * 5
