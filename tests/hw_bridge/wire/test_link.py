"""The short ways to an interface carry what python-can's messages carry, and take as little of what is none."""

import itertools
import os
import select
import subprocess
import sys
import threading
import time
import uuid

import can
import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hw_bridge.bus import Frame
from hw_bridge.wire import open_bus, shut_down
from hw_bridge.wire.direct import SlcanLink, UdpLink, link
from hw_bridge.wire.link import AnyLink, Arrival
from tests.every_case import every_case
from tests.hw_bridge.multicast import PORT, needed, own
from tests.hw_bridge.waiting import TIMEOUT
from twin.errors import SimulationError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the short ways are for Linux")
FRAMES = [
    Frame(0),
    Frame(0x080),
    Frame(0x201, bytes(range(8))),
    Frame(0x7FF, b"\xff"),
    Frame(0x701, remote=True, length=1),
]
INTERFACES = ("udp_multicast", "slcan")


def carried(one, other):
    """What a cable does: all bytes of one end to the other, until there are no more."""
    while select.select([one], [], [], 0.0)[0]:
        os.write(other, os.read(one, 4096))


class Pair:
    """Two ends of a bus: the first past python-can, the second as `kind` says."""

    def __init__(self, interface, kinds):
        import pty
        import tty

        self.masters = []
        if interface == "slcan":
            pairs = [pty.openpty() for _ in kinds]
            for end in itertools.chain(*pairs):
                tty.setraw(end)
            self.masters, slaves = [one[0] for one in pairs], [one[1] for one in pairs]
            channels, options = [os.ttyname(one) for one in slaves], {"sleep_after_open": 0}
            self.open = [*self.masters, *slaves]
        else:
            channels, options, self.open = [needed(own(74), port=PORT)] * len(kinds), {"port": PORT}, []
        self.buses = [open_bus(interface, channel, 1_000_000, options) for channel in channels]
        self.links = [kind(bus) for kind, bus in zip(kinds, self.buses, strict=True)]
        for end in self.masters:  # what opening said
            while select.select([end], [], [], 0.05)[0]:
                os.read(end, 4096)

    def send(self, frames):
        for frame in frames:
            self.links[0].send(frame)

    def heard(self, count):
        found = []
        end = time.monotonic() + TIMEOUT
        while len(found) < count and time.monotonic() < end:
            if self.masters:
                carried(*self.masters)
            found += [one.frame for one in self.links[1].hear(0.05)]
        return found

    def close(self):
        for bus in self.buses:
            shut_down(bus)
        for end in self.open:
            os.close(end)


def plain(interface):
    return lambda bus: AnyLink(bus, interface)


@every_case("interface", INTERFACES)
@every_case("ways", ["direct to direct", "direct to python-can", "python-can to direct"])
def test_frames_cross(interface, ways):
    kinds = [
        plain(interface) if way == "python-can" else lambda bus: link(bus, interface) for way in ways.split(" to ")
    ]
    pair = Pair(interface, kinds)
    try:
        pair.send(FRAMES)
        found = pair.heard(len(FRAMES))
        assert found == FRAMES
        assert pair.links[1].hear(0.0) == []
    finally:
        pair.close()


def test_others_have_the_long_way():
    with can.Bus(uuid.uuid4().hex, interface="virtual") as bus:
        assert isinstance(link(bus, "virtual"), AnyLink)


class Port:
    """A serial port at the end of a pipe."""

    def __init__(self):
        self.out, self.into = os.pipe()

    def fileno(self):
        return self.out


class Serial:
    def __init__(self):
        self.serialPortOrig = Port()


@pytest.fixture(scope="module")
def serial():
    bus = Serial()
    yield bus.serialPortOrig.into, SlcanLink(bus)
    for end in (bus.serialPortOrig.into, bus.serialPortOrig.out):
        os.close(end)


def test_a_line_in_pieces(serial):
    into, ours = serial
    for part in (b"t1", b"8111", b"F\rt0", b"800\r"):
        os.write(into, part)
        found = ours.hear(0.0)
        if part == b"F\rt0":
            assert [one.frame for one in found] == [Frame(0x181, b"\x1f")]
    assert [one.frame for one in found] == [Frame(0x080)]


@pytest.mark.parametrize(
    "line", [b"t-01111", b"t0x1111", b"t1_1111", b"t80011F", b"t181911", b"rFFF0", b"r-010", b"r1819"]
)
def test_a_line_with_an_impossible_identifier_or_length_is_no_frame(serial, line):
    into, ours = serial
    os.write(into, line + b"\rr1818\r")
    assert [arrival.frame for arrival in ours.hear(0.0)] == [Frame(0x181, remote=True, length=8)]


@given(st.binary(max_size=40))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_garbage_on_a_line_is_nothing(serial, garbage):
    """And the next line is read as it is."""
    into, ours = serial
    os.write(into, garbage + b"\rt18121122\r")
    found = [one.frame for one in ours.hear(0.0)]
    assert found[-1] == Frame(0x181, b"\x11\x22")
    assert all(one.id <= 0x7FF and len(one.data) <= 8 for one in found)


@given(
    st.one_of(
        st.binary(max_size=60), st.dictionaries(st.text(max_size=8), st.integers(-5, 5), max_size=4).map(msgpack.packb)
    )
)
@settings(max_examples=200, deadline=None)
def test_garbage_in_a_datagram_is_nothing(data):
    from hw_bridge.wire import direct

    found = direct._datagram(data, [])
    assert found is None or isinstance(found, Arrival)


def test_bytes_that_waited_came_evenly_meanwhile(serial):
    """A port does not tell when: a process that was stalled for 40 ms does not take four cycles for one moment."""
    into, ours = serial
    ours.hear(0.0)
    os.write(into, b"t0800\r" * 4)
    time.sleep(0.04)
    waited = [one.waited / 1e6 for one in ours.hear(0.0)]
    assert len(waited) == 4
    assert waited == sorted(waited, reverse=True)
    assert waited[0] >= 40
    assert waited[0] - waited[-1] == pytest.approx(0.75 * waited[0], rel=0.01)


def test_what_is_waited_for_is_new(serial):
    into, ours = serial
    ours.hear(0.0)
    threading.Timer(0.03, lambda: os.write(into, b"t0800\r")).start()
    (one,) = ours.hear(5.0)
    assert one == Arrival(Frame(0x080))


def test_a_port_that_is_gone_is_said():
    bus = Serial()
    ours = SlcanLink(bus)
    os.close(bus.serialPortOrig.into)
    with pytest.raises(SimulationError, match=r"bus: cannot be read: it is gone\. Check the adapter"):
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:  # so many failed reads in a short time: a machine that stalls has to begin again
            ours.hear(0.0)
    os.close(bus.serialPortOrig.out)


@pytest.fixture
def stalled():
    """A serial adapter that takes no bytes."""
    import pty
    import tty

    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    bus = open_bus("slcan", os.ttyname(theirs), 1_000_000, {"sleep_after_open": 0})
    yield ours, bus, link(bus, "slcan")
    for end in (ours, theirs):
        os.close(end)


def test_a_stalled_adapter_does_not_stall_the_program(stalled):
    """Frames that it did not take are discarded: sent later, a target or controlword would be outdated."""
    ours, bus, link = stalled
    with pytest.raises(SimulationError, match=r"bus: does not take frames: it takes no bytes\. Check the adapter"):
        for sent in range(100_000):  # noqa: B007 - used below
            link.send(Frame(0x201, bytes(8)))
    link.send(Frame(0x080))
    taken = b""
    while select.select([ours], [], [], 0.05)[0]:
        taken += os.read(ours, 1 << 20)
    assert taken.endswith(b"t0800\r")
    assert taken.count(b"t201") < sent / 2
    begin = time.monotonic()
    shut_down(bus)
    assert time.monotonic() - begin < 3.0


@pytest.mark.slow
def test_a_driver_that_does_not_close_is_left():
    class Stuck:
        def shutdown(self):
            threading.Event().wait()

    begin = time.monotonic()
    shut_down(Stuck())
    assert time.monotonic() - begin < TIMEOUT


def test_a_bus_that_is_closed_while_python_ends_does_not_hang():
    """A thread that is started then never begins: a jog whose stop was interrupted hung, without an end."""
    code = """
import builtins
from hw_bridge.wire import shut_down

def session():
    try:
        yield
    finally:
        shut_down(None)
        print("closed", flush=True)

builtins.session = session()
next(builtins.session)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=TIMEOUT, check=True)
    assert ended.stdout == "closed\n"


REFUSAL = "the adapter refuses frames (its answer is BEL): it is in bus-off, or its channel is closed"


@every_case(
    ("answers", "failures"),
    [
        (b"\a" * 9, 0),
        (b"\a" * 10, 1),
        (b"\a" * 9 + b"t18111F\r" + b"\a", 1),  # a frame of another node is no answer
        (b"\a" * 9 + b"\r" + b"\a" * 9, 0),
        (b"\a" * 9 + b"z\r" + b"\a" * 9, 0),
    ],
)
def test_refused_frames_are_a_failure(answers, failures):
    bus = Serial()
    ours = SlcanLink(bus)
    os.write(bus.serialPortOrig.into, answers)
    assert [one.failure for one in ours.hear(0.0) if one.frame is None] == [REFUSAL] * failures
    assert ours.hear(0.0) == []
    for end in (bus.serialPortOrig.into, bus.serialPortOrig.out):
        os.close(end)


def test_rare_refusals_are_none():
    from hw_bridge.wire import direct

    clock = itertools.count(0, 120_000_000)  # [ns]
    ours = SlcanLink(Serial())
    assert not any(ours._refuses([b"\a"], next(clock)) for _ in range(100))
    assert ours._refuses([b"\a"] * direct.REFUSALS[0], next(clock))
    for end in (ours._port.into, ours._port.out):
        os.close(end)


def test_datagrams_are_taken_together():
    pair = Pair("udp_multicast", [UdpLink, UdpLink])
    try:
        for _ in range(40):  # Linux begins to stamp a moment after a socket has asked for it first
            pair.send(FRAMES)
            time.sleep(0.05)
            found = pair.links[1].hear(0.0)
            assert len(found) == len(FRAMES)
            if is_stamped := all(20e6 < one.waited < 5e9 for one in found):
                break
        assert is_stamped, "by the kernel, when each came"
    finally:
        pair.close()
