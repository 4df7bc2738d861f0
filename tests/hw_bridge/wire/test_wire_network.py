"""The master's network on python-can: time of the wall clock, errors of the interface."""

import errno
import gc
import os
import time
import uuid
from unittest.mock import Mock

import can
import pytest

from hw_bridge.bus import Frame
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import bench_network
from hw_bridge.wire import WireNetwork, realtime
from twin.errors import SimulationError


@pytest.fixture
def pair():
    channel = uuid.uuid4().hex
    with can.Bus(channel, interface="virtual") as other:
        network = WireNetwork("virtual", channel, 1_000_000, {})
        yield network, other
        network.close()


def test_frames_and_time(pair):
    network, other = pair
    heard = []
    network.hear = heard.append
    network.send(Frame(0x123, b"\1"))
    assert other.recv(1.0).arbitration_id == 0x123
    other.send(can.Message(arbitration_id=0x321, is_extended_id=False))
    other.send(can.Message(arbitration_id=1, is_extended_id=True))
    begin = time.monotonic()
    network.advance(network.now + 20_000_000)
    assert time.monotonic() - begin >= 0.02
    assert heard == [Frame(0x321)]


def test_a_condition_ends_the_wait(pair):
    network, other = pair
    heard = []
    network.hear = heard.append
    other.send(can.Message(arbitration_id=0x321, is_extended_id=False))
    begin = time.monotonic()
    network.advance(network.now + 10_000_000_000, lambda: bool(heard))
    assert time.monotonic() - begin < 5.0


def test_the_process_is_as_before_at_the_end():
    assert gc.isenabled()
    before = os.sched_getscheduler(0) if hasattr(os, "sched_getscheduler") else None
    network = WireNetwork("virtual", uuid.uuid4().hex, 1_000_000, {})
    assert not gc.isenabled()
    network.close()
    assert gc.isenabled()
    assert before is None or os.sched_getscheduler(0) == before


def test_without_permission_for_priority(monkeypatch):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(realtime.os, "sched_setscheduler", refused, raising=False)
    assert not realtime.set_fifo_priority(realtime.DRIVE)


def test_an_interface_that_cannot_be_opened():
    with pytest.raises(SimulationError, match="nonsense x: cannot be opened"):
        WireNetwork("nonsense", "x", 1_000_000, {})


def test_a_system_without_socketcan(monkeypatch):
    monkeypatch.setattr(can, "Bus", Mock(side_effect=OSError(errno.EAFNOSUPPORT, "Address family not supported")))
    with pytest.raises(SimulationError, match=r"SocketCAN is missing here\. Use -i slcan"):
        WireNetwork("socketcan", "can7", 1_000_000, {})


@pytest.mark.parametrize(
    ("interface", "option", "names"),
    [
        ("udp_multicast", "prot", "can_filters, fd, hop_limit, port, receive_own_messages"),
        ("pcan", "auto_restart", "auto_reset, .*timing.*"),  # one that the constructor reads from its further arguments
    ],
)
def test_an_option_that_the_interface_does_not_have(interface, option, names):
    """python-can ignores it: with a misspelled port another bus would be opened."""
    with pytest.raises(SimulationError, match=f"^{interface}: no option '{option}'. Use one of {names}.$"):
        WireNetwork(interface, "x", 1_000_000, {option: 1})


def test_bit_timing_may_be_given_by_its_parts():
    """python-can makes the argument `timing` of these options; what it says of an adapter that is absent is its own error."""
    parts = {"f_clock": 8_000_000, "brp": 1, "tseg1": 5, "tseg2": 2, "sjw": 1, "nof_samples": 1}
    with pytest.raises(SimulationError, match="cannot be opened"):
        WireNetwork("slcan", "/nowhere", 1_000_000, parts)


@pytest.mark.parametrize(("method", "message"), [("send", "does not take frames"), ("recv", "cannot be read")])
def test_an_interface_that_fails(pair, monkeypatch, method, message):
    network, _ = pair

    def failing(*_args, **_more):
        raise can.CanOperationError("unplugged")

    monkeypatch.setattr(network.bus, method, failing)
    with pytest.raises(SimulationError, match=f"{message}: unplugged"):
        network.send(Frame(0)) if method == "send" else network.advance(network.now + 20_000_000_000)


def test_a_full_queue_of_socketcan(pair, monkeypatch):
    """Linux queues ten frames by default; three drives need about as many in a cycle."""
    network, _ = pair

    def refuse(_message):
        raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)

    monkeypatch.setattr(network.bus, "send", refuse)
    with pytest.raises(SimulationError, match=r"No buffer space available .*txqueuelen 1000\."):
        network.send(Frame(0))


def test_bus_off_of_the_interface(pair, monkeypatch):
    network, _ = pair
    monkeypatch.setattr(network.bus, "recv", lambda _timeout: can.Message(is_error_frame=True))
    monkeypatch.setattr(type(network.bus), "state", can.BusState.ERROR)
    with pytest.raises(SimulationError, match="bus-off"):
        network.advance(network.now + 1_000_000)


def test_bus_off_of_socketcan_is_in_the_identifier(pair):
    network, other = pair
    network.link._error_classes = True
    other.send(can.Message(arbitration_id=0x40, is_extended_id=False, is_error_frame=True))
    with pytest.raises(SimulationError, match="bus-off"):
        network.advance(network.now + 50_000_000)


def test_a_bus_full_of_foreign_frames_does_not_keep_the_program(pair, monkeypatch):
    network, _ = pair
    monkeypatch.setattr(network.bus, "recv", lambda _timeout: can.Message(arbitration_id=1, is_extended_id=True))
    begin = time.monotonic()
    network.advance(network.now + 1_000_000)
    assert time.monotonic() - begin < 20.0  # else it would not end at all


def test_what_came_late_is_heard(pair):
    network, other = pair
    heard = []
    network.hear = heard.append
    for number in range(50):
        other.send(can.Message(arbitration_id=number, is_extended_id=False))
    network.advance(network.now - 1_000_000_000)
    assert len(heard) == 50


def test_garbage_on_a_serial_line_is_passed_over(monkeypatch):
    """slcan: bytes that are no text are flushed, what no CAN frame can be is not taken."""
    import pty

    ours, theirs = pty.openpty()
    network = WireNetwork("slcan", os.ttyname(theirs), 1_000_000, {"sleep_after_open": 0})
    try:
        heard = []
        network.hear = heard.append
        for line in (
            b"\xff\xfe\r",
            b"t1\r",
            b"tzzz8\r",
            b"tFFF0\r",
            b"t1239" + b"00" * 9 + b"\r",
            b"t1232\r",
            b"",
            b"\r",
        ):
            os.write(ours, line)
            network.advance(network.now + 20_000_000)
        os.write(ours, b"t18121122\r")
        network.advance(network.now + 20_000_000_000, lambda: heard[-1:] == [Frame(0x181, b"\x11\x22")])
        assert heard[-1] == Frame(0x181, b"\x11\x22")
        assert all(frame.id <= 0x7FF and len(frame.data) <= 8 for frame in heard)
    finally:
        network.close()
        os.close(ours)
        os.close(theirs)


class Unplugged:
    """An adapter that is gone: its driver raises whatever it meets, at everything."""

    def send(self, *_):
        raise AttributeError("'NoneType' object has no attribute 'write'")

    def recv(self, *_):
        raise TypeError("handle is gone")

    def flush(self):
        raise RuntimeError("handle is gone")

    def shutdown(self):
        raise RuntimeError("handle is gone")


def test_an_adapter_that_is_unplugged(pair, monkeypatch):
    """Named, and the process is as before."""
    network, _ = pair
    real = network.bus
    monkeypatch.setattr(network, "bus", Unplugged())
    network.link.bus = network.bus
    with pytest.raises(SimulationError, match=r"bus: does not take frames: .* Check the adapter"):
        network.send(Frame(0x123))
    with pytest.raises(SimulationError, match=r"bus: cannot be read: handle is gone\. Check the adapter"):
        network.advance(network.now + 20_000_000_000)
    network.close()
    assert gc.isenabled()
    real.shutdown()


def test_a_stop_without_an_adapter_ends_with_a_note(build):
    """The stop path never raises; the drives miss the heartbeat and stop by themselves."""
    keys = HardwareKeys.model_validate(
        {"interface": "virtual", "channel": uuid.uuid4().hex, "nodes": {"axis": {"node": 1, "profile": "mclm"}}}
    )
    master = Master(keys, bench_network(keys, build))
    master.running = True
    master.network.bus.shutdown()
    master.network.bus = master.network.link.bus = Unplugged()
    master.stop()
    (note,) = master.notes
    assert note.startswith("stop: bus: does not take frames: ")
    assert note.endswith("The drives stop by themselves when this program's heartbeat is missing.")


def test_what_comes_back_is_not_another_masters(pair):
    """Of an interface that echoes: each frame once, the second is somebody else's."""
    network, other = pair
    network._echoes = True
    heard = []
    network.hear = heard.append
    network.send(Frame(0x080))
    for _ in range(2):
        other.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    network.advance(network.now + 20_000_000_000, lambda: bool(heard))
    network.advance(network.now + 20_000_000)
    assert heard == [Frame(0x080)]


def test_observers_hear_of_a_sent_frame_after_the_send(pair):
    """A slow or failing observer must not delay, or be taken for a failure of, what stops a drive."""
    network, other = pair
    heard = []

    def failing(_time, _frame):
        raise OSError("no space left on device")

    network.observe(failing)
    network.observe(lambda _time, frame: heard.append(frame))
    network.send(Frame(0x123, b"\1"))
    assert heard == []
    assert other.recv(1.0).arbitration_id == 0x123
    network.send_at(Frame(0x080), network.now + 1_000_000)
    assert heard == []
    network.advance(network.now)
    network.send(Frame(0x123, b"\2"))
    network.close()
    assert heard == [Frame(0x123, b"\1"), Frame(0x080), Frame(0x123, b"\2")]
    assert network.observer_errors == ["function: no space left on device. It observes the bus no longer."]
