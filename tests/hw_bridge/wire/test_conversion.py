"""Frames to and from python-can's messages, datagrams and lines of serial adapters; ages and failures of links."""

import errno
import importlib
import os
import sys
from types import SimpleNamespace

import can
import msgpack
import pytest

from hw_bridge.bus import Frame
from hw_bridge.wire import adapter, direct, files
from hw_bridge.wire.link import AnyLink, Arrival, Link
from tests.every_case import every_case
from tests.hw_bridge.wire.clock import Clock
from twin.errors import SimulationError

links = importlib.import_module("hw_bridge.wire.link")  # the package has a function of this name
REMOTE = Frame(0x701, remote=True, length=1)


@pytest.mark.parametrize("frame", [Frame(0), Frame(0x7FF, bytes(range(8))), Frame(0x181, b"\x1f"), REMOTE])
def test_there_and_back(frame):
    message = adapter.to_message(frame)
    assert (message.arbitration_id, bytes(message.data), message.is_remote_frame) == (
        frame.id,
        frame.data,
        frame.remote,
    )
    assert (message.is_extended_id, message.is_error_frame, message.dlc) == (
        False,
        False,
        frame.length or len(frame.data),
    )
    assert adapter.from_message(message) == frame


@every_case(
    ("message", "reason"),
    [
        ({"is_error_frame": True}, "error frame"),
        ({"is_extended_id": True}, "29-bit identifier"),
        ({"is_fd": True}, "CAN FD"),
        ({"arbitration_id": 0x800}, "no CAN frame"),
        ({"data": bytes(9), "dlc": 9}, "no CAN frame"),
    ],
)
def test_what_canopen_does_not_use(message, reason):
    message = can.Message(**{"is_extended_id": False, "check": False} | message)
    assert adapter.from_message(message) is None
    assert files._why(message) == reason


def test_causes_of_a_drivers_error():
    error = OSError("it failed")
    assert adapter.cause(error) == "it failed"
    error.__cause__ = ValueError("no device")
    assert adapter.cause(error) == "it failed: no device"
    error.__cause__ = OSError("it failed")
    assert adapter.cause(error) == "it failed"
    assert adapter.cause(TimeoutError()) == "TimeoutError"


def test_a_serial_port_is_read_once_for_many_bytes():
    class Port:
        timeout = 0.5

        def __init__(self):
            self.available, self.asked, self.reset = b"", [], 0

        @property
        def in_waiting(self):
            return len(self.available)

        def read(self, size):
            self.asked.append(size)
            data, self.available = self.available[:size], self.available[size:]
            return data

        def reset_input_buffer(self):
            self.reset += 1

    port = Port()
    buffered = adapter.BufferedSerial(port)
    assert (buffered.read(), port.asked) == (b"", [1])  # nothing waits: within the port's own timeout
    port.available = b"abc"
    assert buffered.in_waiting == 3
    assert [buffered.read(), buffered.in_waiting, buffered.read(4)] == [b"a", 2, b"b"]
    assert port.asked == [1, 3]
    buffered.timeout = 0.1
    assert (port.timeout, buffered.timeout) == (0.1, 0.1)
    buffered.reset_input_buffer()
    assert (buffered.in_waiting, port.reset, buffered.read()) == (0, 1, b"")


# ------------------------------------------------------------------------------------------------ datagrams and lines

DATAGRAM = direct.MESSAGE | {"arbitration_id": 0x181, "data": b"\1\2", "dlc": 2}


@every_case(
    ("changes", "arrival"),
    [
        ({}, Arrival(Frame(0x181, b"\1\2"))),
        ({"is_error_frame": True}, Arrival(None)),
        ({"is_remote_frame": True, "dlc": 5}, Arrival(Frame(0x181, remote=True, length=5))),
        ({"is_extended_id": True}, None),
        ({"is_fd": True}, None),
        ({"arbitration_id": 0x7FF}, Arrival(Frame(0x7FF, b"\1\2"))),
        ({"arbitration_id": 0x800}, None),
        ({"arbitration_id": 0}, Arrival(Frame(0, b"\1\2"))),
        ({"arbitration_id": -1}, None),
        ({"data": bytes(8), "dlc": 8}, Arrival(Frame(0x181, bytes(8)))),
        ({"data": bytes(9), "dlc": 9}, None),
        ({"data": 3.5}, None),
    ],
)
def test_datagrams(changes, arrival):
    assert direct._datagram(msgpack.packb(DATAGRAM | changes), []) == arrival
    assert direct._datagram(msgpack.packb({"arbitration_id": 1}), []) is None


@pytest.mark.parametrize(("seconds", "nanoseconds", "waited"), [(4, 999_999_123, 1_000), (5, 100, 23), (3, 0, 0)])
def test_the_age_of_a_datagram_is_that_of_its_stamp(monkeypatch, seconds, nanoseconds, waited):
    Clock(monkeypatch, links).ns = 5_000_000_123
    stamp = direct.STAMP.pack(seconds, nanoseconds)
    assert direct._datagram(msgpack.packb(DATAGRAM), [(1, 35, stamp)]) == Arrival(Frame(0x181, b"\1\2"), waited)


@pytest.mark.parametrize(
    ("passed", "age"), [(-1, 0), (0, 0), (1, 1), (999_999_999, 999_999_999), (1_000_000_000, 0), (5_000_000_000, 0)]
)
def test_a_stamp_of_another_clock_is_none(monkeypatch, passed, age):
    Clock(monkeypatch, links).ns = 10_000_000_000
    assert links.age(10_000_000_000 - passed) == age


@every_case(
    ("line", "frame"),
    [
        (b"t18121122", Frame(0x181, b"\x11\x22")),
        (b"t7FF0", Frame(0x7FF)),
        (b"t0008" + b"00" * 8, Frame(0, bytes(8))),
        (b"t0009" + b"00" * 9, None),
        (b"t800100", None),
        (b"t1812112", None),
        (b"t181211223344", Frame(0x181, b"\x11\x22")),  # with a time stamp
        (b"r7011", REMOTE),
        (b"r7019", None),
        (b"T00000181", None),  # 29 bits
        (b"z", None),
        (b"", None),
        (b"tGGG0", None),
        (b"t181", None),
    ],
)
def test_lines_of_a_serial_adapter(line, frame):
    assert direct._line(line) == frame


@pytest.mark.skipif(sys.platform != "linux", reason="the short ways are for Linux")
def test_lines_that_are_sent():
    reader, writer = os.pipe()
    port = SimpleNamespace(fileno=lambda: writer)
    serial = direct.SlcanLink(SimpleNamespace(serialPortOrig=port))
    for frame in (Frame(0x81), Frame(0x7FF, b"\x0a\xff"), REMOTE):
        serial.put(frame)
    assert os.read(reader, 100) == b"t0810\rt7FF20AFF\rr7011\r"
    for end in (reader, writer):
        os.close(end)


# ----------------------------------------------------------------------------------------------------------- any link


class Bus:
    """A python-can bus with one message to give."""

    state = can.BusState.ACTIVE

    def __init__(self, clock=None, takes=0):
        self.clock, self.takes, self.message = clock, takes, None
        self.sent, self.flushed = [], 0

    def recv(self, timeout):
        self.timeout = timeout
        if self.clock is not None:
            self.clock.ns += self.takes
        message, self.message = self.message, None
        return message

    def send(self, message):
        self.sent.append(message)

    def flush(self):
        self.flushed += 1


def message(**options):
    return can.Message(**{"is_extended_id": False, "arbitration_id": 0x181, "data": b"\1"} | options)


@pytest.mark.parametrize(
    ("timeout", "is_there", "takes", "idle", "looked"),
    [
        (0.002, False, 2_500_000, 2_500_000, 2_000_000),  # nothing came until the time-out
        (0.0, False, 700, 700, 0),
        (-1.0, False, 700, 700, 0),
        (0.002, True, 800_000, 800_000, 800_000),
        (0.0, True, 700, 0, 700),  # it was there
    ],
)
def test_waiting_and_looking(monkeypatch, timeout, is_there, takes, idle, looked):
    clock = Clock(monkeypatch, links)
    bus = Bus(clock, takes)
    begin = clock.ns
    link = AnyLink(bus, "virtual")
    if is_there:
        bus.message = message(timestamp=(begin + takes - 300) / 1e9)
    arrivals = link.hear(timeout)
    assert (link.idle, link.looked - begin) == (idle, looked)
    assert [arrival.frame for arrival in arrivals] == [Frame(0x181, b"\1")] * is_there
    assert all(abs(arrival.waited - 300) <= 200 for arrival in arrivals)  # the stamp is a float


@every_case(
    ("interface", "state", "identifier", "failure"),
    [
        ("virtual", can.BusState.ACTIVE, 0x40, ""),
        ("virtual", can.BusState.ERROR, 0, "bus-off"),
        ("virtual", can.BusState.PASSIVE, 0, ""),
        ("socketcan", can.BusState.ACTIVE, 0x40, "bus-off"),
        ("socketcan", can.BusState.ACTIVE, 0x44, "bus-off"),
        ("socketcan", can.BusState.ACTIVE, 0x20, ""),
    ],
)
def test_error_frames(interface, state, identifier, failure):
    bus = Bus()
    bus.state, bus.message = state, message(is_error_frame=True, arbitration_id=identifier)
    assert AnyLink(bus, interface).hear(0.0) == [Arrival(None, failure=failure)]


def test_foreign_messages_are_passed_over_and_frames_are_sent():
    bus = Bus()
    bus.message = message(is_extended_id=True)
    link = AnyLink(bus, "virtual")
    assert link.hear(0.0) == []
    link.send(REMOTE)
    assert [adapter.from_message(sent) for sent in bus.sent] == [REMOTE]


class Failing(Link):
    error = OSError("gone")

    def take(self, timeout):
        if self.error:
            raise self.error
        return []

    put = take


@pytest.mark.parametrize(("step", "reads"), [(1_000, 21), (2_490_000, 21), (2_510_000, None)])
def test_many_failed_reads_in_a_short_time_are_the_end(monkeypatch, step, reads):
    """More than 20 within 50 ms; a line that garbles now and then is passed over."""
    clock, bus = Clock(monkeypatch, links), Bus()
    link, number = Failing(bus), 0
    try:
        for _ in range(60):
            number += 1
            assert link.hear(0.0) == []
            clock.ns += step
    except SimulationError as error:
        text = str(error)
    else:
        text, number = "", None
    assert (text, number) == ("bus: cannot be read: gone. Check the adapter." if reads else "", reads)
    assert bus.flushed == (reads - 1 if reads else 60)


def test_a_good_read_ends_the_count(monkeypatch):
    Clock(monkeypatch, links)
    link = Failing(Bus())
    for _ in range(20):
        link.hear(0.0)
    link.error = None
    link.hear(0.0)
    link.error = OSError("gone")
    for _ in range(20):
        link.hear(0.0)
    with pytest.raises(SimulationError):
        link.hear(0.0)


@pytest.mark.parametrize(("number", "has_hint"), [(errno.ENOBUFS, True), (errno.ENODEV, False)])
def test_a_frame_that_is_not_taken(number, has_hint):
    link = Failing(Bus())
    for error in (OSError(number, "full"), can.CanOperationError("full", number)):
        link.error = error
        with pytest.raises(
            SimulationError, match=r"^bus: does not take frames: .*full.*Check the adapter, wiring"
        ) as caught:
            link.send(Frame(1))
        assert ("txqueuelen 1000" in str(caught.value)) is has_hint
