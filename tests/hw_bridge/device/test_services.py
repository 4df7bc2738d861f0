"""Services of a slave in numbers: identifiers, heartbeats, guarding, emergencies, transfers and stored values."""

import struct

import pytest

from hw_bridge.bus import Frame
from hw_bridge.device.port import check_identifier
from hw_bridge.device.sdo import SdoServer
from hw_bridge.dictionary import I16, OCTETS, TEXT, U8, U32, Abort, Code, Dictionary, NmtState, var
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import Turned

START, STOP, PRE_OPERATIONAL = b"\1\1", b"\2\1", b"\x80\1"
HEARTBEAT_CONSUMER = {"x1016_1": 0x7F << 16 | 50}  # of node 127, 50 ms


def sent(turned, identifier):
    """Data of the frames sent with an identifier, and forget all."""
    data = [frame.data for frame in turned.sent if frame.id == identifier]
    turned.sent.clear()
    return data


def aborts(turned, *arguments):
    with pytest.raises(Abort) as aborted:
        turned.write(*arguments)
    return aborted.value.code


# restricted CAN-IDs of CiA 301, table 41: 000h, 001h to 07Fh, 101h to 180h, 581h to 5FFh, 601h to 67Fh, 6E0h to 6FFh, 701h on
@every_case(
    "identifiers",
    [
        (0x000, 0x001, 0x07F),
        (0x101, 0x180),
        (0x581, 0x5FF),
        (0x601, 0x67F),
        (0x6E0, 0x6FF),
        (0x701, 0x7FF),
        (0x880, 1 << 29 | 0x80),
    ],
)
def test_restricted_identifiers(identifiers):
    for identifier in identifiers:
        with pytest.raises(Abort) as aborted:
            check_identifier(identifier)
        assert aborted.value.code is Code.VALUE_RANGE


def test_free_identifiers():
    for identifier in (0x080, 0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700, 1 << 31 | 0x181, 1 << 30 | 0x181):
        check_identifier(identifier)


# --------------------------------------------------------------------------------------------------------------- NMT


def test_boot_up_and_heartbeats():
    turned = Turned()
    booted = [frame for frame in turned.sent if frame.id == 0x701]
    assert booted == [Frame(0x701, b"\0")]
    turned.sent.clear()
    turned.write(0x1017, 20)  # the first one at once
    assert sent(turned, 0x701) == [b"\x7f"]
    turned.go(19)
    assert sent(turned, 0x701) == []
    turned.go(1)
    assert sent(turned, 0x701) == [b"\x7f"]
    turned.drive.nmt.command(START)
    turned.go(40)
    assert sent(turned, 0x701) == [b"\5"] * 2
    turned.write(0x1017, 0)
    turned.go(100)
    assert sent(turned, 0x701) == []


def test_a_stored_heartbeat_begins_after_boot_up():
    turned = Turned(x1017=30)
    turned.write(0x1010, 0x65766173, 1)
    turned.drive.restart()
    turned.sent.clear()
    turned.go(100 + 59)
    assert sent(turned, 0x701) == [b"\0", b"\x7f"]


@every_case(
    ("data", "state"),
    [
        (b"\1\1", NmtState.OPERATIONAL),
        (b"\1\0", NmtState.OPERATIONAL),
        (b"\2\1", NmtState.STOPPED),
        (b"\1\2", NmtState.PRE_OPERATIONAL),
        (b"\1", NmtState.PRE_OPERATIONAL),
        (b"\3\1", NmtState.PRE_OPERATIONAL),
        (b"\x81\1", NmtState.INITIALIZING),
        (b"\x82\0", NmtState.INITIALIZING),
    ],
)
def test_commands(data, state):
    turned = Turned()
    turned.drive.receive(Frame(0, data))
    assert turned.drive.port.state is state


def test_no_command_while_it_boots():
    turned = Turned()
    turned.drive.restart()
    turned.drive.receive(Frame(0, START))
    turned.go(99)
    assert turned.drive.port.state is NmtState.INITIALIZING
    turned.go(1)
    assert turned.drive.port.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize(("silence", "is_lost"), [(49, False), (50, True)])
def test_a_heartbeat_that_stays_away(silence, is_lost):
    turned = Turned("epos4", **HEARTBEAT_CONSUMER)
    turned.drive.nmt.command(START)
    turned.go(200)
    assert not turned.drive.active  # it waits for the first one
    for _ in range(3):
        turned.drive.receive(Frame(0x77F, b"\5"))
        turned.go(40)
    turned.drive.receive(Frame(0x77E, b"\5"))  # of another node
    turned.go(silence - 40)
    assert (0x8130 in turned.drive.active) is is_lost
    assert turned.drive.port.state is (NmtState.PRE_OPERATIONAL if is_lost else NmtState.OPERATIONAL)  # 1029h.1 is 0


@every_case(
    ("reaction", "before", "after"),
    [
        (0, NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (0, NmtState.STOPPED, NmtState.STOPPED),
        (1, NmtState.OPERATIONAL, NmtState.OPERATIONAL),
        (2, NmtState.OPERATIONAL, NmtState.STOPPED),
        (2, NmtState.PRE_OPERATIONAL, NmtState.STOPPED),
    ],
)
def test_the_state_after_a_communication_error(reaction, before, after):
    turned = Turned("epos4", x1029_1=reaction)
    turned.drive.nmt.enter(before)
    turned.drive.nmt.react()
    assert turned.drive.port.state is after


@every_case(
    ("value", "code"),
    [
        (0x7F << 16 | 100, None),
        (0x80 << 16 | 100, Code.VALUE_RANGE),
        (0x05 << 16 | 100, Code.PARAMETER_INCOMPATIBLE),  # is watched by subindex 1
        (0x05 << 16, None),  # a time of 0 watches nothing
        (0x06 << 16 | 1, None),
        (0, None),
    ],
)
def test_consumers_of_heartbeats(value, code):
    turned = Turned("epos4", x1016_1=0x05 << 16 | 50)
    if code is None:
        turned.write(0x1016, value, 2)
        watched = {5} | ({value >> 16} if value & 0xFFFF else set())
        assert {*turned.drive.nmt.consumers} == watched
        turned.drive.nmt.process_heartbeat(value >> 16)
    else:
        assert aborts(turned, 0x1016, value, 2) is code
    turned.write(0x1016, 0x05 << 16 | 70, 1)  # its own entry may be changed


def test_guarding_toggles_and_has_a_life_time():
    turned = Turned()
    request = Frame(0x701, remote=True, length=1)
    turned.drive.nmt.command(START)
    turned.sent.clear()
    for expected in (b"\x05", b"\x85", b"\x05"):
        turned.drive.receive(request)
        assert sent(turned, 0x701) == [expected]
    turned.write(0x100C, 20)
    turned.write(0x100D, 3)
    turned.drive.receive(request)
    turned.go(59)
    assert not turned.drive.active
    turned.drive.receive(request)
    turned.go(59)
    assert not turned.drive.active
    turned.go(1)
    assert 0x8130 in turned.drive.active
    turned.write(0x1017, 10)  # the heartbeat has precedence
    sent(turned, 0x701)
    turned.drive.receive(request)
    assert sent(turned, 0x701) == []


# ------------------------------------------------------------------------------------------------------- emergencies


def test_emergencies_where_and_when_they_are_sent():
    turned = Turned()
    emergency = turned.drive.emergency
    for state, is_sent in ((NmtState.PRE_OPERATIONAL, True), (NmtState.OPERATIONAL, True), (NmtState.STOPPED, False)):
        turned.drive.port.state = state
        turned.sent.clear()
        emergency.report(0x1234, 0x20, b"\xab\xcd")
        assert sent(turned, 0x81) == [b"\x34\x12\x21\xab\xcd\0\0\0"] * is_sent
    turned.drive.port.state = NmtState.OPERATIONAL
    turned.drive.port.online = False
    emergency.report(1, 0)
    assert sent(turned, 0x81) == []
    turned.drive.port.online = True
    turned.write(0x1014, 0x80000081)
    emergency.report(1, 0)
    assert turned.sent == []
    turned.write(0x1014, 0x90)
    emergency.clear()
    emergency.clear(is_reported=False)
    assert (sent(turned, 0x90), turned.read(0x1001)) == ([bytes(8)], 0)


def test_the_history_of_errors():
    turned = Turned("epos4")
    for code in range(1, 8):
        turned.drive.emergency.report(code, 0)
    assert [turned.read(0x1003, sub) for sub in range(6)] == [5, 7, 6, 5, 4, 3]
    upload = turned.drive.dictionary.upload
    assert upload(0x1003, 5) == b"\3\0\0\0"
    assert (aborts(turned, 0x1003, 1), aborts(turned, 0x1003, 0, 1)) == (Code.VALUE_RANGE, Code.READ_ONLY)
    turned.write(0x1003, 0)
    assert [turned.read(0x1003, sub) for sub in range(6)] == [0] * 6
    assert upload(0x1003, 0) == b"\0"
    with pytest.raises(Abort) as aborted:
        upload(0x1003, 1)
    assert aborted.value.code is Code.NO_DATA


# --------------------------------------------------------------------------------------------------------- transfers

LONG = bytes(range(1, 16))


def server(content=""):
    return SdoServer(
        Dictionary(
            (
                *var(0x2000, "", I16, "rw", -2),
                *var(0x2001, "", TEXT, "rw", content),
                *var(0x2002, "", OCTETS, "rw", ""),
                *var(0x2003, "", U32, "rw", 7),
                *var(0x2004, "", U8, "rw"),
            ),
            1,
        )
    )


@every_case(
    ("request_", "answer"),
    [
        ("4000200000000000", "4b002000feff0000"),
        ("4003200000000000", "4303200007000000"),
        ("4004200000000000", "4f04200000000000"),
        ("2b00200005000000", "6000200000000000"),
        ("2200200005000000", "6000200000000000"),  # without a size: that of the type
        ("2f04200005000000", "6004200000000000"),
        ("2104200001000000", "6004200000000000"),
        ("2104200002000000", "8004200012000706"),  # too long
        ("2100200001000000", "8000200013000706"),  # too short
        ("2101200079030000", "6001200000000000"),  # 889 bytes
        ("210120007a030000", "8001200005000405"),
        ("2001200000000000", "6001200000000000"),
        ("8000200000000000", None),
        ("40002000000000", None),
        ("a000200000000000", "8000200001000405"),
    ],
)
def test_requests_and_their_answers(request_, answer):
    found = server().answer(bytes.fromhex(request_))
    assert (found and found.hex()) == answer


@every_case("length", [0, 1, 3, 4, 5, 6, 7, 8, 13, 14, 15])
def test_an_upload_of_any_length(length):
    content = LONG[:length]
    sdo = server(content.decode("latin-1"))
    answer = sdo.answer(bytes.fromhex("4001200000000000"))
    if 1 <= length <= 4:
        assert answer == bytes([0x43 | (4 - length) << 2, 1, 0x20, 0]) + content.ljust(4, b"\0")
        assert sdo.transfer is None
        return
    assert answer == struct.pack("<BHBI", 0x41, 0x2001, 0, length)
    toggle = 0
    for begin in range(0, max(length, 1), 7):
        part = content[begin : begin + 7]
        last = begin + 7 >= length
        assert sdo.answer(bytes([0x60 | toggle]).ljust(8, b"\0")) == bytes(
            [toggle | (7 - len(part)) << 1 | last]
        ) + part.ljust(7, b"\0")
        toggle ^= 0x10
    assert (
        sdo.answer(bytes([0x60 | toggle]).ljust(8, b"\0")).hex() == "8000000001000405"
    )  # there is no transfer any more


@every_case("length", [1, 6, 7, 8, 14, 15])
@every_case("announced", [True, False])
def test_a_download_of_any_length(length, announced):
    sdo, content = server(), LONG[:length]
    assert sdo.answer(struct.pack("<BHBI", 0x20 | announced, 0x2001, 0, length * announced)).hex() == "6001200000000000"
    toggle = 0
    for begin in range(0, length, 7):
        part = content[begin : begin + 7]
        last = begin + 7 >= length
        request = bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\xee")
        assert sdo.answer(request) == bytes([0x20 | toggle]).ljust(8, b"\0")
        toggle ^= 0x10
    assert sdo.dictionary.values[0x2001, 0] == content.decode("latin-1")
    assert sdo.transfer is None


@pytest.mark.parametrize(("length", "code"), [(7, "13000706"), (9, "12000706")])
def test_a_download_of_another_length_than_announced(length, code):
    sdo = server()
    sdo.answer(struct.pack("<BHBI", 0x21, 0x2001, 0, 8))
    first = bytes([0x00 if length > 7 else 0x01]) + LONG[:7]
    answers = [sdo.answer(first)] + (
        [sdo.answer(bytes([0x10 | (14 - length) << 1 | 1]) + LONG[7:14])] if length > 7 else []
    )
    assert answers[-1].hex() == "80012000" + code
    assert sdo.dictionary.values[0x2001, 0] == ""


def test_toggles_and_kinds_of_segments():
    sdo = server("a text of many bytes")
    sdo.answer(bytes.fromhex("4001200000000000"))
    assert sdo.answer(b"\x70".ljust(8, b"\0")).hex() == "8001200000000305"  # the first segment has toggle 0
    sdo.answer(bytes.fromhex("4001200000000000"))
    assert sdo.answer(b"\x01".ljust(8, b"\0")).hex() == "8001200001000405"  # a download segment in an upload
    assert sdo.transfer is None


def test_a_download_without_a_length_ends_at_889_bytes():
    sdo = server()
    sdo.answer(bytes.fromhex("2001200000000000"))
    toggle = 0
    for _ in range(127):
        assert sdo.answer(bytes([toggle]) + bytes(7)) == bytes([0x20 | toggle]).ljust(8, b"\0")
        toggle ^= 0x10
    assert sdo.answer(bytes([toggle]) + bytes(7)).hex() == "8001200005000405"


# ------------------------------------------------------------------------------------------------------ stored values


@pytest.mark.parametrize(("sub", "kept"), [(1, {0x1017, 0x6081}), (2, {0x1017}), (3, {0x6081}), (None, set())])
def test_groups_of_values_are_stored_and_restored(sub, kept):
    turned = Turned(x1017=50, x6081=77, x607A=1234, x6040=0)
    if sub:
        turned.write(0x1010, 0x65766173, sub)
        assert turned.read(0x1010, sub) == 1
    turned.drive.restart()
    turned.go(110)
    values = {0x1017: (50, 0), 0x6081: (77, 1000), 0x607A: (0, 0)}  # a target is never stored
    assert {index: turned.read(index) for index in values} == {
        index: value if index in kept else default for index, (value, default) in values.items()
    }
    turned.write(0x1011, 0x64616F6C, 2)  # communication, at the next reset
    assert turned.read(0x1017) == (50 if 0x1017 in kept else 0)
    turned.drive.restart()
    assert (turned.read(0x1017), turned.read(0x6081)) == (0, 77 if 0x6081 in kept else 1000)


def test_reset_communication_takes_back_communication_only():
    turned = Turned(x1017=50, x6081=77)
    turned.drive.receive(Frame(0, b"\x82\1"))
    assert (turned.read(0x1017), turned.read(0x6081)) == (0, 77)


def test_other_words_store_nothing():
    turned = Turned()
    assert aborts(turned, 0x1010, 0x64616F6C, 1) is Code.CANNOT_STORE
    assert aborts(turned, 0x1011, 0x65766173, 1) is Code.CANNOT_STORE
