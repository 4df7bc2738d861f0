"""Process data: the remap procedure, transmission types, timers, lengths."""

import struct
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hw_bridge.device.pdo import TransmitPdo
from hw_bridge.device.port import Port
from hw_bridge.dictionary import Abort, Code, Dictionary, Mode, NmtState, State
from hw_bridge.profiles import profile
from tests.hw_bridge.bench import NODE, AbortedError

INVALID = 1 << 31


def remap(bench, start, words, kind, identifier):
    """The procedure of CiA 301: disable, clear, write, count, type, enable."""
    bench.write(start, bench.read(start, 1) | INVALID, 1)
    bench.write(start + 0x200, 0)
    for place, word in enumerate(words, 1):
        bench.write(start + 0x200, word, place)
    bench.write(start + 0x200, len(words))
    bench.write(start, kind, 2)
    bench.write(start, identifier, 1)


def refused(bench, *arguments):
    with pytest.raises(AbortedError) as found:
        bench.write(*arguments)
    return found.value.code


def test_a_mapping_in_use_cannot_be_changed(bench):
    remap_code = bench.profile.rules.remap
    assert refused(bench, 0x1600, 0) is remap_code
    assert refused(bench, 0x1600, 0x607A0020, 1) is remap_code
    bench.write(0x1400, bench.read(0x1400, 1) | INVALID, 1)
    assert refused(bench, 0x1600, 0x607A0020, 1) is remap_code  # subindex 0 is not 0 yet
    bench.write(0x1600, 0)
    assert refused(bench, 0x1600, 0x12340020, 1) is Code.NO_OBJECT
    assert refused(bench, 0x1600, 0x607A0120, 1) is Code.NO_SUBINDEX
    assert refused(bench, 0x1600, 0x607A0010, 1) is Code.NOT_MAPPABLE  # wrong length
    assert refused(bench, 0x1600, 0x60410010, 1) is Code.NOT_MAPPABLE  # read only
    assert refused(bench, 0x1600, 0x10170010, 1) is Code.NOT_MAPPABLE  # not process data
    for place, word in enumerate((0x607A0020, 0x60FF0020, 0x60400010), 1):
        bench.write(0x1600, word, place)
    assert refused(bench, 0x1600, 3) is Code.PDO_LENGTH  # 80 bits
    assert refused(bench, 0x1600, bench.profile.rules.objects + 1) is Code.PDO_LENGTH
    bench.write(0x1600, 2)
    assert refused(bench, 0x1400, 0x181 - 1, 1) is Code.VALUE_RANGE  # a reserved identifier
    assert refused(bench, 0x1400, 241, 2) is Code.VALUE_RANGE
    bench.write(0x1400, 0x200 + NODE, 1)


@settings(max_examples=200)
@given(
    st.sampled_from(["epos4", "mclm", "faulhaber_v3"]),
    st.lists(
        st.tuples(
            st.sampled_from([0x1800, 0x1A00]),
            st.integers(0, 9),
            st.one_of(
                st.integers(0, 12),
                st.sampled_from([0x180, 0x183, 0x80000183, 0xC0000183, 0x40000183]),
                st.sampled_from([0x60410010, 0x60640020, 0x606C0020, 0x60400010, 0x60610008, 0x10000020, 0]),
                st.integers(0, 2**32 - 1),
            ),
        ),
        max_size=30,
    ),
)
def test_random_writes_keep_the_mapping_sound(name, writes):
    port = Port(Dictionary(profile(name).objects, 3))
    port.state = NmtState.OPERATIONAL
    pdo = TransmitPdo(port, profile(name).rules, 0)
    pdo.configure()
    for index, sub, value in writes:
        exists, before = not pdo.identifier & INVALID, list(pdo.mapped)
        try:
            port.dictionary.write(port.dictionary.entry(index, sub), value)
        except Abort:
            assert pdo.mapped == before
        if exists and not pdo.identifier & INVALID:
            assert pdo.mapped == before
        assert pdo.form.size <= 8
        assert len(pdo.mapped) == port.dictionary.get(0x1A00)
        assert all(entry.mappable and entry.readable for entry in pdo.mapped)


def position(bench):
    return [struct.unpack("<i", data)[0] for data in bench.frames(0x180 + NODE)]


def test_synchronous_rpdo_acts_at_the_next_sync(bench):
    remap(bench, 0x1400, (0x60400010,), 1, 0x200 + NODE)
    bench.nmt(1)
    bench.send(0x200 + NODE, [6, 0])
    bench.go(2)
    assert bench.state is State.DISABLED
    bench.send(0x080)
    assert bench.state is State.READY


def test_synchronous_tpdo_samples_at_every_nth_sync(bench):
    remap(bench, 0x1800, (0x60640020,), 3, 0x180 + NODE)
    bench.nmt(1)
    bench.frames(0x180 + NODE)
    counts = []
    for _ in range(9):
        bench.send(0x080)
        counts.append(len(position(bench)))
    assert counts == [0, 0, 1] * 3


def test_acyclic_tpdo_is_sent_at_sync_after_a_change(bench):
    remap(bench, 0x1800, (0x60410010,), 0, 0x180 + NODE)
    bench.nmt(1)
    bench.send(0x080)
    bench.frames(0x180 + NODE)
    bench.send(0x080)
    assert bench.frames(0x180 + NODE) == []
    bench.control(6)
    assert bench.frames(0x180 + NODE) == []
    bench.send(0x080)
    assert len(bench.frames(0x180 + NODE)) == 1


def test_pdos_live_in_operational_only(bench):
    bench.send(0x200 + NODE, [6, 0])
    assert bench.state is State.DISABLED
    bench.nmt(1)
    bench.go(2)
    assert bench.frames(0x180 + NODE)
    bench.nmt(128)
    bench.control(6)
    assert bench.frames(0x180 + NODE) == []
    assert bench.state is State.READY  # SDO works in Pre-operational


def test_inhibit_time_spaces_frames(make):
    bench = make("faulhaber_v3")
    bench.write(0x1801, bench.read(0x1801, 1) | INVALID, 1)
    bench.write(0x1801, 100, 3)  # 10 ms
    bench.write(0x1801, 0x280 + NODE, 1)
    bench.enable(Mode.PV)
    bench.write(0x60FF, 50)
    bench.nmt(1)
    bench.go(300)
    times = [time for time, frame in bench.master.received if frame.id == 0x280 + NODE]
    gaps = [b - a for a, b in pairwise(times)]
    assert len(gaps) > 20
    assert min(gaps) >= 9_900_000  # the wire adds or takes a little


@pytest.mark.parametrize("name", ["faulhaber_v3", "mclm"])
def test_event_timer_repeats_without_change(make, name):
    bench = make(name)
    bench.write(0x1800, 10, 5)
    bench.nmt(1)
    bench.frames(0x180 + NODE)
    bench.go(100)
    assert len(bench.frames(0x180 + NODE)) in (9, 10)


def test_lengths(bench):
    bench.nmt(1)
    bench.send(0x300 + NODE, [6])
    assert bench.emergencies() == [0x8210]
    assert bench.state is State.DISABLED  # not taken
    bench.control(0x80, 0)
    bench.emergencies()
    bench.send(0x200 + NODE, [6, 0, 1, 2])
    assert bench.state is State.READY  # the first bytes are taken
    known = 0x8220 in bench.profile.faults
    assert bench.emergencies() == ([0x8220] if known else [])


def test_remote_request(make):
    for name, answers in (("mclm", 1), ("epos4", 0)):  # EPOS4 forbids it with bit 30
        bench = make(name)
        bench.nmt(1)
        bench.go(5)
        bench.frames(0x180 + NODE)
        bench.send(0x180 + NODE, remote=True, length=2)
        assert len(bench.frames(0x180 + NODE)) == answers


def test_the_event_timer_waits_for_the_inhibit_time(make):
    bench = make("faulhaber_v3")
    bench.write(0x1801, bench.read(0x1801, 1) | INVALID, 1)
    bench.write(0x1801, 200, 3)  # 20 ms
    bench.write(0x1801, 5, 5)  # ms
    bench.write(0x1801, 0x280 + NODE, 1)
    bench.nmt(1)
    bench.master.received.clear()
    bench.go(200)
    times = [time for time, frame in bench.master.received if frame.id == 0x280 + NODE]
    assert {round((after - before) / 1e6, 2) for before, after in pairwise(times)} == {20.0}


def test_type_252_answers_with_what_was_sampled_at_sync(make):
    bench = make("faulhaber_v3")
    remap(bench, 0x1801, [0x60FF0020], 252, 0x280 + NODE)
    bench.nmt(1)
    bench.write(0x60FF, 111)
    bench.send(0x80)
    bench.write(0x60FF, 222)
    bench.frames(0x280 + NODE)
    bench.send(0x280 + NODE, remote=True, length=8)
    assert [struct.unpack("<i", data)[0] for data in bench.frames(0x280 + NODE) if data] == [111]
