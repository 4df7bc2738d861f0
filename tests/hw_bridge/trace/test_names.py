"""Texts and values of single frames, words and objects in a trace."""

import struct

import pytest

from hw_bridge.bus import Frame
from hw_bridge.dictionary import I8, I16, I32, TEXT, U8, U16, U32, record, sub, var
from hw_bridge.profiles import profile
from hw_bridge.trace import Decoder, TracedNode, names
from hw_bridge.trace.traced_node import Route, common, snake
from hw_bridge.trace.transfer import Transfer, expedited
from tests.every_case import every_case


@every_case(
    ("code", "text"),
    [
        (0x0000, "no error"),
        (0x1000, "generic"),
        (0x2310, "current, output side"),
        (0x2410, "current"),
        (0x3210, "voltage inside the device"),
        (0x3910, "voltage"),
        (0x4310, "temperature"),
        (0x5530, "device hardware"),
        (0x6320, "data set"),
        (0x7300, "additional modules"),
        (0x8130, "communication"),
        (0x8250, "protocol"),
        (0x8611, "monitoring"),
        (0x9000, "external"),
        (0xF123, "additional functions"),
        (0xFF01, "device specific"),
        (0xA000, "unknown"),
    ],
)
def test_classes_of_emergencies(code, text):
    assert names.emergency(code) == text


@pytest.mark.parametrize(
    ("word", "text"),
    [
        (0x0040, "Switch on disabled"),
        (0x0637, "Operation enabled, target reached"),
        (0x38B7, "Operation enabled, warning, internal limit, bit 12, bit 13"),
        (0x0008, "Fault"),
    ],
)
def test_statuswords(word, text):
    assert names.statusword(word) == text


@every_case(
    ("word", "text"),
    [
        (0x0006, "Shutdown"),
        (0x0080, "Fault reset"),
        (0x000F, "Enable operation"),
        (0x017F, "Enable operation, new set-point, immediately, relative, halt"),
        (0x0003, "Quick stop"),
        (0x0000, "Disable voltage"),
    ],
)
def test_controlwords(word, text):
    assert names.controlword(word) == text


def test_modes_and_states():
    assert [names.mode(value) for value in (0, 1, 3, 6, 8, 9, 10, 7)] == [
        "none",
        "pp",
        "pv",
        "hm",
        "csp",
        "csv",
        "cst",
        "unknown",
    ]
    states = [names.nmt_state(value) for value in (0, 4, 5, 0x7F, 6)]
    assert states == ["boot-up", "stopped", "operational", "pre-operational", "unknown state 06h"]


def test_names_as_keys():
    assert [snake(name) for name in ("Position actual value", "I2t level [%]", "A-B  c")] == [
        "position_actual_value",
        "i2t_level",
        "a_b_c",
    ]


EMPTY = Decoder([TracedNode(5, profile("epos4"), name="axis")])


@every_case(
    ("identifier", "data", "node", "service", "text", "notable"),
    [
        (0x000, b"\x01\x05", 5, "NMT", "axis: start", True),
        (0x000, b"\x02\x00", 0, "NMT", "all nodes: stop", True),
        (0x000, b"\x80\x06", 6, "NMT", "node 6: enter pre-operational", True),
        (0x000, b"\x82\x05", 5, "NMT", "axis: reset communication", True),
        (0x000, b"\x07\x05", 5, "NMT", "axis: unknown command 07h", True),
        (0x000, b"\x01", 0, "NMT", "command of 1 bytes, 2 expected", True),
        (0x080, b"", 0, "SYNC", "", False),
        (0x080, b"\x03", 0, "SYNC", "counter 3", False),
        (0x100, b"", 0, "TIME", "time stamp", False),
        (0x081, bytes(8), 1, "EMCY", "node 1: 0000h no error; register none", True),
        (
            0x085,
            b"\x20\x73\x81\0\0\0\0\0",
            5,
            "EMCY",
            "axis: 7320h position sensor; register generic, manufacturer",
            True,
        ),
        (
            0x085,
            b"\x00\xff\x01\1\0\0\0\2",
            5,
            "EMCY",
            "axis: FF00h device specific (class of CiA 301); register generic; vendor 01 00 00 00 02",
            True,
        ),
        (0x0FF, b"\x30\x81\x11", 0x7F, "EMCY", "node 127: 3 bytes, 8 expected", True),
        (0x705, b"\x00", 5, "HEARTBEAT", "axis: boot-up", True),
        (0x705, b"\x05", 5, "HEARTBEAT", "axis: operational", False),
        (0x705, b"\x85", 5, "HEARTBEAT", "axis: operational", False),
        (0x705, b"", 5, "GUARD", "axis: state requested", False),
        (0x77F, b"\x04", 0x7F, "HEARTBEAT", "node 127: stopped", False),
        (0x181, b"", 1, "PDO", "node 1 TPDO1: mapping not in the trace", False),
        (0x2FF, b"", 0x7F, "PDO", "node 127 TPDO2: mapping not in the trace", False),
        (0x201, b"", 1, "PDO", "node 1 RPDO1: mapping not in the trace", False),
        (0x57F, b"", 0x7F, "PDO", "node 127 RPDO4: mapping not in the trace", False),
        (0x205, b"\x06\0", 5, "PDO", "axis RPDO1: Controlword 0006h Shutdown", False),
        (0x205, b"\x06", 5, "PDO", "axis RPDO1: 1 bytes, the mapping has 2", True),
        (0x180, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x101, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x700, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x780, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x605, b"\x40\0\x10\0\0\0\0\0", 5, "SDO", "axis: read 1000h.0 Device type", False),
        (0x585, b"\x80\0\x10\0\0\0\2\6", 5, "SDO", "axis: abort 1000h.0 Device type: 06020000h no object", True),
        (0x67F, b"\x40\0\x10\0\0\0\0\0", 0x7F, "SDO", "node 127: read 1000h.0 Device type", False),
        (0x580, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x600, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
        (0x7E5, b"", 0, "OTHER", "no identifier of CANopen's predefined connection set", False),
    ],
)
def test_frames_by_their_identifier(identifier, data, node, service, text, notable):
    frame = Frame(identifier, data)
    line = EMPTY.decode(7, frame)
    assert (line.time, line.frame, line.node, line.service, line.text, line.notable) == (
        7,
        frame,
        node,
        service,
        text,
        notable,
    )


def test_remote_frames_and_errors():
    decoder = Decoder([TracedNode(5, profile("epos4"))])
    guard = decoder.decode(1, Frame(0x705, remote=True, length=1))
    assert (guard.service, guard.text, guard.notable) == ("GUARD", "node 5: state requested", False)
    request = decoder.decode(1, Frame(0x185, remote=True, length=2))
    assert (request.service, request.text, request.values) == ("PDO", "node 5 TPDO1: requested", {})
    error, other = decoder.error(3), decoder.error(4, "CAN FD")
    assert (error.service, error.text, error.frame, error.node, error.notable) == (
        "ERROR",
        "error frame",
        None,
        0,
        True,
    )
    assert (other.service, other.text) == ("OTHER", "CAN FD")


def test_a_brief_decoder_tells_changes_of_state_only():
    decoder = Decoder([TracedNode(5, profile("epos4"))], brief=True)
    words = (0x0250, 0x0250, 0x0231, 0x1231, 0x0237)
    lines = [decoder.decode(0, Frame(0x185, struct.pack("<H", word))) for word in words]
    assert [line.notable for line in lines] == [False, False, True, False, True]
    assert [line.text for line in lines] == [
        "node 5 TPDO1: ",
        "node 5 TPDO1: ",
        "node 5 TPDO1: Statusword 0231h Ready to switch on",
        "node 5 TPDO1: ",
        "node 5 TPDO1: Statusword 0237h Operation enabled",
    ]


@pytest.mark.parametrize(("command", "application"), [(0x81, True), (0x82, False)])
@pytest.mark.parametrize("node", [5, 0])
def test_a_reset_takes_back_what_it_resets(command, application, node):
    party = TracedNode(5, profile("epos4"))
    decoder = Decoder([party])
    party.learn(0x6081, 0, struct.pack("<I", 7))
    party.learn(0x1017, 0, b"\x32\0")
    party.learn(0x1400, 1, struct.pack("<I", 0x305))
    assert 0x305 in party.routes
    decoder.decode(0, Frame(0, bytes([command, node])))
    assert party.dictionary.get(0x6081) == 7  # until it has booted
    decoder.decode(1, Frame(0x705, b"\0"))
    assert (party.dictionary.get(0x6081), party.dictionary.get(0x1017)) == (1000 if application else 7, 0)
    assert 0x205 in party.routes
    party.learn(0x6081, 0, struct.pack("<I", 7))
    decoder.decode(2, Frame(0x705, b"\0"))  # a boot-up that nothing asked for: power was lost
    assert party.dictionary.get(0x6081) == 1000


# ----------------------------------------------------------------------------------------------------------- objects

RANGE = record(0x2010, "Range", sub(1, "Low [mm]", I16, "rw"))
ROWS = {
    entry.index: entry
    for entry in (
        *var(0x6064, "Position actual value", I32, "ro"),
        *var(0x6041, "Statusword", U16, "ro"),
        *var(0x6061, "Mode", I8, "ro"),
        *var(0x603F, "Error code", U16, "ro"),
        *var(0x1001, "Error register", U8, "ro"),
        *var(0x1018, "Number", U32, "ro"),
        *var(0x1008, "Name", TEXT, "ro"),
        *var(0x2334, "Current limit [mA]", U16, "ro"),
        RANGE[1],
    )
}


@every_case(
    ("index", "data", "text", "value"),
    [
        (0x6064, b"\x02\0\0\0", "2 = 2e-06 m", 2e-6),
        (0x6064, b"\xfe\xff\xff\xff", "-2 = -2e-06 m", -2e-6),
        (0x6064, b"\x02\0", "02 00 (INTEGER32 expected)", "0200"),
        (0x6041, b"\x37\x06", "0637h Operation enabled, target reached", 0x0637),
        (0x6061, b"\x08", "8 csp", 8),
        (0x603F, b"\x11\x86", "8611h", 0x8611),
        (0x1001, b"\x05", "05h", 5),
        (0x1018, b"\xff\xff\0\0", "65535", 65535),
        (0x1018, b"\0\0\1\0", "65536 (10000h)", 65536),
        (0x1008, b"EPOS4", "'EPOS4'", "EPOS4"),
        (0x2334, b"\xe8\x03", "1000 = 1 A", 1.0),
        (0x2010, b"\x05\0", "5 = 0.005 m", 0.005),
    ],
)
def test_values_of_objects(index, data, text, value):
    node = TracedNode(3, profile("faulhaber_v3"))
    shown, number = node.valued(ROWS[index], data)
    assert (shown, number) == (text, pytest.approx(value) if isinstance(value, float) else value)


def test_an_unknown_object_and_titles():
    node = TracedNode(3, profile("faulhaber_v3"))
    assert node.valued(None, b"\x0a\xff") == ("0A FF", "0aff")
    assert node.title(0x6041, 0) == "6041h.0 Statusword"
    assert node.title(0x1018, 1) == "1018h.1 Identity object: Vendor ID"
    assert node.title(0x5000, 0x10) == "5000h.16"
    assert node.decode_value(RANGE[1], b"\x05\0") == ("Range: Low [mm] 5 = 0.005 m", "range_low", pytest.approx(0.005))
    assert node.decode_value(ROWS[0x2334], b"\x05\0")[:2] == ("Current limit [mA] 5 = 0.005 A", "current_limit")


def test_without_a_profile_there_are_names_but_no_units():
    node = TracedNode(3)
    assert (node.name, node.routes) == ("node 3", {})
    assert node.valued(node.entry(0x6064, 0), b"\x02\0\0\0") == ("2", 2)
    indices = {entry.index for entry in common()}
    assert {0x1018, 0x6041, 0x6200} <= indices
    assert not [index for index in indices if 0x1400 <= index < 0x6000 or index >= 0x6800]
    assert len(common()) == len({(entry.index, entry.sub) for entry in common()})


def test_a_drive_that_was_identified_keeps_what_was_learned():
    decoder = Decoder()
    node = decoder.party(3)
    for sub_, value in ((2, 0x61500000), (1, 0xFB)):
        assert node.profile is None
        decoder.decode(0, Frame(0x583, struct.pack("<BHBI", 0x43, 0x1018, sub_, value)))
    assert node.profile is profile("epos4")
    assert node.dictionary.get(0x1018, 2) == 0x61500000
    assert {0x203, 0x183} <= {*node.routes}  # its default mappings; TPDO 2 to 4 are off
    assert not {0x283, 0x383, 0x483} & {*node.routes}


def test_routes_of_process_data():
    (word,), (position,) = var(0x6041, "", U16, "ro"), var(0x6064, "", I32, "ro")
    route = Route("TPDO1", ((position, 32), (word, 16)))
    assert (route.size, route.statusword(b"\1\2\3\4\x37\x06")) == (6, 0x0637)
    assert Route("TPDO1", ((position, 32),)).statusword(b"\1\2\3\4") is None
    node = TracedNode(3, profile("epos4"))
    node.learn(0x1A00, 1, struct.pack("<I", 0x12340010))  # of an object that is not known
    node.learn(0x1800, 1, struct.pack("<I", 0x183))
    assert 0x183 not in node.routes
    node.learn(0x1A00, 0, b"\0")
    assert node.routes[0x183] == Route("TPDO1", ())


# --------------------------------------------------------------------------------------------------------- transfers


@every_case(
    ("command", "data"), [(0x23, b"abcd"), (0x27, b"abc"), (0x2B, b"ab"), (0x2F, b"a"), (0x22, b"abcd"), (0x4F, b"a")]
)
def test_bytes_of_an_expedited_transfer(command, data):
    assert expedited(bytes([command, 0, 0x10, 0]) + b"abcd") == data


def test_which_responses_are_aborts():
    assert Transfer.aborts(b"\x80" + bytes(7))
    assert not Transfer.aborts(b"\x80" + bytes(6))
    assert not Transfer.aborts(b"\x60" + bytes(7))


def test_what_is_written_is_learned_when_it_is_confirmed():
    node = TracedNode(3, profile("epos4"))
    transfer = Transfer(node)
    assert (
        transfer.request(struct.pack("<BHBI", 0x23, 0x6081, 0, 77))
        == "write 6081h.0 Profile velocity = 77 = 8.06342 rad/s"
    )
    assert node.dictionary.get(0x6081) == 1000
    assert transfer.response(struct.pack("<BHBI", 0x60, 0x6081, 0, 0)) == "written 6081h.0 Profile velocity"
    assert node.dictionary.get(0x6081) == 77
    # a confirmation whose request is not in the trace
    assert transfer.response(struct.pack("<BHBI", 0x60, 0x6083, 0, 0)) == "written 6083h.0 Profile acceleration"
    assert node.dictionary.get(0x6083) == 10000
    assert transfer.response(struct.pack("<BHBI", 0x4B, 0x6040, 0, 6)) == "6040h.0 Controlword = 0006h Shutdown"
    assert node.dictionary.get(0x6040) == 6


# ---------------------------------------------------------------------------------------------- a run and a listener
