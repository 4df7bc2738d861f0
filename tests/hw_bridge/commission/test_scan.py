"""What a scan says of each node that answers, from the values of its objects and its heartbeat."""

import pytest

from hw_bridge.bus import Frame
from hw_bridge.commission import SdoSession, scan
from hw_bridge.commission.bus_scan import DUPLICATE_ID, MUTE, profile_name_of, profile_title_of
from hw_bridge.dictionary import State
from hw_bridge.profiles import identity, profile
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, SdoServer

V3 = ("faulhaber_v3", {(0x6041, 0): WORDS[State.DISABLED], (0x1018, 3): 0xAB, (0x1018, 4): 0xCD})
V3_IDENTITY = (identity("faulhaber_v3")[1], identity("faulhaber_v3")[2], 0xAB, 0xCD)


class Network:
    """A bus of servers that answer at once. `heartbeats`: a state for each node that sends one at the first request."""

    wall_clock = False

    def __init__(self, servers, heartbeats=None):
        self.now, self.observers, self.servers = 0, [], servers
        self.heartbeats, self.requests = dict(heartbeats or {}), []
        for server in servers:
            server.answer = lambda data, server=server: self.answer(0x580 + server.number, data)

    def observe(self, observer):
        self.observers.append(observer)

    def answer(self, identifier, data):
        for observer in self.observers:
            observer(self.now, Frame(identifier, data))

    def send(self, frame):
        self.requests.append((self.now, frame.id))
        while self.heartbeats:
            number, state = self.heartbeats.popitem()
            self.answer(0x700 + number, bytes([state]))
        for server in self.servers:
            server.send(frame)

    def advance(self, time, done):
        self.now = self.now if done() else time


def device(number, kind=V3, missing=(), **more):
    name, values = kind
    return SdoServer(profile(name), values | more.pop("values", {}), missing, number)


def found(*servers, left_out=(), **heartbeats):
    network = Network(servers, {int(name[1:]): state for name, state in heartbeats.items()})
    return scan(SdoSession(network), left_out), network


def test_a_drive_with_its_identity_and_states():
    (node,), network = found(device(5), n5=127)
    assert (node.node, node.title, node.identity) == (5, "FAULHABER Motion Control V3.0", V3_IDENTITY)
    assert (node.state, node.fault, node.problem) == ("Switch on disabled, Pre-operational", "", "")
    assert node.description == (
        f"FAULHABER Motion Control V3.0, vendor 147h, product {V3_IDENTITY[1]:X}h, revision ABh, serial CDh"
    )
    first = [identifier for _, identifier in network.requests[:127]]
    assert first == [0x600 + number for number in range(1, 128)]
    assert [time for time, _ in network.requests[:3]] == [0, 2_000_000, 4_000_000]


@every_case(
    ("values", "missing", "state", "fault"),
    [
        ({}, (), "Switch on disabled", ""),
        ({(0x6041, 0): WORDS[State.ENABLED]}, (), "Operation enabled", ""),
        ({(0x6041, 0): WORDS[State.FAULT]}, (), "Fault", "does not say why"),
        (
            {(0x6041, 0): WORDS[State.REACTION], (0x603F, 0): 0x1234},
            (),
            "Fault reaction active",
            "1234h a code of the vendor's. Read the vendor's manual on this code.",
        ),
        (
            {
                (0x6041, 0): WORDS[State.FAULT],
                (0x603F, 0): 0x8611,
                (0x1003, 0): 3,
                (0x1003, 1): 0x12348611,
                (0x1003, 2): 0,
                (0x1003, 3): 0x8130,
            },
            (),
            "Fault",
            (
                "8611h following error. It cannot follow: look for a jam, lower velocity and acceleration, check 6065h.; "
                "8130h node guarding or heartbeat. The program that it watched (1016h) ended or stalled. Start it anew "
                "once the drive is reset."
            ),
        ),
        (
            {(0x6041, 0): WORDS[State.FAULT], (0x1003, 0): 1, (0x1003, 1): 0x1234},
            [0x603F],
            "Fault",
            "1234h a code of the vendor's. Read the vendor's manual on this code.",
        ),
    ],
)
def test_the_state_of_a_drive_and_its_errors(values, missing, state, fault):
    (node,), _ = found(device(3, missing=missing, values=values))
    assert (node.state, node.fault, node.problem) == (state, fault, "")


@pytest.mark.parametrize(
    ("values", "title", "state"),
    [
        ({(0x1000, 0): 0x30191, (0x1018, 1): 0x999}, "I/O module (CiA 401)", "Operational"),
        ({(0x1000, 0): 0x20192, (0x1018, 1): 0x999}, "drive of an unknown vendor", "Switch on disabled, Operational"),
        ({(0x1000, 0): 0x30195, (0x1018, 1): 0x999}, "device type 00030195h", "Operational"),
        ({(0x1018, 2): 0x99}, "perhaps FAULHABER Motion Control V3.0", "Switch on disabled, Operational"),
    ],
)
def test_devices_without_a_profile_of_their_own(values, title, state):
    (node,), _ = found(device(9, values=values), n9=5)
    assert (node.title.partition(" or ")[0], node.state, node.problem) == (title, state, "")


@pytest.mark.parametrize("number", [1, 127])
def test_every_node_id_of_a_bus_can_be_read(number):
    """Also the one that is this program's in a run."""
    node = SdoSession(Network([device(number)])).drive(str(number))
    assert (node.number, node.keys.node, node.sdo.number(0x1018, 4)) == (number, number, 0xCD)


def test_two_nodes_of_one_id_are_no_device():
    """Of two that answer the first question, or only a later one."""
    nodes, _ = found(device(2), device(4), device(4))
    assert [(node.node, node.problem) for node in nodes] == [(2, ""), (4, f"2 {DUPLICATE_ID}")]
    assert nodes[1].description == f"2 {DUPLICATE_ID}"
    late = device(4)
    send, requests = late.send, []
    late.send = lambda frame: (requests.append(frame.id), send(frame) if requests.count(0x604) > 6 else None)
    nodes, _ = found(device(4), late)
    assert [node.problem for node in nodes] == [f"2 {DUPLICATE_ID}"]


def test_a_node_that_lives_but_does_not_answer():
    nodes, network = found(device(2), n2=5, n7=4, n8=5, left_out=[8])
    assert [(node.node, node.problem) for node in nodes] == [(2, ""), (7, MUTE)]
    assert (
        len([identifier for _, identifier in network.requests if identifier == 0x607]) == 2
    )  # after it may have booted
    assert not [identifier for _, identifier in network.requests if identifier == 0x608]


def test_a_silent_bus_gets_a_second_chance():
    nodes, network = found()
    assert nodes == []
    assert len(network.requests) == 2 * 127
    assert network.requests[127][0] >= 500_000_000


def test_a_device_that_is_no_canopen_device():
    (node,), _ = found(device(6, missing=[0x1018]))
    assert node.problem == (
        "answers, but not as a CANopen device should: node 6: 1018h.1: refused with 06020000h, no object."
    )
    assert (node.title, node.state) == ("", "")


@every_case(
    ("vendor", "product", "device_type", "name", "title"),
    [
        (identity("epos4")[1], identity("epos4")[2], 0x20192, "epos4", "maxon EPOS4"),
        (0xFB, 0x1234, 0x20192, "epos4", "perhaps maxon EPOS4 or maxon EPOS2"),
        (0xFB, 0x1234, 0x30191, "cia401", "perhaps maxon EPOS4 or maxon EPOS2"),
        (0x999, 1, 0x30191, "cia401", ""),
        (0x999, 1, 0x20192, "", ""),
    ],
)
def test_the_profile_of_an_identity(vendor, product, device_type, name, title):
    assert profile_name_of(vendor, product, device_type) == name
    assert profile_title_of(vendor, product, device_type) == title
