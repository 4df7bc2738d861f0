"""Rules of CiA 301 (version 4.2.0) on the simulated drives of all profiles.

Each check names its clause in the docstring. The numbers are recalled; the service or object beside them counts. What a vendor's drive
does not offer is skipped.
"""

import struct

import pytest

from hw_bridge.dictionary import U8, Code, Mode, NmtState, var
from tests.hw_bridge.bench import NODE, AbortedError

SAVE, LOAD = 0x65766173, 0x64616F6C
ERROR = {
    "faulhaber_v3": 0x7300,
    "mclm": 0x4310,
    "epos4": 0x7320,
}  # of the sensor, of temperature: does not end by itself
INVALID = 1 << 31


def abort(act, *arguments):
    """The code with which a request is refused."""
    with pytest.raises(AbortedError) as found:
        act(*arguments)
    return found.value.code


def silent(bench, identifier, data, answer):
    """Whether a frame has no answer."""
    bench.frames(answer)
    bench.send(identifier, data)
    bench.go(5)
    return bench.frames(answer) == []


def alone(bench, kind, number):
    """PDO 1, 2 ... alone and invalid, with nothing mapped: all others are off."""
    start = {"rpdo": 0x1400, "tpdo": 0x1800}[kind]
    for one in range(4):
        identifier = bench.read(start + one, 1)
        bench.write(start + one, identifier | INVALID, 1)
    bench.write(start + 0x200 + number - 1, 0)
    return start + number - 1, bench.read(start + number - 1, 1)


def mapped(bench, kind, number, words, transmission):
    """A PDO with these objects and this transmission type, in use; its identifier."""
    index, identifier = alone(bench, kind, number)
    for place, word in enumerate(words, 1):
        bench.write(index + 0x200, word, place)
    bench.write(index + 0x200, len(words))
    bench.write(index, transmission, 2)
    bench.write(index, identifier & ~INVALID, 1)
    return identifier & 0x7FF


def valued(bench, index):
    """A value of an object of the application that differs from its default."""
    entry = bench.drive.dictionary.entry(index)
    return entry.default + 1 if entry.high is None or entry.default < entry.high else entry.default - 1


# ----------------------------------------------------------------------------------------------------------------- NMT


def test_boot_up_is_one_byte_of_zero(bench):
    """7.2.8.3.3, protocol boot-up."""
    assert bench.frames(0x700 + NODE) == [b"\0"]


def test_pre_operational_follows_by_itself(bench):
    """7.3.2, NMT state machine."""
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize(("command", "state"), [(1, 0x05), (2, 0x04), (128, 0x7F)])
def test_node_control(bench, command, state):
    """7.2.8.2.1, node control; the state is that of the heartbeat."""
    bench.nmt(command)
    bench.frames(0x700 + NODE)
    bench.write(0x1017, 10) if command != 2 else None
    bench.go(15)
    assert bench.drive.port.state == state
    if command != 2:
        assert bench.frames(0x700 + NODE)[0] == bytes([state])


@pytest.mark.parametrize("command", [129, 130])
def test_reset_ends_in_boot_up(bench, command):
    """7.2.8.2.1, reset node and reset communication."""
    bench.frames(0x700 + NODE)
    bench.nmt(command)
    bench.go(150)
    assert bench.frames(0x700 + NODE) == [b"\0"]


def test_all_nodes_are_node_0(bench):
    """7.2.8.3.1, protocols for node control."""
    bench.send(0, [1, 0])
    assert bench.drive.port.state is NmtState.OPERATIONAL


@pytest.mark.parametrize("data", [[1, NODE + 1], [7, NODE], [1], [1, NODE, 0], []])
def test_what_is_no_command_for_this_node_is_ignored(bench, data):
    """7.2.8.3.1: another node, an unknown command specifier, a wrong length."""
    bench.send(0, data)
    bench.go(150)
    assert bench.drive.port.state is NmtState.PRE_OPERATIONAL


def test_reset_communication_restores_communication_only(bench):
    """7.3.2.2.1.2, sub-state reset communication."""
    value = valued(bench, 0x6081)
    bench.write(0x6081, value)
    bench.write(0x1017, 50)
    bench.nmt(130)
    bench.go(150)
    assert (bench.read(0x6081), bench.read(0x1017)) == (value, 0)


def test_reset_node_restores_the_application_too(bench):
    """7.3.2.2.1.1, sub-state reset application."""
    default = bench.read(0x6081)
    bench.write(0x6081, valued(bench, 0x6081))
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == default


def test_stopped_has_no_sdo(bench):
    """7.3.2.2.5, NMT states and communication objects."""
    bench.nmt(2)
    assert silent(bench, 0x600 + NODE, struct.pack("<BHB4x", 0x40, 0x1000, 0), 0x580 + NODE)


def test_stopped_has_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "tpdo", 1, [0x60410010], 1)
    bench.nmt(1)
    bench.nmt(2)
    assert silent(bench, 0x080, b"", identifier)


def test_stopped_has_no_emcy(bench):
    """7.3.2.2.5."""
    bench.nmt(2)
    bench.emergencies()
    bench.drive.inject(next(iter(bench.profile.faults)))
    bench.go(5)
    assert bench.emergencies() == []


def test_stopped_has_a_heartbeat(bench):
    """7.3.2.2.5."""
    bench.write(0x1017, 10)
    bench.nmt(2)
    bench.frames(0x700 + NODE)
    bench.go(25)
    assert bench.frames(0x700 + NODE) == [b"\x04"] * 2


def test_pre_operational_has_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "tpdo", 1, [0x60410010], 1)
    assert silent(bench, 0x080, b"", identifier)


def test_pre_operational_takes_no_pdo(bench):
    """7.3.2.2.5."""
    identifier = mapped(bench, "rpdo", 1, [0x60810020], 255)
    before = bench.read(0x6081)
    bench.send(identifier, struct.pack("<I", before + 1))
    assert bench.read(0x6081) == before


# ------------------------------------------------------------------------------------------------------- error control


def test_heartbeat_has_its_time(bench):
    """7.2.8.3.2.2, protocol heartbeat; 7.5.2.20, 1017h."""
    bench.write(0x1017, 20)
    bench.frames(0x700 + NODE)
    bench.go(205)
    assert len(bench.frames(0x700 + NODE)) == 10


def test_heartbeat_of_0_ms_is_none(bench):
    """7.5.2.20, 1017h."""
    bench.write(0x1017, 20)
    bench.write(0x1017, 0)
    bench.frames(0x700 + NODE)
    bench.go(100)
    assert bench.frames(0x700 + NODE) == []


def test_a_consumer_waits_for_the_first_heartbeat(bench):
    """7.2.8.2.2.2: monitoring starts with the first one."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.go(300)
    assert bench.emergencies() == []


def test_a_missing_heartbeat_is_8130h(bench):
    """7.2.8.2.2.2, heartbeat event; 7.2.7.1, EMCY error codes."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.send(0x77F, [5])
    bench.go(45)
    assert bench.emergencies() == []
    bench.go(10)
    assert bench.emergencies() == [0x8130]


@pytest.mark.parametrize("value", [0x7F << 16, 50])
def test_a_consumer_without_node_or_time_is_none(bench, value):
    """7.5.2.19, 1016h."""
    bench.write(0x1016, value, 1)
    for node in (0x77F, 0x700):
        bench.send(node, [5]) if node != 0x700 else None
    bench.go(200)
    assert bench.emergencies() == []


def test_one_node_is_watched_by_one_consumer(bench):
    """7.5.2.19, 1016h: 06040043h."""
    if bench.read(0x1016) < 2:
        pytest.skip("one consumer")
    bench.write(0x1016, 5 << 16 | 50, 1)
    assert abort(bench.write, 0x1016, 5 << 16 | 60, 2) is Code.PARAMETER_INCOMPATIBLE


@pytest.mark.parametrize(("reaction", "state"), [(0, 0x7F), (1, 0x05), (2, 0x04)])
def test_error_behavior(bench, reaction, state):
    """7.5.2.32, 1029h.1."""
    bench.write(0x1016, 0x7F << 16 | 50, 1)
    bench.write(0x1029, reaction, 1)
    bench.nmt(1)
    bench.send(0x77F, [5])
    bench.go(100)
    assert bench.drive.port.state == state


def test_guarding_toggles_from_0(bench):
    """7.2.8.3.2.1, protocol node guarding."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.frames(0x700 + NODE)
    for _ in range(3):
        bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == [b"\x7f", b"\xff", b"\x7f"]


def test_guarding_begins_anew_after_a_reset(bench):
    """7.2.8.3.2.1: the toggle bit is 0 after reset communication."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.send(0x700 + NODE, remote=True, length=1)
    bench.nmt(130)
    bench.go(150)
    bench.frames(0x700 + NODE)
    bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == [b"\x7f"]


def test_a_heartbeat_producer_is_not_guarded(bench):
    """7.2.8.2.2: one of both at a time, heartbeat first."""
    bench.write(0x1017, 1000)
    bench.frames(0x700 + NODE)
    bench.send(0x700 + NODE, remote=True, length=1)
    assert bench.frames(0x700 + NODE) == []


def test_a_life_time_that_ends_is_8130h(bench):
    """7.2.8.2.2.1, life guarding; 100Ch, 100Dh."""
    if 0x100C not in bench.drive.dictionary:
        pytest.skip("no guarding")
    bench.write(0x100C, 20)
    bench.write(0x100D, 2)
    bench.go(100)
    assert bench.emergencies() == []
    bench.send(0x700 + NODE, remote=True, length=1)
    bench.go(50)
    assert bench.emergencies() == [0x8130]


# ----------------------------------------------------------------------------------------------------------------- SDO


def test_an_expedited_upload_tells_its_size(bench):
    """7.2.4.3.5, protocol SDO upload initiate."""
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x1000, 0))[:4] == bytes([0x43, 0x00, 0x10, 0])
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x1001, 0))[:1] == b"\x4f"
    assert bench.sdo(struct.pack("<BHB", 0x40, 0x6041, 0))[:1] == b"\x4b"


def segmented(bench, index, sub=0):
    """Text by a segmented upload."""
    answer = bench.sdo(struct.pack("<BHB", 0x40, index, sub))
    if answer[0] & 2:
        return answer[4 : 8 - (answer[0] >> 2 & 3)]
    size, data, toggle = struct.unpack_from("<I", answer, 4)[0], b"", 0
    while True:
        answer = bench.sdo(bytes([0x60 | toggle]))
        assert answer[0] & 0xF0 == toggle
        data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
        if answer[0] & 1:
            assert len(data) == size
            return data


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


# ----------------------------------------------------------------------------------------------------------------- PDO


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


# ---------------------------------------------------------------------------------------------------------------- SYNC


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


# ---------------------------------------------------------------------------------------------------------------- EMCY


def test_an_emergency_has_code_register_and_8_bytes(bench):
    """7.2.7.3.1, protocol EMCY write."""
    code = ERROR[bench.profile.name]
    bench.drive.inject(code)
    bench.go(2)
    (data,) = bench.frames(0x80 + NODE)
    assert (len(data), struct.unpack_from("<H", data)[0]) == (8, code)
    assert data[2] == bench.read(0x1001)


def test_the_error_register_tells_a_generic_error_with_every_error(bench):
    """7.5.2.2, 1001h: bit 0 at any error situation."""
    missing = []
    for code in bench.profile.faults:
        bench.drive.inject(code)
        if not bench.drive.dictionary.get(0x1001) & 1:
            missing.append(f"{code:04X}")
        bench.drive.power_on()
    assert missing == []


def test_the_error_register_tells_an_error_that_is_masked(make):
    """7.5.2.2, 1001h: also where the vendor's mask keeps the EMCY back."""
    bench = make("mclm")
    bench.write(0x2321, 0, 1)
    bench.drive.inject(ERROR["mclm"])
    bench.go(1)
    assert bench.emergencies() == []
    assert bench.read(0x1001) & 1


def test_the_error_register_keeps_what_is_left(bench):
    """7.2.7.1, emergency state transitions: of two errors one is gone."""
    bench.drive.inject(0x8611)
    bench.drive.inject(0x3210, lasting=True)
    bench.go(1)
    bench.go(200)
    bench.control(0x00, 0x80)
    assert bench.drive.active.keys() == {0x3210}
    assert bench.read(0x1001) == bench.profile.faults[0x3210].register | 1


def test_the_end_of_errors_is_told(bench):
    """7.2.7.1: error code 0000h, register 0."""
    bench.drive.inject(ERROR[bench.profile.name])
    bench.go(300)
    bench.frames(0x80 + NODE)
    bench.control(0x00, 0x80)
    bench.go(2)
    assert bench.frames(0x80 + NODE) == [bytes(8)]
    assert bench.read(0x1001) == 0


def test_the_history_has_the_newest_first(bench):
    """7.5.2.4, 1003h."""
    bench.drive.inject(0x8611)
    bench.drive.inject(0x3210)
    bench.go(2)
    assert bench.read(0x1003) == 2
    assert [bench.read(0x1003, sub) & 0xFFFF for sub in (1, 2)] == [0x3210, 0x8611]


def test_the_history_is_cleared_by_0_only(bench):
    """7.5.2.4: other values 06090030h, subindices are read only."""
    bench.drive.inject(0x8611)
    bench.go(2)
    assert abort(bench.write, 0x1003, 1) is Code.VALUE_RANGE
    assert abort(bench.write, 0x1003, 0, 1) is Code.READ_ONLY
    bench.write(0x1003, 0)
    assert bench.read(0x1003) == 0


def test_an_empty_history_has_no_entries(bench):
    """7.5.2.4: 08000024h or 08000000h where no error is present."""
    assert bench.read(0x1003) == 0
    assert abort(bench.read, 0x1003, 1) is Code.NO_DATA
    bench.drive.inject(0x8611)
    bench.go(2)
    bench.read(0x1003, 1)
    assert abort(bench.read, 0x1003, 2) is Code.NO_DATA


def test_the_identifier_of_an_emergency(bench):
    """7.5.2.17, 1014h: the default, and no change while in use."""
    assert bench.read(0x1014) == 0x80 + NODE
    assert abort(bench.write, 0x1014, 0x93) in (Code.VALUE_RANGE, Code.READ_ONLY)


# ------------------------------------------------------------------------------------------------- device, parameters


def test_mandatory_objects(bench):
    """7.4.2: 1000h, 1001h, 1018h and one kind of error control."""
    assert {0x1000, 0x1001, 0x1017, 0x1018} <= bench.drive.dictionary.objects.keys()


def test_the_device_profile_is_402(bench):
    """7.5.2.1, 1000h: the profile's number in bits 0 to 15."""
    assert bench.read(0x1000) & 0xFFFF == 402


def test_the_identity(bench):
    """7.5.2.21, 1018h: 1 to 4 subindices, a vendor."""
    assert 1 <= bench.read(0x1018) <= 4
    assert bench.read(0x1018, 1) != 0


@pytest.mark.parametrize(("index", "signature"), [(0x1010, SAVE), (0x1011, LOAD)])
def test_signatures(bench, index, signature):
    """7.5.2.13 and 7.5.2.14: 1010h and 1011h."""
    assert bench.read(index, 1) & 1
    assert abort(bench.write, index, 0x12345678, 1) is Code.CANNOT_STORE
    bench.write(index, signature, 1)
    assert bench.read(index, 1) & 1


def test_defaults_act_at_the_next_reset(bench):
    """7.5.2.14, 1011h."""
    default, value = bench.read(0x6081), valued(bench, 0x6081)
    bench.write(0x6081, value)
    bench.write(0x1010, SAVE, 1)
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == value
    bench.write(0x1011, LOAD, 1)
    assert bench.read(0x6081) == value
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == default


def test_the_mode_may_be_written_in_every_state_of_nmt_that_has_sdo(bench):
    """7.3.2.2.5: SDO in Pre-operational and Operational."""
    for command in (128, 1):
        bench.nmt(command)
        bench.write(0x6060, Mode.PV)
        bench.go(2)
        assert bench.read(0x6061) == Mode.PV


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
