"""Rules of CiA 301 (version 4.2.0): NMT and error control.

The numbers of clauses are recalled; the service or object beside them counts. What a vendor's drive does not offer is skipped.
"""

import struct

import pytest

from hw_bridge.dictionary import Code, NmtState
from tests.hw_bridge.bench import NODE
from tests.hw_bridge.device.conformance.service_requests import (
    abort,
    mapped,
    silent,
    valued,
)

# ----------------------------------------------------------------------------------------------------------- NMT


def test_boot_up_is_one_byte_of_zero(bench):
    """7.2.8.3.3, protocol boot-up."""
    assert bench.frames(0x700 + NODE) == [b"\0"]


def test_pre_operational_follows_by_itself(bench):
    """7.3.2, NMT state machine."""
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize(("command", "state"), [(1, 0x05), (2, 0x04), (128, 0x7F)])
def test_node_control(bench, command, state):
    """7.2.8.2.1, node control; the state is that of the heartbeat."""
    bench.nmt(command)
    bench.frames(0x700 + NODE)
    bench.write(0x1017, 10) if command != 2 else None
    bench.go(15)
    assert bench.drive.port.state == state
    if command != 2:
        assert bench.frames(0x700 + NODE)[0] == bytes([state])


@pytest.mark.parametrize("command", [129, 130])
def test_reset_ends_in_boot_up(bench, command):
    """7.2.8.2.1, reset node and reset communication."""
    bench.frames(0x700 + NODE)
    bench.nmt(command)
    bench.go(150)
    assert bench.frames(0x700 + NODE) == [b"\0"]


def test_all_nodes_are_node_0(bench):
    """7.2.8.3.1, protocols for node control."""
    bench.send(0, [1, 0])
    assert bench.drive.port.state is NmtState.OPERATIONAL


@pytest.mark.parametrize("data", [[1, NODE + 1], [7, NODE], [1], [1, NODE, 0], []])
def test_what_is_no_command_for_this_node_is_ignored(bench, data):
    """7.2.8.3.1: another node, an unknown command specifier, a wrong length."""
    bench.send(0, data)
    bench.go(150)
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL


def test_reset_communication_restores_communication_only(bench):
    """7.3.2.2.1.2, sub-state reset communication."""
    value = valued(bench, 0x6081)
    bench.write(0x6081, value)
    bench.write(0x1017, 50)
    bench.nmt(130)
    bench.go(150)
    assert (bench.read(0x6081), bench.read(0x1017)) == (value, 0)


def test_reset_node_restores_the_application_too(bench):
    """7.3.2.2.1.1, sub-state reset application."""
    default = bench.read(0x6081)
    bench.write(0x6081, valued(bench, 0x6081))
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == default


def test_stopped_has_no_sdo(bench):
    """7.3.2.2.5, NMT states and communication objects."""
    bench.nmt(2)
    assert silent(bench, 0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0), 0x580 + NODE)


def test_stopped_has_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "tpdo", 1, [0x60410010], 1)
    bench.nmt(1)
    bench.nmt(2)
    assert silent(bench, 0x080, b"", identifier)


def test_stopped_has_no_emcy(bench):
    """7.3.2.2.5."""
    bench.nmt(2)
    bench.emergencies()
    bench.drive.inject(next(iter(bench.profile.faults)))
    bench.go(5)
    assert bench.emergencies() == []


def test_stopped_has_a_heartbeat(bench):
    """7.3.2.2.5."""
    bench.write(0x1017, 10)
    bench.nmt(2)
    bench.frames(0x700 + NODE)
    bench.go(25)
    assert bench.frames(0x700 + NODE) == [b"\x04"] * 2


def test_pre_operational_has_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "tpdo", 1, [0x60410010], 1)
    assert silent(bench, 0x080, b"", identifier)


def test_pre_operational_takes_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 255)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<I", before + 1))
    assert bench.read(0x6081) == before


# ------------------------------------------------------------------------------------------------- error control


def test_heartbeat_has_its_time(bench):
    """7.2.8.3.2.2, protocol heartbeat; 7.5.2.20, 1017h."""
    bench.write(0x1017, 20)
    bench.frames(0x700 + NODE)
    bench.go(205)
    assert len(bench.frames(0x700 + NODE)) == 10


def test_heartbeat_of_0_ms_is_none(bench):
    """7.5.2.20, 1017h."""
    bench.write(0x1017, 20)
    bench.write(0x1017, 0)
    bench.frames(0x700 + NODE)
    bench.go(100)
    assert bench.frames(0x700 + NODE) == []


def test_a_consumer_waits_for_the_first_heartbeat(bench):
    """7.2.8.2.2.2: monitoring starts with the first one."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.go(300)
    assert bench.emergencies() == []


def test_a_missing_heartbeat_is_8130h(bench):
    """7.2.8.2.2.2, heartbeat event; 7.2.7.1, EMCY error codes."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.send(0x77F, [5])
    bench.go(45)
    assert bench.emergencies() == []
    bench.go(10)
    assert bench.emergencies() == [0x8130]


@pytest.mark.parametrize("value", [0x7F << 16, 50])
def test_a_consumer_without_node_or_time_is_none(bench, value):
    """7.5.2.19, 1016h."""
    bench.write(0x1016, value, 1)
    for node in (0x77F, 0x700):
        bench.send(node, [5]) if node != 0x700 else None
    bench.go(200)
    assert bench.emergencies() == []


def test_one_node_is_watched_by_one_consumer(bench):
    """7.5.2.19, 1016h: 06040043h."""
    if bench.read(0x1016) < 2:
        pytest.skip("one consumer")
    bench.write(0x1016, 5 << 16 | 50, 1)
    assert abort(bench.write, 0x1016, 5 << 16 | 60, 2) is Code.PARAMETER_INCOMPATIBLE


@pytest.mark.parametrize(("reaction", "state"), [(0, 0x7F), (1, 0x05), (2, 0x04)])
def test_error_behavior(bench, reaction, state):
    """7.5.2.32, 1029h.1."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.write(0x1029, reaction, 1)
    bench.nmt(1)
    bench.send(0x77F, [5])
    bench.go(100)
    assert bench.drive.port.state == state


def test_guarding_toggles_from_0(bench):
    """7.2.8.3.2.1, protocol node guarding."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.frames(0x700 + NODE)
    for _ in range(3):
        bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == [b"\x7f", b"\xff", b"\x7f"]


def test_guarding_begins_anew_after_a_reset(bench):
    """7.2.8.3.2.1: the toggle bit is 0 after reset communication."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.send(0x700 + NODE, remote=True, length=1)
    bench.nmt(130)
    bench.go(150)
    bench.frames(0x700 + NODE)
    bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == [b"\x7f"]


def test_a_heartbeat_producer_is_not_guarded(bench):
    """7.2.8.2.2: one of both at a time, heartbeat first."""
    bench.write(0x1017, 1000)
    bench.frames(0x700 + NODE)
    bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == []


def test_a_life_time_that_ends_is_8130h(bench):
    """7.2.8.2.2.1, life guarding; 100Ch, 100Dh."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.write(0x100C, 20)
    bench.write(0x100D, 2)
    bench.go(100)
    assert bench.emergencies() == []
    bench.send(0x700 + NODE, remote=True, length=1)
    bench.go(50)
    assert bench.emergencies() == [0x8130]
