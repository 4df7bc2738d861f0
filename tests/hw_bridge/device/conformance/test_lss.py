"""Rules of CiA 305 (layer setting services, version 3.0) on the simulated drives of all profiles."""

import struct

import pytest
from canopen.lss import LssMaster

from hw_bridge.bus import Bus
from hw_bridge.bus.frame import Frame
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary.cia301 import UNCONFIGURED
from hw_bridge.profiles import identity, profile
from tests.hw_bridge.bench import NODE, Master

REQUEST, RESPONSE = 0x7E5, 0x7E4
FOUND, SELECTED = 0x4F, 0x44


class Lss:
    """Requests to all devices of a bus, and what they answer."""

    def __init__(self, bus, master):
        self.bus, self.master = bus, master

    def ask(self, command, *data):
        self.master.received.clear()
        self.master.send(Frame(REQUEST, bytes([command, *data]).ljust(8, b"\0")))
        self.bus.advance(self.bus.now + 5_000_000)
        return [frame.data for _, frame in self.master.received if frame.id == RESPONSE]

    def number(self, command, value, *more):
        return self.ask(command, *struct.pack("<I", value), *more)


@pytest.fixture
def lss(bench):
    """A drive that has a node-ID, in LSS waiting."""
    return Lss(bench.bus, bench.master)


@pytest.fixture
def told(name):
    """1018h.1 to .4 of the profile."""
    return [identity(name)[sub] for sub in range(1, 5)]


@pytest.fixture
def unconfigured(name, build):
    """A drive without a node-ID."""
    bus = Bus()
    master = Master(bus)
    drive = Drive(profile(name), UNCONFIGURED, Motor(profile(name).motor, build=build))
    bus.attach(drive)
    bus.advance(200_000_000)
    found = Lss(bus, master)
    found.drive = drive
    return found


def selected(lss, told):
    return [answer for k, value in enumerate(told) for answer in lss.number(0x40 + k, value)]


def test_switch_state_global_is_not_answered(lss):
    """Switch state global, 04h."""
    assert lss.ask(0x04, 1) == lss.ask(0x04, 0) == []


def test_switch_state_selective(lss, told):
    """Switch state selective, 40h to 43h: 44h once all four fit."""
    assert selected(lss, told) == [bytes([SELECTED]).ljust(8, b"\0")]


@pytest.mark.parametrize("part", range(4))
def test_another_identity_is_not_selected(lss, told, part):
    """Switch state selective."""
    told[part] += 1
    assert selected(lss, told) == []
    assert lss.ask(0x5E) == []


def test_waiting_answers_no_service_of_configuration(lss):
    """FSA of LSS: these are of the state LSS configuration."""
    assert [lss.ask(command, 5) for command in (0x11, 0x13, 0x17, 0x5A, 0x5E)] == [[]] * 5


def test_inquire_identity(lss, told):
    """Inquire vendor-ID, product code, revision and serial number: 5Ah to 5Dh."""
    lss.ask(0x04, 1)
    answers = [lss.ask(command) for command in range(0x5A, 0x5E)]
    assert [struct.unpack_from("<BI", answer[0]) for answer in answers] == list(
        zip(range(0x5A, 0x5E), told, strict=True)
    )


def test_inquire_node_id(lss):
    """Inquire node-ID: 5Eh."""
    lss.ask(0x04, 1)
    assert lss.ask(0x5E) == [bytes([0x5E, NODE]).ljust(8, b"\0")]


@pytest.mark.parametrize(("number", "error"), [(1, 0), (127, 0), (255, 0), (0, 1), (128, 1), (200, 1), (254, 1)])
def test_configure_node_id(lss, number, error):
    """Configure node-ID, 11h: 1 to 127, or 255 to have none; else error code 1."""
    lss.ask(0x04, 1)
    assert lss.ask(0x11, number) == [bytes([0x11, error]).ljust(8, b"\0")]


def test_a_node_id_acts_after_reset_communication(lss, bench):
    """Configure node-ID: the pending one becomes the active one."""
    lss.ask(0x04, 1)
    lss.ask(0x11, 17)
    lss.ask(0x04, 0)
    assert bench.drive.node == NODE
    bench.nmt(130)
    bench.go(150)
    assert bench.drive.node == 17
    assert bench.frames(0x700 + 17) == [b"\0"]


def test_a_node_id_of_255_waits_for_lss_after_the_reset(lss, bench):
    """NMT initialization with LSS: without a node-ID there is no boot-up."""
    lss.ask(0x04, 1)
    lss.ask(0x11, 255)
    lss.ask(0x04, 0)
    bench.frames(0x700 + NODE)
    bench.nmt(130)
    bench.go(200)
    assert [frame for _, frame in bench.master.received if frame.id > 0x700 and frame.id < 0x780] == []
    assert lss.ask(0x4C) == [bytes([0x50]).ljust(8, b"\0")]


@pytest.mark.parametrize(
    ("table", "index", "error"), [(0, 0, 0), (0, 4, 0), (0, 8, 0), (0, 5, 1), (0, 10, 1), (1, 0, 1)]
)
def test_configure_bit_timing(lss, table, index, error):
    """Configure bit timing parameters, 13h: the standard table 0 has a reserved row 5."""
    lss.ask(0x04, 1)
    assert lss.ask(0x13, table, index) == [bytes([0x13, error]).ljust(8, b"\0")]


def test_activate_bit_timing_is_not_answered(lss):
    """Activate bit timing parameters: 15h."""
    lss.ask(0x04, 1)
    assert lss.ask(0x15, 10) == []


def test_store_configuration(lss):
    """Store configuration: 17h."""
    lss.ask(0x04, 1)
    assert lss.ask(0x17) == [bytes([0x17]).ljust(8, b"\0")]


@pytest.mark.parametrize("size", [1, 7])
def test_a_request_of_another_length_is_ignored(lss, bench, size):
    """LSS messages have 8 bytes."""
    lss.ask(0x04, 1)
    bench.frames(RESPONSE)
    bench.send(REQUEST, [0x5E, 0, 0, 0, 0, 0, 0][:size])
    bench.go(5)
    assert bench.frames(RESPONSE) == []


def ranged(lss, told, low=0, high=0):
    """Identify remote slave: vendor and product, revision and serial number from, to."""
    values = (told[0], told[1], told[2] - low, told[2] + high, told[3] - low, told[3] + high)
    return [answer for k, value in enumerate(values) for answer in lss.number(0x46 + k, value)]


def test_identify_remote_slave(lss, told):
    """Identify remote slave, 46h to 4Bh: 4Fh where all fit."""
    assert ranged(lss, told) == ranged(lss, told, 1, 1) == [bytes([FOUND]).ljust(8, b"\0")]


@pytest.mark.parametrize("part", range(4))
def test_another_identity_is_not_identified(lss, told, part):
    """Identify remote slave."""
    told[part] += 2
    assert ranged(lss, told, 1, 1) == []


def test_a_device_with_a_node_id_does_not_answer_for_those_without(lss):
    """Identify non-configured remote slave, 4Ch."""
    assert lss.ask(0x4C) == []


def test_a_device_without_a_node_id_does(unconfigured):
    """Identify non-configured remote slave: 50h."""
    assert unconfigured.ask(0x4C) == [bytes([0x50]).ljust(8, b"\0")]


def test_fastscan_is_for_devices_without_a_node_id(lss):
    """Fastscan, 51h."""
    assert lss.number(0x51, 0, 0x80, 0, 0) == []


def scanned(lss):
    """The identity that fastscan finds, or nothing."""
    if not lss.number(0x51, 0, 0x80, 0, 0):
        return []
    found = []
    for sub in range(4):
        value = 0
        for bit in reversed(range(32)):
            if not lss.number(0x51, value, bit, sub, sub):
                value |= 1 << bit
        if not lss.number(0x51, value, 0, sub, (sub + 1) % 4):
            return []
        found.append(value)
    return found


def test_fastscan_finds_the_identity(unconfigured, told):
    """Fastscan: 4Fh for each part that fits; then the device is in LSS configuration."""
    assert scanned(unconfigured) == told
    assert unconfigured.ask(0x5E) == [bytes([0x5E, UNCONFIGURED]).ljust(8, b"\0")]


def test_fastscan_then_a_node_id_boots(unconfigured):
    """Fastscan and configure node-ID: the device boots when it goes back to waiting."""
    scanned(unconfigured)
    unconfigured.ask(0x11, 9)
    unconfigured.master.received.clear()
    unconfigured.ask(0x04, 0)
    unconfigured.bus.advance(unconfigured.bus.now + 200_000_000)
    assert [frame.id for _, frame in unconfigured.master.received if frame.data == b"\0"] == [0x709]
    assert scanned(unconfigured) == []


def test_fastscan_of_two_finds_one_after_the_other(unconfigured, build):
    """Fastscan: the lower identity first; the other when that one has a node-ID."""
    other = Drive(profile("mclm"), UNCONFIGURED, Motor(profile("mclm").motor, build=build))
    other.dictionary.values[0x1018, 4] = 77
    unconfigured.bus.attach(other)
    unconfigured.bus.advance(unconfigured.bus.now + 200_000_000)
    first = scanned(unconfigured)
    unconfigured.ask(0x11, 9)
    unconfigured.ask(0x04, 0)
    unconfigured.bus.advance(unconfigured.bus.now + 200_000_000)
    second = scanned(unconfigured)
    assert len(first) == len(second) == 4
    assert first < second


def test_fastscan_of_a_part_out_of_turn_is_not_answered(unconfigured, told):
    """Fastscan: LSS sub has to be the part that is being scanned."""
    unconfigured.number(0x51, 0, 0x80, 0, 0)
    assert unconfigured.number(0x51, told[2], 0, 2, 3) == []


def test_fastscan_of_another_program(unconfigured, told, monkeypatch):
    """The LSS master of the canopen package finds the same."""
    monkeypatch.setattr("canopen.lss.time.sleep", lambda _: None)

    class Network:
        def send_message(self, identifier, data):
            assert identifier == REQUEST
            for answer in unconfigured.ask(*data):
                master.on_message_received(RESPONSE, answer, 0.0)

    master = LssMaster()
    master.network = Network()
    master.RESPONSE_TIMEOUT = 1e-6
    assert master.fast_scan() == (True, told)
