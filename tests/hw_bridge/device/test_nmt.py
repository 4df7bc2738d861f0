"""NMT, heartbeat both ways, guarding, storing."""

import struct

import pytest

from hw_bridge.dictionary import Code, Mode, NmtState, State
from tests.hw_bridge.bench import NODE, AbortedError

SAVE, LOAD = 0x65766173, 0x64616F6C


def test_boot_up_and_reset(bench):
    assert bench.frames(0x700 + NODE) == [b"\0"]
    bench.write(0x6067, 77)
    bench.write(0x1017, 10)
    bench.go(25)
    assert bench.frames(0x700 + NODE) == [b"\x7f"] * 3
    bench.nmt(130)
    bench.go(150)
    assert bench.frames(0x700 + NODE) == [b"\0"]
    assert (bench.read(0x6067), bench.read(0x1017)) == (77, 0)  # communication only
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6067) != 77


def test_a_reset_forgets_where_home_was(make):
    bench = make("faulhaber_v3")
    bench.enable(Mode.PP)
    bench.write(0x607A, 3000)
    bench.control(0x1F)
    bench.go(500)
    bench.nmt(129)
    bench.go(150)
    assert bench.state is State.DISABLED
    assert bench.read(0x6064) == 0
    assert bench.drive.axis.motor.position > 2e-3


@pytest.mark.parametrize(("command", "state"), [(1, 5), (2, 4), (128, 0x7F)])
def test_states(bench, command, state):
    bench.nmt(command)
    assert bench.drive.port.state == state
    bench.frames(0x580 + NODE)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    bench.go(2)
    assert len(bench.frames(0x580 + NODE)) == (state != NmtState.STOPPED)


def test_command_for_another_node(bench):
    bench.send(0, [1, NODE + 1])
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL
    bench.send(0, [1, 0])
    assert bench.drive.port.state is NmtState.OPERATIONAL


def test_a_drive_without_an_error_behavior_leaves_operational_when_a_heartbeat_is_lost(make):
    """1029h is optional in CiA 301; an EPOS2 does not have it."""
    bench = make("epos2")
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.nmt(1)
    bench.send(0x77F, [5])
    assert bench.drive.port.state is NmtState.OPERATIONAL
    bench.go(60)
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize(("reaction", "state"), [(0, 0x7F), (1, 5), (2, 4)])
def test_heartbeat_consumer(make, reaction, state):
    bench = make("faulhaber_v3")
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.write(0x1029, reaction, 1)
    bench.nmt(1)
    bench.go(200)
    assert bench.emergencies() == []  # it waits for the first heartbeat
    for _ in range(5):
        bench.send(0x77F, [5])
        bench.go(40)
    assert bench.emergencies() == []
    bench.go(20)
    assert bench.emergencies() == [0x8130]
    assert bench.drive.port.state == state


@pytest.mark.parametrize(
    ("option", "after"),
    [(0, State.ENABLED), (1, State.FAULT), (2, State.DISABLED), (3, State.QUICK_STOP)],
)
def test_a_lost_master_and_6007h(make, option, after):
    bench = make("epos4")
    bench.write(0x6007, option)
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.write(0x1029, 1, 1)
    bench.nmt(1)
    bench.enable(Mode.PV)
    bench.write(0x60FF, 1000)
    bench.send(0x77F, [5])
    bench.go(45)
    assert bench.state is State.ENABLED
    bench.go(300)
    assert bench.state is after
    moving = abs(bench.read(0x606C)) > 500
    assert moving == (option == 0)


def test_mclm_goes_on_when_its_master_dies(make):
    """The trap: by default MCLM tells errors but does not trip."""
    bench = make("mclm")
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.enable(Mode.PV)
    bench.write(0x60FF, 20)
    bench.send(0x77F, [5])
    bench.go(300)
    assert bench.emergencies() == [0x8130]
    assert bench.state is State.ENABLED
    assert bench.read(0x606C) > 10
    bench.write(0x2321, 0x0100, 2)
    bench.control(0x8F, 0x0F)
    bench.send(0x77F, [5])
    bench.go(300)
    assert bench.state is State.FAULT


@pytest.mark.parametrize(("command", "after"), [(128, State.ENABLED), (2, State.QUICK_STOP), (130, State.QUICK_STOP)])
def test_which_nmt_commands_end_the_connection(make, command, after):
    bench = make("epos4")
    bench.nmt(1)
    bench.enable(Mode.PV)
    bench.nmt(command)
    bench.go(50)
    assert bench.state is after


def test_two_consumers_for_one_node_are_refused(make):
    bench = make("epos4")
    bench.write(0x1016, 5 << 16 | 50, 1)
    with pytest.raises(AbortedError) as found:
        bench.write(0x1016, 5 << 16 | 60, 2)
    assert found.value.code is Code.PARAMETER_INCOMPATIBLE
    with pytest.raises(AbortedError):
        bench.write(0x1016, 200 << 16 | 60, 2)


def test_guarding_where_the_vendor_has_it(bench):
    bench.frames(0x700 + NODE)
    for _ in range(3):
        bench.send(0x700 + NODE, remote=True, length=1)
    guarded = bench.profile.name != "epos4"
    assert bench.frames(0x700 + NODE) == ([b"\x7f", b"\xff", b"\x7f"] if guarded else [])
    if guarded:
        bench.write(0x100C, 20)
        bench.write(0x100D, 2)
        bench.send(0x700 + NODE, remote=True, length=1)
        bench.go(39)
        assert bench.emergencies() == []
        bench.go(5)
        assert bench.emergencies() == [0x8130]


def test_store_and_restore(bench):
    default = bench.read(0x6067)
    bench.write(0x6067, 99)
    with pytest.raises(AbortedError) as found:
        bench.write(0x1010, 0x12345678, 1)
    assert found.value.code is Code.CANNOT_STORE
    bench.write(0x1010, SAVE, 1)
    assert bench.read(0x1010, 1) == 1
    bench.write(0x6067, 98)
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6067) == 99
    bench.write(0x1011, LOAD, 1)
    assert bench.read(0x6067) == 99  # acts at the next reset
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6067) == default


@pytest.mark.parametrize("name", ["faulhaber_v3", "mclm"])
@pytest.mark.parametrize("identifier", [0x000, 0x583, 0x603, 0x703, 0x123, 1 << 29 | 0x83])
def test_an_emergency_or_sync_takes_no_reserved_identifier(make, name, identifier):
    bench = make(name)
    bench.write(0x1014, 1 << 31 | 0x83)  # EMCY off: then its identifier may change
    for index in (0x1005, 0x1014):
        with pytest.raises(AbortedError) as found:
            bench.write(index, identifier)
        assert found.value.code is Code.VALUE_RANGE


def test_the_identifier_of_an_emergency_in_use_stays(make):
    bench = make("faulhaber_v3")
    with pytest.raises(AbortedError):
        bench.write(0x1014, 0x93)
    bench.write(0x1014, 1 << 31 | 0x93)
    bench.write(0x1014, 0x93)
    bench.drive.inject(0x8611)
    bench.go(2)
    assert len(bench.frames(0x93)) == 1
    with pytest.raises(AbortedError):
        bench.write(0x1005, 1 << 30 | 0x80)  # it sends no SYNC


def test_an_emergency_of_a_drive_without_its_object_has_the_predefined_identifier(make):
    """CiA 301, predefined connection set: 80h plus the node-ID, where a vendor's EDS file lacks 1014h."""
    bench = make("faulhaber_v3")
    del bench.drive.port.dictionary.values[0x1014, 0]
    bench.drive.inject(0x8611)
    bench.go(2)
    assert len(bench.frames(0x80 + NODE)) == 1


@pytest.mark.parametrize("index", [0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF])
def test_a_demand_is_never_stored(make, index):
    """A drive that came back with a velocity or a torque would move as soon as it is enabled."""
    bench = make("faulhaber_v3")
    default = bench.read(index)
    bench.write(index, 7)
    bench.write(0x6067, 99)
    bench.write(0x1010, SAVE, 1)
    bench.nmt(129)
    bench.go(150)
    assert (bench.read(0x6067), bench.read(index)) == (99, default)
