"""Rules of CiA 301 (version 4.2.0): SDO.

The numbers of clauses are recalled; the service or object beside them counts. What a vendor's drive does not offer is skipped.
"""

import struct

import pytest

from hw_bridge.dictionary import Code
from tests.hw_bridge.bench import NODE
from tests.hw_bridge.device.conformance.service_requests import (
    abort,
    segmented,
    silent,
    valued,
)


def test_an_expedited_upload_tells_its_size(bench):
    """7.2.4.3.5, protocol SDO upload initiate."""
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x1000, 0))[:4] == bytes([0x43, 0x00, 0x10, 0])
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x1001, 0))[:1] == b"\x4f"
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x6041, 0))[:1] == b"\x4b"


def test_a_segmented_upload_is_complete(bench):
    """7.2.4.3.6, protocol SDO upload segment."""
    assert segmented(bench, 0x1008).decode() == bench.drive.dictionary.entry(0x1008).default


def test_a_segmented_download_of_a_number(bench):
    """7.2.4.3.3, protocol SDO download segment."""
    value = valued(bench, 0x6081)
    assert bench.sdo(struct.pack("<BHBI", 0x21, 0x6081, 0, 4))[0] == 0x60
    assert bench.sdo(bytes([0x01 | (7 - 4) << 1]) + struct.pack("<I", value))[0] == 0x20
    assert bench.read(0x6081) == value


def test_an_expedited_download_without_a_size(bench):
    """7.2.4.3.2: s = 0, the object's own size counts."""
    value = valued(bench, 0x6081)
    bench.sdo(struct.pack("<BHBI", 0x22, 0x6081, 0, value))
    assert bench.read(0x6081) == value


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (struct.pack("<BHB", 0x40, 0x5FFF, 0), Code.NO_OBJECT),
        (struct.pack("<BHB", 0x40, 0x1018, 99), Code.NO_SUBINDEX),
        (struct.pack("<BHBI", 0x23, 0x1000, 0, 1), Code.READ_ONLY),
        (struct.pack("<BHBI", 0x2F, 0x1018, 0, 1), Code.READ_ONLY),
        (struct.pack("<BHBI", 0x23, 0x1017, 0, 1), Code.TOO_LONG),
        (struct.pack("<BHBI", 0x2F, 0x6081, 0, 1), Code.TOO_SHORT),
        (bytes([0xE0, 0, 0x10, 0]), Code.COMMAND_UNKNOWN),
        (bytes([0x60]), Code.COMMAND_UNKNOWN),
        (bytes([0x00]), Code.COMMAND_UNKNOWN),
        (struct.pack("<BHBI", 0xC6, 0x6081, 0, 4), Code.COMMAND_UNKNOWN),
        (struct.pack("<BHBI", 0xA4, 0x1008, 0, 1), Code.COMMAND_UNKNOWN),
    ],
)
def test_abort_codes(bench, request_, code):
    """7.2.4.3.17, protocol SDO abort transfer: object, subindex, access, length, command, segments without a transfer, block."""
    assert abort(bench.sdo, request_) is code


def test_a_value_out_of_range(bench):
    """7.2.4.3.17: 06090030h to 06090032h."""
    assert abort(bench.write, 0x1029, 3, 1) in (Code.VALUE_RANGE, Code.VALUE_TOO_HIGH)


def test_an_abort_names_its_object(bench):
    """7.2.4.3.17: multiplexor of the request."""
    bench.frames(0x580 + NODE)
    bench.send(0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x5FFF, 7))
    bench.go(3)
    assert bench.frames(0x580 + NODE)[0][:4] == bytes([0x80, 0xFF, 0x5F, 7])


def test_a_toggle_bit_that_does_not_alternate(bench):
    """7.2.4.3.17: 05030000h."""
    bench.sdo(struct.pack("<BHB", 0x40, 0x1008, 0))
    if len(bench.drive.dictionary.entry(0x1008).default) <= 4:
        pytest.skip("short name")
    assert abort(bench.sdo, bytes([0x70])) is Code.TOGGLE


def test_an_abort_of_the_client_ends_the_transfer(bench):
    """7.2.4.3.17: not answered; a segment afterwards has no transfer."""
    bench.sdo(struct.pack("<BHBI", 0x21, 0x6081, 0, 4))
    assert silent(bench, 0x600 + NODE, struct.pack("<BHBI", 0x80, 0x6081, 0, 0x08000000), 0x580 + NODE)
    assert abort(bench.sdo, bytes([0x01 | 3 << 1]) + bytes(4)) is Code.COMMAND_UNKNOWN


def test_a_new_request_ends_the_transfer(bench):
    """7.2.4.1: one transfer of a channel at a time."""
    bench.sdo(struct.pack("<BHBI", 0x21, 0x6081, 0, 4))
    bench.read(0x1000)
    assert abort(bench.sdo, bytes([0x01 | 3 << 1]) + bytes(4)) is Code.COMMAND_UNKNOWN


@pytest.mark.parametrize("size", [0, 4, 7])
def test_a_request_of_less_than_8_bytes_is_ignored(bench, size):
    """7.2.4.3: SDO frames have 8 bytes."""
    assert silent(bench, 0x600 + NODE, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])[:size], 0x580 + NODE)


def test_a_request_for_another_node_is_ignored(bench):
    """7.3.3, pre-defined connection set."""
    assert silent(bench, 0x600 + NODE + 1, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]), 0x580 + NODE)


def test_the_server_tells_its_identifiers(bench):
    """7.5.2.33, 1200h: 600h and 580h plus the node-ID, read only for the default SDO."""
    assert (bench.read(0x1200), bench.read(0x1200, 1), bench.read(0x1200, 2)) == (2, 0x600 + NODE, 0x580 + NODE)
    assert abort(bench.write, 0x1200, 0x601, 1) is Code.READ_ONLY


def test_every_record_tells_its_highest_subindex(bench):
    """7.4.1, structure of the object dictionary: subindex 0 of arrays and records."""
    for index, subs in bench.drive.dictionary.objects.items():
        if len(subs) > 1 and index != 0x1003 and not 0x1600 <= index < 0x1800 and not 0x1A00 <= index < 0x1C00:
            assert bench.read(index, 0) == max(subs), f"{index:04X}h"


def test_every_readable_object_is_read(bench):
    """7.2.4: what the dictionary has, the server tells."""
    for entry in bench.drive.dictionary.entries():
        if entry.readable and entry.index != 0x1003:
            size = len(segmented(bench, entry.index, entry.sub))
            assert not entry.type.size or size == entry.type.size


def test_every_object_takes_its_own_value(bench):
    """7.2.4: the value that is there may be written again."""
    acting = {0x1003, 0x1010, 0x1011, 0x6040}
    for entry in bench.drive.dictionary.entries():
        pdo = 0x1400 <= entry.index < 0x1C00
        if entry.access == "rw" and entry.type.size in (1, 2, 4) and not pdo and entry.index not in acting:
            bench.write(entry.index, bench.drive.dictionary.values[entry.index, entry.sub], entry.sub)
