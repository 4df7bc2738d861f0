"""The SDO server: right values, right abort codes, and no request that breaks it."""

import struct

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hw_bridge.device.sdo import SdoServer
from hw_bridge.dictionary import I16, TEXT, U8, Code, Dictionary, record, sub, var
from hw_bridge.profiles import DRIVE_PROFILES, profile
from tests.every_case import every_case

ENTRIES = (
    *var(0x2000, "Range", I16, "rw", 5, -10, 10),
    *var(0x2001, "Constant", U8, "const", 1),
    *var(0x2002, "Write only", U8, "wo"),
    *var(0x2003, "Long text", TEXT, "rw", "a text of more than four bytes"),
    *record(0x2010, "Record", sub(1, "One", U8, "rw", 7)),
)


def server():
    return SdoServer(Dictionary(ENTRIES, 1))


def request(command, index=0, sub=0, data=b""):
    return (struct.pack("<BHB", command, index, sub) + data).ljust(8, b"\0")


def aborted(answer):
    assert answer[0] == 0x80
    return Code(struct.unpack_from("<I", answer, 4)[0])


@every_case(
    ("asked", "code"),
    [
        (request(0x40, 0x3000), Code.NO_OBJECT),
        (request(0x40, 0x2010, 9), Code.NO_SUBINDEX),
        (request(0x40, 0x2000, 1), Code.NO_SUBINDEX),
        (request(0x40, 0x2002), Code.WRITE_ONLY),
        (request(0x2F, 0x2001, 0, b"\2"), Code.READ_ONLY),
        (request(0x2F, 0x2010, 0, b"\2"), Code.READ_ONLY),
        (request(0x2B, 0x2000, 0, struct.pack("<h", 11)), Code.VALUE_TOO_HIGH),
        (request(0x2B, 0x2000, 0, struct.pack("<h", -11)), Code.VALUE_TOO_LOW),
        (request(0x23, 0x2000, 0, struct.pack("<i", 1)), Code.TOO_LONG),
        (request(0x2F, 0x2000, 0, b"\1"), Code.TOO_SHORT),
        (request(0x21, 0x2000, 0, struct.pack("<I", 3)), Code.TOO_LONG),
        (request(0x21, 0x2003, 0, struct.pack("<I", 100000)), Code.MEMORY),
        (request(0xA0, 0x2000), Code.COMMAND_UNKNOWN),  # block upload
        (request(0xC0, 0x2000), Code.COMMAND_UNKNOWN),  # block download
        (request(0xE0, 0x2000), Code.COMMAND_UNKNOWN),
        (request(0x60), Code.COMMAND_UNKNOWN),  # a segment of nothing
        (request(0x00), Code.COMMAND_UNKNOWN),
    ],
)
def test_refusals(asked, code):
    assert aborted(server().answer(asked)) is code


def test_expedited():
    one = server()
    assert one.answer(request(0x40, 0x2000)) == request(0x4B, 0x2000, 0, b"\5\0")
    assert one.answer(request(0x2B, 0x2000, 0, struct.pack("<h", -7))) == request(0x60, 0x2000)
    assert one.answer(request(0x22, 0x2000, 0, struct.pack("<h", 3))) == request(0x60, 0x2000)  # length not told
    assert one.dictionary.get(0x2000) == 3


def segments(text):
    return [text[start : start + 7] for start in range(0, len(text), 7)]


@pytest.mark.slow
@given(st.text(st.characters(codec="latin-1"), min_size=1, max_size=60))
def test_segmented_transfers_there_and_back(text):
    one = server()
    data = text.encode("latin-1")
    assert one.answer(request(0x21, 0x2003, 0, struct.pack("<I", len(data))))[0] == 0x60
    for number, part in enumerate(segments(data)):
        last = 7 * (number + 1) >= len(data)
        asked = bytes([0x10 * (number % 2) | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0")
        assert one.answer(asked)[0] == 0x20 | 0x10 * (number % 2)
    answer = one.answer(request(0x40, 0x2003))
    if len(data) <= 4:
        assert answer[4 : 8 - (answer[0] >> 2 & 3)] == data
        return
    assert struct.unpack_from("<I", answer, 4)[0] == len(data)
    got, toggle = b"", 0
    while True:
        answer = one.answer(request(0x60 | toggle))
        assert answer[0] & 0x10 == toggle
        got += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
        if answer[0] & 1:
            break
    assert got == data


def test_toggle_error_and_length_error():
    one = server()
    one.answer(request(0x40, 0x2003))
    assert aborted(one.answer(request(0x70))) is Code.TOGGLE
    one.answer(request(0x21, 0x2003, 0, struct.pack("<I", 3)))
    assert aborted(one.answer(b"\x01abcdefg")) is Code.TOO_LONG


SERVERS = {name: SdoServer(Dictionary(profile(name).objects, 3)) for name in DRIVE_PROFILES}


@pytest.mark.slow
@settings(max_examples=300)
@given(
    name=st.sampled_from(list(DRIVE_PROFILES)),
    requests=st.lists(
        st.one_of(
            st.binary(min_size=0, max_size=8),
            st.builds(
                request,
                st.sampled_from([0x40, 0x60, 0x70, 0x2F, 0x2B, 0x23, 0x21, 0x00, 0x10, 0x80, 0xA0, 0xC0]),
                st.sampled_from(sorted({entry.index for name in DRIVE_PROFILES for entry in profile(name).objects})),
                st.integers(0, 12),
                st.binary(max_size=4),
            ),
        ),
        max_size=10,
    ),
)
@example("epos4", [b"", b"\x40"])
def test_random_requests(name, requests):
    one = SERVERS[name]
    for asked in requests:
        before = dict(one.dictionary.values)
        answer = one.answer(asked)
        if len(asked) != 8 or asked[0] >> 5 == 4:
            assert answer is None
            continue
        assert len(answer) == 8
        if answer[0] == 0x80:
            aborted(answer)
            assert one.dictionary.values == before
    for entry in one.dictionary.entries():
        value = one.dictionary.values[entry.index, entry.sub]
        entry.encode(value)
        if entry.writable:
            entry.check(value)
        else:
            assert value == one.dictionary.defaults()[entry.index, entry.sub]


@every_case(
    "index",
    [0x6072, 0x6074, 0x6075, 0x6078, 0x6079, 0x607C, 0x607E, 0x608F, 0x6091, 0x6092, 0x60C1, 0x60C6, 0x605D, 0x1006,
     0x1009, 0x100A, 0x100C, 0x100D, 0x1015, 0x1019],
)  # fmt: skip
def test_epos4_lacks_what_others_have(index):
    assert aborted(SERVERS["epos4"].answer(request(0x40, index))) is Code.NO_OBJECT


@every_case("index", [0x6007, *range(0x605A, 0x605F), 0x6065, 0x6066, 0x6071, 0x6077, 0x60C2, 0x1006])
def test_mclm_lacks_what_others_have(index):
    assert aborted(SERVERS["mclm"].answer(request(0x40, index))) is Code.NO_OBJECT


def test_epos4_names_its_homing_methods():
    """A host looks there before it writes 6098h."""
    dictionary = Dictionary(profile("epos4").objects, 1)
    told = [dictionary.get(0x60E3, sub) for sub in range(1, dictionary.get(0x60E3) + 1)]
    assert told == [-4, -3, -2, -1, 1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37]
    assert set(told) == set(profile("epos4").homing)
