"""Rules of CiA 402 (parts 2 and 3, IEC 61800-7-201): state machine, statusword, options.

Each check names its object or function. What a vendor's drive does not offer is skipped.
"""

import pytest

from hw_bridge.dictionary import Code, Mode, cia402
from tests.hw_bridge.device.conformance.motions import (
    BIT_13,
    DISABLED,
    ENABLED,
    EVERY,
    FAULT,
    QUICK_STOP,
    READY,
    SWITCHED_ON,
    WAYS,
    place,
    shown,
    units,
    velocity,
)
from tests.hw_bridge.device.conformance.service_requests import ERROR, abort

pytestmark = EVERY  # options, bits of the statusword and reactions differ

# ------------------------------------------------------------------------------------------------- state machine


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


# ------------------------------------------------------------------------------------------- statusword, options


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
