"""Transmission types and timers of process data, to the nanosecond, and what a slave takes from frames."""

import struct

import pytest

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import Abort, Code, State
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import Turned

INVALID, SYNC, OWN = 1 << 31, Frame(0x080), 0x281
TARGET = 0x60FF0020  # an object of which nothing follows in the drive


def mapped(kind, inhibit=0, event=0, word=TARGET):
    """An operational drive whose TPDO 2 carries one object, and the times and data of its frames."""
    turned = Turned()
    write = turned.write
    write(0x1801, INVALID | OWN, 1)
    write(0x1A01, 0)
    write(0x1A01, word, 1)
    write(0x1A01, 1)
    write(0x1801, kind, 2)
    write(0x1801, inhibit, 3)
    write(0x1801, event, 5)
    write(0x1801, OWN, 1)
    turned.drive.nmt.command(b"\1\1")
    turned.frames = []
    turned.drive.connect(
        lambda frame: turned.frames.append((turned.drive.now, frame.data)) if frame.id == OWN else None
    )
    return turned


def changed(turned, value):
    turned.write(0x60FF, value)
    turned.drive.refresh()


def numbers(turned):
    found = [struct.unpack("<i", data)[0] for _, data in turned.frames]
    turned.frames.clear()
    return found


@pytest.mark.parametrize("kind", [254, 255])
def test_a_change_is_sent_at_once_and_once(kind):
    turned = mapped(kind)
    changed(turned, 5)
    assert turned.frames == [(turned.drive.now, b"\5\0\0\0")]
    turned.go(10)
    changed(turned, 5)
    assert numbers(turned) == [5]
    turned.drive.receive(SYNC)
    assert numbers(turned) == []


@pytest.mark.parametrize("inhibit", [1, 15])
def test_the_inhibit_time_counts_tenths_of_a_millisecond(inhibit):
    turned = mapped(255, inhibit)
    turned.go(5)  # the frame at the start is long ago
    turned.frames.clear()
    begin = turned.drive.now
    for value in (1, 2, 3):
        changed(turned, value)
    assert numbers(turned) == [1]
    turned.drive.advance(begin + inhibit * 100_000 - 1)
    assert numbers(turned) == []
    turned.drive.advance(begin + inhibit * 100_000)
    assert turned.frames == [(begin + inhibit * 100_000, b"\3\0\0\0")]


def test_the_event_timer_counts_milliseconds_from_the_last_frame():
    turned = mapped(255, event=7)
    begin = turned.drive.now
    changed(turned, 1)
    turned.go(5)
    changed(turned, 2)
    turned.go(20)
    assert [(time - begin) / MILLISECOND for time, _ in turned.frames] == [0, 5, 12, 19]
    turned.drive.nmt.command(b"\x80\1")
    turned.go(20)
    assert len(turned.frames) == 4


@pytest.mark.parametrize(
    ("kind", "sent"), [(1, [1, 1, 1, 1, 1, 1]), (2, [0, 1, 0, 1, 0, 1]), (3, [0, 0, 1, 0, 0, 1]), (240, [0] * 6)]
)
def test_every_nth_sync(kind, sent):
    turned = mapped(kind)
    counts = []
    for value in range(6):
        changed(turned, value)
        turned.drive.receive(SYNC)
        counts.append(len(numbers(turned)))
    assert counts == sent


def test_type_0_is_sent_at_the_sync_after_a_change():
    turned = mapped(0)
    found = []
    for value in (0, 0, 4, 4, 5):
        changed(turned, value)
        turned.drive.receive(SYNC)
        found.append(numbers(turned))
    assert found == [[0], [], [4], [], [5]]


@pytest.mark.parametrize(("kind", "answers"), [(252, [7]), (253, [9]), (255, [9]), (1, [9])])
def test_remote_requests(kind, answers):
    """Type 252 answers with what was sampled at the last SYNC, the others with what is there."""
    turned = mapped(kind)
    changed(turned, 7)
    turned.drive.receive(SYNC)
    turned.write(0x60FF, 9)
    turned.frames.clear()
    turned.drive.receive(Frame(OWN, remote=True, length=4))
    assert numbers(turned) == answers
    turned.drive.receive(Frame(OWN + 1, remote=True, length=4))
    turned.drive.nmt.command(b"\2\1")
    turned.drive.receive(Frame(OWN, remote=True, length=4))
    assert numbers(turned) == []


@every_case(
    ("value", "code"),
    [
        (OWN, None),
        (OWN + 2, Code.VALUE_RANGE),
        (INVALID | (OWN + 2), None),
        (1 << 29 | OWN, Code.VALUE_RANGE),
        (0x880, Code.VALUE_RANGE),
        (INVALID | OWN, None),
        (1 << 30 | OWN, None),
    ],
)
def test_an_identifier_in_use_stays(value, code):
    turned = mapped(255)
    if code is None:
        turned.write(0x1801, value, 1)
        assert turned.drive.tpdos[1].identifier == value
        assert turned.drive.tpdos[1].active is not bool(value & INVALID)
    else:
        with pytest.raises(Abort) as aborted:
            turned.write(0x1801, value, 1)
        assert aborted.value.code is code


@every_case(
    ("index", "kind", "allowed"),
    [
        (0x1801, 0, True),
        (0x1801, 240, True),
        (0x1801, 241, False),
        (0x1801, 251, False),
        (0x1801, 252, True),
        (0x1801, 253, True),
        (0x1801, 254, True),
        (0x1401, 252, False),
        (0x1401, 253, False),
        (0x1401, 255, True),
        (0x1401, 240, True),
        (0x1401, 241, False),
    ],
)
def test_transmission_types_that_there_are(index, kind, allowed):
    turned = Turned()
    if allowed:
        turned.write(index, kind, 2)
    else:
        with pytest.raises(Abort):
            turned.write(index, kind, 2)
    assert turned.read(index, 2) == (kind if allowed else 255)


def test_the_inhibit_time_in_use_stays():
    turned = mapped(255)
    with pytest.raises(Abort) as aborted:
        turned.write(0x1801, 5, 3)
    assert aborted.value.code is Code.UNSUPPORTED_ACCESS


@pytest.mark.parametrize(
    ("kind", "data", "state", "error"),
    [
        (255, b"\x06\0\x07\0\0\0", State.READY, None),
        (255, b"\x06\0\x07\0\0", State.DISABLED, 0x8210),
        (255, b"\x06\0\x07\0\0\0\0", State.READY, 0x8220),
        (240, b"\x06\0\x07\0\0\0", State.DISABLED, None),
    ],
)
def test_received_process_data(kind, data, state, error):
    turned = Turned()
    turned.drive.nmt.command(b"\1\1")
    turned.write(0x1401, kind, 2)
    turned.drive.receive(Frame(0x301, data))
    assert (turned.drive.state, turned.read(0x607A)) == (state, 7 if state is State.READY else 0)
    assert [*turned.drive.active] == ([error] if error else [])
    turned.drive.receive(Frame(0x080, b"\1"))  # 1019h is 0: a SYNC with a counter is none
    assert turned.read(0x607A) == (7 if state is State.READY else 0)
    turned.drive.receive(SYNC)
    assert turned.read(0x607A) == (7 if state is State.READY or kind == 240 else 0)


def test_data_that_wait_for_a_sync_are_gone_after_a_change_of_state():
    turned = Turned()
    turned.write(0x1401, 1, 2)
    turned.drive.nmt.command(b"\1\1")
    turned.drive.receive(Frame(0x301, b"\x06\0\x07\0\0\0"))
    turned.drive.nmt.command(b"\x80\1")
    turned.drive.nmt.command(b"\1\1")
    turned.drive.receive(SYNC)
    assert turned.read(0x607A) == 0
    turned.drive.receive(Frame(0x301, b"\x06\0\x07\0\0\0"))
    turned.drive.receive(SYNC)
    turned.write(0x607A, 1)
    turned.drive.receive(SYNC)  # they were taken once
    assert turned.read(0x607A) == 1


def test_a_value_that_does_not_fit_is_left_and_the_others_are_taken():
    turned = Turned()
    turned.drive.nmt.command(b"\1\1")
    turned.drive.receive(Frame(0x401 + 0x100, struct.pack("<Hh", 6, 7000)))  # 6071h: from -6000 to 6000
    assert (turned.drive.state, turned.read(0x6071)) == (State.READY, 0)
    turned.drive.receive(Frame(0x401 + 0x100, struct.pack("<Hh", 7, -6000)))
    assert (turned.drive.state, turned.read(0x6071)) == (State.SWITCHED_ON, -6000)


def test_a_slave_in_bus_off_hears_nothing():
    turned = Turned()
    turned.drive.bus_off()
    turned.drive.receive(Frame(0, b"\1\1"))
    assert turned.drive.port.state.name == "PRE_OPERATIONAL"
    turned.sent.clear()
    turned.drive.bus_on()
    turned.drive.receive(Frame(0, b"\1\1"))
    assert turned.drive.port.state.name == "OPERATIONAL"
    assert [frame.data[:3].hex() for frame in turned.sent if frame.id == 0x81] == ["408111"]


def test_a_request_is_answered_after_the_time_of_the_drive():
    turned = Turned()
    turned.sent.clear()
    begin = turned.drive.now
    turned.drive.receive(Frame(0x601, bytes.fromhex("4000100000000000")))
    turned.drive.advance(begin + MILLISECOND - 1)
    assert turned.sent == []
    turned.drive.advance(begin + MILLISECOND)
    assert turned.sent == [Frame(0x581, bytes.fromhex("4300100092014200"))]
    turned.drive.receive(Frame(0x602, bytes.fromhex("4000100000000000")))
    turned.drive.nmt.command(b"\2\1")
    turned.drive.receive(Frame(0x601, bytes.fromhex("4000100000000000")))
    turned.go(5)
    assert len(turned.sent) == 1


@pytest.mark.parametrize(
    ("index", "value", "allowed"),
    [(0x1005, 0x81, True), (0x1005, 1 << 30 | 0x80, False), (0x1005, 0x7FF, False), (0x1005, 0x680, True)],
)
def test_identifiers_of_sync(index, value, allowed):
    turned = mapped(1)
    if not allowed:
        with pytest.raises(Abort):
            turned.write(index, value)
        return
    turned.write(index, value)
    turned.drive.receive(SYNC)
    assert numbers(turned) == []
    turned.drive.receive(Frame(value))
    assert numbers(turned) == [0]
