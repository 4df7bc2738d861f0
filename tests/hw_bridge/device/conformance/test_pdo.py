"""Rules of CiA 301 (version 4.2.0): PDO and SYNC.

The numbers of clauses are recalled; the service or object beside them counts. What a vendor's drive does not offer is skipped.
"""

import struct

import pytest

from hw_bridge.dictionary import U8, Code, var
from tests.hw_bridge.bench import NODE
from tests.hw_bridge.device.conformance.motions import on
from tests.hw_bridge.device.conformance.service_requests import (
    INVALID,
    abort,
    alone,
    mapped,
)

pytestmark = on("faulhaber_v3", "epos4")  # defaults, and when a mapping may change, differ

# ----------------------------------------------------------------------------------------------------------- PDO


def test_default_identifiers(bench):
    """7.3.3, pre-defined connection set."""
    for number in range(4):
        assert bench.read(0x1400 + number, 1) & 0x7FF == 0x200 + 0x100 * number + NODE
        assert bench.read(0x1800 + number, 1) & 0x7FF == 0x180 + 0x100 * number + NODE


def test_an_identifier_in_use_does_not_change(bench):
    """7.5.2.35, 1400h.1: bits 0 to 29 only while bit 31 is set."""
    assert abort(bench.write, 0x1400, 0x222, 1) is Code.VALUE_RANGE


@pytest.mark.parametrize("identifier", [0x000, 0x001, 0x101, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x701, 0x7FF])
def test_restricted_identifiers(bench, identifier):
    """7.3.5, restricted CAN-IDs."""
    index, _ = alone(bench, "rpdo", 1)
    assert abort(bench.write, index, identifier, 1) is Code.VALUE_RANGE


def test_extended_identifiers_are_refused(bench):
    """7.5.2.35: bit 29 where only 11 bits are supported."""
    index, identifier = alone(bench, "rpdo", 1)
    assert abort(bench.write, index, identifier & 0x7FF | 1 << 29, 1) is Code.VALUE_RANGE


def test_a_mapping_in_use_does_not_change(bench):
    """7.5.2.36, 1600h: PDO invalid and subindex 0 = 0 first."""
    assert abort(bench.write, 0x1600, 0x60810020, 1) in (Code.UNSUPPORTED_ACCESS, Code.DEVICE_STATE)
    bench.write(0x1400, bench.read(0x1400, 1) | INVALID, 1)
    assert abort(bench.write, 0x1600, 0x60810020, 1) in (Code.UNSUPPORTED_ACCESS, Code.DEVICE_STATE)


@pytest.mark.parametrize(
    ("word", "codes"),
    [
        (0x5FFF0020, {Code.NO_OBJECT, Code.NOT_MAPPABLE}),
        (0x60640520, {Code.NO_SUBINDEX, Code.NOT_MAPPABLE}),
        (0x10180120, {Code.NOT_MAPPABLE}),
        (0x60410008, {Code.NOT_MAPPABLE}),
    ],
)
def test_what_cannot_be_mapped(bench, word, codes):
    """7.5.2.38, 1A00h: 06020000h or 06040041h for an object that is not there, cannot be mapped, or has another length."""
    index, _ = alone(bench, "tpdo", 1)

    def write():
        bench.write(index + 0x200, word, 1)
        bench.write(index + 0x200, 1)

    assert abort(write) in codes


def test_what_is_read_only_is_not_received(bench):
    """7.5.2.36, 1600h: 06040041h."""
    index, _ = alone(bench, "rpdo", 1)
    assert abort(bench.write, index + 0x200, 0x60410010, 1) is Code.NOT_MAPPABLE


def test_more_than_64_bits_are_refused(bench):
    """7.5.2.38: 06040042h."""
    index, _ = alone(bench, "tpdo", 1)
    for place in (1, 2, 3):
        bench.write(index + 0x200, 0x60640020, place)
    assert abort(bench.write, index + 0x200, 3) is Code.PDO_LENGTH


def test_more_objects_than_there_are_places(bench):
    """7.5.2.38: 06040042h."""
    index, _ = alone(bench, "tpdo", 1)
    assert abort(bench.write, index + 0x200, bench.profile.rules.objects + 1) is Code.PDO_LENGTH


@pytest.mark.parametrize("kind", [241, 245, 251])
def test_reserved_transmission_types(bench, kind):
    """7.5.2.37, 1800h.2: 06090030h."""
    assert abort(bench.write, 0x1800, kind, 2) is Code.VALUE_RANGE
    assert abort(bench.write, 0x1400, kind, 2) is Code.VALUE_RANGE


@pytest.mark.parametrize("kind", [252, 253])
def test_receive_pdos_are_not_requested(bench, kind):
    """7.5.2.35, 1400h.2: reserved."""
    assert abort(bench.write, 0x1400, kind, 2) is Code.VALUE_RANGE


def test_an_inhibit_time_in_use_does_not_change(bench):
    """7.5.2.37, 1800h.3."""
    if 3 not in bench.drive.dictionary.objects[0x1800]:
        pytest.skip("no inhibit time")
    assert abort(bench.write, 0x1800, 100, 3) in (Code.UNSUPPORTED_ACCESS, Code.DEVICE_STATE)


def test_an_event_sends(bench):
    """7.2.2.3, triggering modes: event-driven."""
    identifier = mapped(bench, "tpdo", 1, [0x60610008], 255)
    bench.nmt(1)
    bench.frames(identifier)
    bench.write(0x6060, 3)
    bench.go(5)
    assert bench.frames(identifier)[-1] == b"\x03"


@pytest.mark.parametrize(("kind", "expected"), [(1, 6), (2, 3), (3, 2)])
def test_every_nth_sync_sends(bench, kind, expected):
    """7.5.2.37, 1800h.2: 1 to 240."""
    identifier = mapped(bench, "tpdo", 1, [0x60610008], kind)
    bench.nmt(1)
    bench.frames(identifier)
    for _ in range(6):
        bench.send(0x080)
        bench.go(2)
    assert len(bench.frames(identifier)) == expected


def test_acyclic_synchronous_sends_changes_at_sync(bench):
    """7.5.2.37, 1800h.2: 0."""
    identifier = mapped(bench, "tpdo", 1, [0x60610008], 0)
    bench.nmt(1)
    bench.send(0x080)
    bench.go(2)
    bench.frames(identifier)
    bench.send(0x080)
    bench.go(2)
    assert bench.frames(identifier) == []
    bench.write(0x6060, 3)
    bench.go(3)
    assert bench.frames(identifier) == []
    bench.send(0x080)
    bench.go(2)
    assert bench.frames(identifier) == [b"\x03"]


@pytest.mark.parametrize("kind", [252, 253])
def test_a_request_sends(bench, kind):
    """7.5.2.37, 1800h.2: 252 samples at SYNC, 253 at the request."""
    if bench.read(0x1800, 1) & 1 << 30:
        pytest.skip("no remote frames")
    identifier = mapped(bench, "tpdo", 1, [0x60610008], kind)
    bench.nmt(1)
    bench.send(0x080)
    bench.go(2)
    assert bench.frames(identifier) == []
    bench.send(identifier, remote=True, length=1)
    bench.go(2)
    assert len(bench.frames(identifier)) == 1


def test_no_request_where_bit_30_forbids_it(bench):
    """7.5.2.37, 1800h.1."""
    index, identifier = alone(bench, "tpdo", 1)
    bench.write(index + 0x200, 0x60610008, 1)
    bench.write(index + 0x200, 1)
    bench.write(index, 1, 2)
    bench.write(index, identifier & 0x7FF | 1 << 30, 1)
    bench.nmt(1)
    bench.frames(identifier & 0x7FF)
    bench.send(identifier & 0x7FF, remote=True, length=1)
    bench.go(2)
    assert bench.frames(identifier & 0x7FF) == []


def test_the_inhibit_time_keeps_apart(bench):
    """7.5.2.37, 1800h.3: in 100 us."""
    if 3 not in bench.drive.dictionary.objects[0x1800]:
        pytest.skip("no inhibit time")
    index, identifier = alone(bench, "tpdo", 1)
    bench.write(index + 0x200, 0x60610008, 1)
    bench.write(index + 0x200, 1)
    bench.write(index, 255, 2)
    bench.write(index, 500, 3)
    bench.write(index, identifier & 0x7FFFFFFF, 1)
    bench.nmt(1)
    bench.go(60)
    bench.frames(identifier & 0x7FF)
    for mode in (3, 1, 3, 1):
        bench.write(0x6060, mode)
        bench.go(3)
    assert len(bench.frames(identifier & 0x7FF)) == 1


def test_the_event_timer_sends(bench):
    """7.5.2.37, 1800h.5: in ms."""
    if 5 not in bench.drive.dictionary.objects[0x1800]:
        pytest.skip("no event timer")
    identifier = mapped(bench, "tpdo", 1, [0x60610008], 255)
    bench.write(0x1800, 20, 5)
    bench.nmt(1)
    bench.frames(identifier)
    bench.go(101)
    assert len(bench.frames(identifier)) == 5


def test_an_event_driven_receive_pdo_acts_at_once(bench):
    """7.2.2.2, transmission modes."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 255)
    bench.nmt(1)
    value = bench.read(0x6081) - 1
    bench.send(identifier, struct.pack("<I", value))
    assert bench.read(0x6081) == value


def test_a_synchronous_receive_pdo_acts_at_sync(bench):
    """7.2.2.2."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 1)
    bench.nmt(1)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<I", before - 1))
    assert bench.read(0x6081) == before
    bench.send(0x080)
    assert bench.read(0x6081) == before - 1


def test_a_pdo_that_is_too_short_is_8210h_and_does_not_act(bench):
    """7.2.2.4.1 and 7.2.7.1: PDO not processed due to length error."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 255)
    bench.nmt(1)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<I", before - 1)[:3])
    bench.go(2)
    assert bench.read(0x6081) == before
    assert bench.emergencies() == [0x8210]


def test_a_pdo_that_is_too_long_acts_by_its_first_bytes(bench):
    """7.2.2.4.1 and 7.2.7.1: PDO length exceeded, 8220h, where the vendor tells it."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 255)
    bench.nmt(1)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<IB", before - 1, 7))
    bench.go(2)
    assert bench.read(0x6081) == before - 1
    assert bench.emergencies() == ([0x8220] if 0x8220 in bench.profile.faults else [])


def test_a_pdo_that_does_not_exist_is_neither_sent_nor_taken(bench):
    """7.5.2.35 and 7.5.2.37: bit 31."""
    index, identifier = alone(bench, "rpdo", 1)
    bench.write(index + 0x200, 0x60810020, 1)
    bench.write(index + 0x200, 1)
    bench.nmt(1)
    before = bench.read(0x6081)
    bench.send(identifier & 0x7FF, struct.pack("<I", before - 1))
    assert bench.read(0x6081) == before


# ---------------------------------------------------------------------------------------------------------- SYNC


def test_a_sync_has_the_length_that_1019h_says(bench):
    """7.5.2.22, 1019h: where it is 0 or not there a SYNC has no counter; one that has is not processed."""
    identifier = mapped(bench, "tpdo", 1, [0x60610008], 1)
    bench.nmt(1)
    bench.frames(identifier)
    for data in ([1], [1, 2], bytes(8)):
        bench.send(0x080, data)
        bench.go(2)
    assert bench.frames(identifier) == []
    bench.send(0x080)
    bench.go(2)
    assert len(bench.frames(identifier)) == 1


def test_targets_wait_for_a_sync_of_the_right_length(bench):
    """7.5.2.22: the same for what is received."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 1)
    bench.nmt(1)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<I", before - 1))
    bench.send(0x080, [1])
    assert bench.read(0x6081) == before


def test_a_consumer_of_sync_does_not_produce_it(bench):
    """7.5.2.5, 1005h, bit 30: refused by a device that cannot."""
    assert abort(bench.write, 0x1005, 1 << 30 | 0x80) in (Code.VALUE_RANGE, Code.READ_ONLY)


def test_sync_may_have_another_identifier(bench):
    """7.5.2.5, 1005h."""
    if not bench.drive.dictionary.entry(0x1005).writable:
        pytest.skip("1005h is constant")
    identifier = mapped(bench, "tpdo", 1, [0x60610008], 1)
    bench.write(0x1005, 0x0A0)
    bench.nmt(1)
    bench.frames(identifier)
    bench.send(0x080)
    bench.send(0x0A0)
    bench.go(2)
    assert len(bench.frames(identifier)) == 1


@pytest.fixture
def counting(bench):
    """A drive whose EDS file has 1019h."""
    dictionary = bench.drive.dictionary
    (entry,) = var(0x1019, "Synchronous counter overflow value", U8, "rw")
    dictionary.objects[0x1019] = {0: entry}
    dictionary.values[0x1019, 0] = 0
    return bench


def test_a_counter_is_expected_where_1019h_says_so(counting):
    """7.5.2.22, 1019h: from 2 to 240 a SYNC has one byte; one without it is not processed."""
    identifier = mapped(counting, "tpdo", 1, [0x60610008], 1)
    counting.write(0x1019, 10)
    counting.nmt(1)
    counting.frames(identifier)
    counting.send(0x080)
    counting.go(2)
    assert counting.frames(identifier) == []
    counting.send(0x080, [1])
    counting.go(2)
    assert len(counting.frames(identifier)) == 1


@pytest.mark.parametrize("value", [1, 241, 255])
def test_reserved_overflow_values(counting, value):
    """7.5.2.22, 1019h."""
    assert abort(counting.write, 0x1019, value) is Code.VALUE_RANGE
