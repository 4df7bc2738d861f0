"""Disturbances on a python-can interface: what the slave sends and hears, without a wall clock."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import BUS_OFF, Disturbance, Frame, Kind
from hw_bridge.bus.event_queue import EventQueue
from hw_bridge.wire import Wire
from hw_bridge.wire.wire import RECOVERY
from twin.errors import SimulationError

FRAME = Frame(0x183, b"\1\2")


class Slave:
    """Keeps what it hears; sends what a test says."""

    def __init__(self):
        self.port = SimpleNamespace(event_queue=EventQueue())
        self.heard, self.states = [], []

    def connect(self, send):
        self.send = send

    def receive(self, frame):
        self.heard.append((self.port.event_queue.now, frame))

    def bus_off(self):
        self.states.append(("off", self.port.event_queue.now))

    def bus_on(self):
        self.states.append(("on", self.port.event_queue.now))


class Sink:
    """An interface that keeps what is sent."""

    def __init__(self):
        self.sent, self.is_gone = [], False

    def send(self, frame):
        if self.is_gone:
            raise SimulationError("gone")
        self.sent.append(frame)


@pytest.fixture
def wire():
    return Wire(Slave(), Sink())


def disturb(wire, kind, **options):
    wire.disturbances = [Disturbance(kind, **options)]
    return wire.disturbances[0]


def test_undisturbed_frames_pass_at_once(wire):
    wire.slave.send(FRAME)
    wire._deliver(FRAME)
    assert wire.link.sent == [FRAME]
    assert wire.slave.heard == [(0, FRAME)]


def test_dropped_frames_are_gone_in_both_directions(wire):
    disturb(wire, Kind.DROP, low=0x183, high=0x183)
    for frame in (FRAME, Frame(0x184)):
        wire.slave.send(frame)
        wire._deliver(frame)
    assert wire.link.sent == [Frame(0x184)]
    assert wire.slave.heard == [(0, Frame(0x184))]


def test_delayed_frames_come_later_in_both_directions(wire):
    disturb(wire, Kind.DELAY, delay=5_000)
    wire.slave.send(FRAME)
    wire._deliver(FRAME)
    event_queue = wire.slave.port.event_queue
    event_queue.advance(4_999)
    assert wire.link.sent == wire.slave.heard == []
    event_queue.advance(5_000)
    assert wire.link.sent == [FRAME]
    assert wire.slave.heard == [(5_000, FRAME)]


def test_what_arrives_is_not_destroyed_once_more(wire):
    """The interface has carried it: the sender's repetitions are over."""
    disturb(wire, Kind.CORRUPT)
    wire._deliver(FRAME)
    assert wire.slave.heard == [(0, FRAME)]


def test_a_destroyed_frame_is_repeated_until_it_gets_through(wire):
    """ISO 11898-1: each destroyed transmission adds 8 to the transmit error counter, each good one takes 1 off."""
    hit = disturb(wire, Kind.CORRUPT, count=3)
    wire.slave.send(FRAME)
    assert wire.link.sent == [FRAME]
    assert wire.slave.states == []
    assert hit.count == 0
    assert wire._errors > 0
    before = wire._errors
    wire.slave.send(FRAME)
    assert wire._errors == before - 1
    assert len(wire.link.sent) == 2


def test_too_many_errors_are_bus_off_and_it_recovers(wire):
    disturb(wire, Kind.CORRUPT, count=1_000)
    wire.slave.send(FRAME)
    assert wire.link.sent == []
    assert wire.slave.states == [("off", 0)]
    wire.disturbances = []
    wire.slave.port.event_queue.advance(RECOVERY - 1)
    assert len(wire.slave.states) == 1
    wire.slave.port.event_queue.advance(RECOVERY)
    assert wire.slave.states[1:] == [("on", RECOVERY)]
    wire.slave.send(FRAME)
    assert wire.link.sent == [FRAME]


def test_bus_off_counts_from_the_errors_before(wire):
    """16 destroyed transmissions reach 128, 32 reach bus-off at 256."""
    for count, states in ((15, 0), (17, 1)):
        wire.disturbances = [Disturbance(Kind.CORRUPT, count=count)]
        wire.slave.send(FRAME)
        assert len(wire.slave.states) == states, BUS_OFF


def test_frames_that_the_interface_does_not_take_are_counted(wire):
    wire.link.is_gone = True
    for _ in range(2):
        wire.slave.send(FRAME)
    assert wire.lost == 2
