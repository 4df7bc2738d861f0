"""What commissioning reads and writes by SDO, without a bus: inspected objects, values with units, DCF files, flash."""

from types import SimpleNamespace

import pytest

from hw_bridge.commission import dcf, nvm, status
from hw_bridge.commission.inspection import inspect
from hw_bridge.commission.limits import compare, defaulted
from hw_bridge.commission.objects import find, format_value, name, parse_value, to_raw
from hw_bridge.commission.sdo_session import assert_not_driven, pending_error
from hw_bridge.dictionary import State
from hw_bridge.master import setup
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

END_STOP = {"homing": {"method": -3, "at": "-20 mm"}}


def notes(profile="faulhaber_v3", values=(), **keys):
    """Notes of an inspection without those about the peak current."""
    node = unconnected_node(profile, values, **keys)
    setup.learn_scaling(node)
    return [note.removeprefix("axis: ") for note in inspect(node).notes if "8250h" not in note]


@every_case(
    ("values", "keys", "texts"),
    [
        ({}, {"limits": {"force": "18.40 N"}}, []),  # 1.58 A at 11.64 N/A are 18.39 N
        (
            {},
            {"limits": {"force": "18.38 N"}},
            [
                "the drive's own currents allow 18.39 N, limits.force is 18.38 N: only this program watches it. Lower them under `objects` or in the drive, so that the drive holds it too."
            ],
        ),
        ({}, {"scale": 0.5, "limits": {"force": "36.79 N"}}, []),
        ({}, {"limits": {"force": "19 N"}, "homing": {"method": 37}}, []),
        (
            {(0x605A, 0): 0},
            {"limits": {"force": "19 N"}},
            ["605Ah is 0: at a quick stop it coasts. Set a ramp: twin hil set 3 605Ah 2."],
        ),
        ({(0x605A, 0): 0}, {"limits": {"force": "19 N"}, "objects": {"605Ah": 2}}, []),
        (
            {(0x1029, 1): 1},
            {"limits": {"force": "19 N"}},
            ["1029h.1 is 1: it stays Operational when it misses this program's heartbeat. 6007h stops it alone."],
        ),
        ({(0x1029, 1): 1}, {"limits": {"force": "19 N"}, "objects": {"1029h.1": 0}}, []),
        (
            {(0x1029, 1): 0},
            {"limits": {"force": "19 N"}, "objects": {"1029h.1": 1}},
            ["1029h.1 is 1: it stays Operational when it misses this program's heartbeat. 6007h stops it alone."],
        ),
        (
            {(0x60FD, 0): 1},
            {"limits": {"force": "19 N"}},
            [
                "negative limit switch closed (60FDh): it may not move, or away from there only. Check place and polarity."
            ],
        ),
    ],
)
def test_what_contradicts_the_hardware_file(values, keys, texts):
    assert notes(values=values, **keys) == texts


@pytest.mark.parametrize(
    ("current", "force", "text"),
    [
        # 2 A at 0.091 N m/A, for 0.01 m of the member for 1 rad: 18.2 N
        (2000, "18.3 N", ""),
        (
            2000,
            "18.1 N",
            "homing pushes against the end stop with 18.2 N, above limits.force 18.1 N. Lower it under `objects` (30B2h or 2080h, or 2350h and 2351h).",
        ),
    ],
)
def test_homing_against_an_end_stop(current, force, text):
    values = {(0x30B2, 0): current, (0x3001, 1): 100, (0x3001, 2): 100, (0x605A, 0): 2}
    found = notes("epos4", values, scale=0.01, limits={"force": force}, **END_STOP)
    assert found == ([text] if text else [])
    found = notes("epos4", values, scale=0.01, limits={"force": force}, homing={"method": 37})
    assert found == []
    assert notes(limits={"force": "19 N"}, **END_STOP) == [
        "homing pushes against an end stop, and no object tells with which current."
    ]


def test_limits_of_a_drive_beside_those_of_the_file():
    """Of an EPOS4 at 10 mm for 1 rad: 30 1/min, 2000 increments a revolution, 1.365 N m at 15 A."""
    values = {
        (0x6080, 0): 30,
        (0x607F, 0): 60,
        (0x6065, 0): 2000,
        (0x607D, 1): -1000,
        (0x607D, 2): 3000,
        (0x60C5, 0): 0x7FFFFFFF,
    }
    node = unconnected_node("epos4", values, scale=0.01)
    turn = 6.283185307179586
    rows = [(row.name, row.own, row.source, row.unit) for row in compare(node)]
    assert rows == [
        ("velocity", pytest.approx(0.005 * turn), "6080h", "m/s"),
        ("velocity", pytest.approx(0.01 * turn), "607Fh", "m/s"),
        ("following_error", pytest.approx(0.01 * turn), "6065h", "m"),
        ("position", pytest.approx(0.02 * turn), "607Dh", "m"),
        ("force", pytest.approx(136.5), "its peak current", "N"),
    ]
    node.rotary = True
    assert [row.unit for row in compare(node)] == ["rad/s", "rad/s", "rad", "rad", "N*m"]


def test_limits_that_a_file_does_not_give_are_named():
    given = {"position": ["-1 mm", "1 mm"], "velocity": "1 mm/s", "acceleration": "1 m/s^2"}
    (text,) = defaulted(unconnected_node(limits=given))
    assert "following_error: 5 mm, force: 15 N. Are" in text
    assert list(defaulted(unconnected_node(limits={**given, "force": "15 N", "following_error": "1 mm"}))) == []


@every_case(
    ("index", "sub", "value", "text"),
    [
        (0x6064, 0, -1500, "-1.5 mm (-1500)"),
        (0x606C, 0, 20, "20 mm/s (20)"),
        (0x607D, 1, -0x80000000, "no limit (-2147483648)"),
        (0x607D, 2, 0x7FFFFFFF, "no limit (2147483647)"),
        (0x6061, 0, 8, "cyclic synchronous position (csp) (8)"),
        (0x1017, 0, 10, "10 ms (10)"),
        (0x6040, 0, 0x0F, "Enable operation (000Fh)"),
        (0x6041, 0, 0x627, "Operation enabled; remote, target reached (0627h)"),
        (0x603F, 0, 0, "none"),
        (0x603F, 0, 0x4310, "4310h temperature"),
        (0x603F, 0, 0x1234, "1234h"),
        (0x1008, 0, "MC", "MC"),
        (0x1800, 2, 9, "9"),
        (0x1800, 2, 10, "Ah"),
        (0x1016, 1, 0x7F003C, "node 127 lost after 60 ms (7F003Ch)"),
        (0x1016, 1, 0x7F0000, "off (7F0000h)"),
        (0x60FE, 1, 12, "12"),
    ],
)
def test_values_as_text(index, sub, value, text):
    """Quantities with their unit; numbers of communication objects from 10 on in hexadecimal."""
    node = unconnected_node()
    assert format_value(node, node.mirror.entry(index, sub), value) == text


@every_case(
    ("text", "raw"),
    [
        ("1.5 mm", 1500),
        ("-1.5 mm", -1500),
        ("0", 0),
        ("26h raw", 0x26),
        ("-7 raw", -7),
        ("0x1A raw", 26),
        ("1.4 um", 1),
    ],
)
def test_a_number_where_a_unit_is_expected(text, raw):
    node = unconnected_node()
    entry = node.mirror.entry(0x607D, 1)
    assert parse_value(node, entry, text) == raw
    for wrong, message in (
        ("5", "5 has no unit. Write it in m, or 5 raw in the drive's own."),
        ("5 s", "does not convert to m"),
    ):
        with pytest.raises(SimulationError, match=message):
            parse_value(node, entry, wrong)


def test_a_number_without_a_unit():
    assert [to_raw(text, None, "x") for text in ("150", "26h", "0x1A", "-3", "9 raw")] == [150, 0x26, 26, -3, 9]
    with pytest.raises(SimulationError, match=r"^x: expected a whole number such as 150 or 26h, not '1\.5'\.$"):
        to_raw("1.5", None, "x")


@pytest.mark.parametrize("index", [0x605A, 0x60E0, 0x6083, 0x6060])
def test_a_value_outside_of_its_range(index):
    """Of its object, else of its type."""
    node = unconnected_node()
    entry = node.mirror.entry(index)
    low, high = (
        given if given is not None else end for given, end in zip((entry.low, entry.high), entry.type.span, strict=True)
    )
    if index == 0x6060:  # it moves the drive
        with pytest.raises(SimulationError, match="acts at once"):
            parse_value(node, entry, "0")
        return
    assert [parse_value(node, entry, f"{number} raw") for number in (low, high)] == [low, high]
    for number in (low - 1, high + 1):
        with pytest.raises(SimulationError, match=rf"{number} raw is outside \S+ .*to .*\b{high}\b"):
            parse_value(node, entry, f"{number} raw")


def test_objects_that_cannot_be_set():
    node = unconnected_node()
    for index, sub, text in ((0x6040, 0, "acts at once"), (0x6041, 0, "can only be read"), (0x607A, 0, "acts at once")):
        with pytest.raises(SimulationError, match=text):
            parse_value(node, node.mirror.entry(index, sub), "0")


def test_objects_by_index_and_by_name():
    entries = unconnected_node().mirror.entries()
    addresses = [
        [(entry.index, entry.sub) for entry in find(entries, word)]
        for word in ("6064h", "0x6064", "607Dh.1", "607D:2", "607Dh", "position_actual_value", "9999h")
    ]
    assert addresses == [
        [(0x6064, 0)],
        [(0x6064, 0)],
        [(0x607D, 1)],
        [(0x607D, 2)],
        [(0x607D, 1), (0x607D, 2)],
        [(0x6064, 0)],
        [],
    ]
    (low,) = find(entries, "607Dh.1")
    assert find(entries, name(low)) == [low]
    with pytest.raises(
        SimulationError, match=r"^positio_actual_value: no such object\. Did you mean 'position_actual_value' or "
    ):
        find(entries, "positio_actual_value")
    with pytest.raises(
        SimulationError, match=r"^x: no such object\. Give its index, such as 6085h, or a name of a dump"
    ):
        find(entries, "x")  # not the first ones of the alphabet


@pytest.mark.parametrize(("value", "text"), [(12, "12"), (5, "5")])
def test_the_first_of_the_vendors_objects_is_decimal(value, text):
    """2000h of an EPOS4 is its node-ID."""
    node = unconnected_node("epos4")
    assert format_value(node, node.mirror.entry(0x2000, 0), value) == text


@pytest.mark.parametrize(
    ("mode", "bits"),
    [(1, "set-point acknowledged, following error"), (6, "homing attained, homing error"), (9, "follows the target")],
)
def test_bits_of_the_statusword_are_those_of_the_mode_in_which_the_drive_is(mode, bits):
    node = unconnected_node(values={(0x6041, 0): WORDS[State.ENABLED] | 0x3000, (0x6061, 0): mode})
    (word,) = [value for label, value in status(node).groups["power"] if label.startswith("6041h")]
    assert word == f"Operation enabled; remote, {bits} (3227h)"


SESSION = SimpleNamespace(nmt=lambda *_: None, wait=lambda *_: None, states={})


def test_a_dcf_file_is_restored_where_it_differs():
    """Parameters first; then of each PDO: off, kind, mapping from count 0 to its count, on."""
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED], (0x6083, 0): 300})
    own = node.server.dictionary.values
    wanted = {
        (0x1018, 1): own[0x1018, 1],
        (0x6041, 0): 5,
        (0x6083, 0): 301,
        (0x6085, 0): own[0x6085, 0],
        (0x607A, 0): 99,
        (0x1401, 1): 0x303,
        (0x1401, 2): 1,
        (0x1601, 0): 1,
        (0x1601, 1): 0x60FF0020,
        (0x1601, 2): own[0x1601, 2],
        (0x1601, 3): 7,
    }
    found = dcf.differences(node, wanted)
    assert [(entry.index, entry.sub, before, after) for entry, before, after in found] == [
        (0x1401, 2, 255, 1),
        (0x1601, 0, 2, 1),
        (0x1601, 1, own[0x1601, 1], 0x60FF0020),
        (0x1601, 3, 0, 7),
        (0x6083, 0, 300, 301),
    ]
    node.server.refused.add((0x1601, 3))
    changed, refused = dcf.restore(SESSION, node, wanted)
    assert node.server.written == [
        (0x6083, 0, 301),
        (0x1401, 1, 0x80000303),
        (0x1401, 2, 1),
        (0x1601, 0, 0),
        (0x1601, 1, 0x60FF0020),
        (0x1601, 0, 1),
        (0x1401, 1, 0x303),
    ]
    assert [line.split()[0] for line in changed] == ["6083h.0", "1401h"]
    assert len(refused) == 1  # an entry that no PDO carries
    assert "1601h.3" in refused[0]
    assert node.journal.changes == {}  # it is to stay
    node.server.refused.add((0x1601, 1))
    wanted[0x1601, 1] = 0x60400010
    changed, refused = dcf.restore(SESSION, node, wanted)
    assert changed == []
    assert "1601h.1" in refused[0]


def test_a_dcf_file_with_a_mapping_entry_alone_leaves_the_rest_of_the_pdo_as_it_is():
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    own = node.server.dictionary.values
    before = {address: own[address] for address in ((0x1401, 1), (0x1401, 2), (0x1601, 0))}
    changed, refused = dcf.restore(SESSION, node, {(0x1601, 1): 0x60FF0020})
    assert (len(changed), refused) == (1, [])
    assert own[0x1601, 1] == 0x60FF0020
    assert {address: own[address] for address in before} == before


@pytest.mark.parametrize(("sub", "what"), [(1, "vendor"), (2, "product code")])
def test_a_dcf_file_of_another_drive(sub, what):
    node = unconnected_node(values={(0x1018, sub): 0x21})
    assert dcf.identity_mismatch(node, {(0x1018, sub): 0x21}) == ""
    text = f"axis: {what} is 21h, the file is of 22h. Use a file of this drive."
    assert dcf.identity_mismatch(node, {(0x1018, sub): 0x22}) == text
    assert dcf.identity_mismatch(node, {(0x6083, 0): 1}) == ""
    with pytest.raises(SimulationError, match=r"Use a file of this drive"):
        dcf.restore(SESSION, unconnected_node(values={(0x1018, sub): 0x21, (0x6041, 0): 0x240}), {(0x1018, sub): 0x22})


@every_case("state", State)
def test_a_drive_that_another_program_drives_is_left_alone(state):
    node = unconnected_node(values={(0x6041, 0): WORDS[state]})
    if state not in (State.ENABLED, State.QUICK_STOP, State.REACTION):
        assert_not_driven(node)
        return
    for action in (assert_not_driven, nvm.store, nvm.defaults, lambda drive: dcf.restore(SESSION, drive, {})):
        with pytest.raises(
            SimulationError,
            match=rf"^axis: is in {state}: somebody drives it\. End that program, or `twin hil disable 3`\.$",
        ):
            action(node)
    assert node.server.written == []


@pytest.mark.parametrize(
    ("register", "code", "text"),
    [
        (0x01, 0, ""),
        (0x10, 0, "axis: reports an earlier error (1001h is 10h)."),
        (0x11, 0x8130, "axis: reports an earlier error (1001h is 11h): 8130h"),
    ],
)
def test_an_error_of_communication_that_is_left(register, code, text):
    node = unconnected_node(values={(0x1001, 0): register, (0x603F, 0): code})
    assert pending_error(node).startswith(text)
    assert bool(pending_error(node)) is bool(text)


@pytest.mark.parametrize(
    ("register", "state", "begin"),
    [
        (0, State.DISABLED, ["none now", "earlier (1003h): 8130h"]),
        (0x11, State.DISABLED, ["8130h"]),
        (0, State.FAULT, ["8130h"]),
    ],
)
def test_an_error_that_was_reset_is_an_earlier_one(register, state, begin):
    values = {(0x1001, 0): register, (0x1003, 0): 1, (0x1003, 1): 0x8130, (0x6041, 0): WORDS[state]}
    errors = status(unconnected_node(values=values)).errors
    assert [text[: len(start)] for text, start in zip(errors, begin, strict=True)] == begin


def test_parameters_are_stored_and_restored_by_their_signatures(tmp_path):
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    for index in (0x1010, 0x1011):
        node.server.ignored.add((index, 1))
    nvm.store(node, tmp_path)
    nvm.defaults(node)
    assert node.server.written == [
        (0x1010, 1, int.from_bytes(b"save", "little")),
        (0x1011, 1, int.from_bytes(b"load", "little")),
    ]
    node.server.refused.add((0x1010, 1))
    with pytest.raises(SimulationError, match=r"^axis: stores no parameters: node 3: 1010h\.1: refused with 06010002h"):
        nvm.store(node, tmp_path)


@pytest.mark.parametrize("booted", [True, False])
def test_a_restart_waits_for_the_boot_up(booted):
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    commands, waits = [], []
    session = SimpleNamespace(states={3: "old"}, nmt=lambda *command: commands.append(command))

    def wait(duration, done=None):
        waits.append(duration)
        if booted:
            session.states[3] = "booted"
        assert done is None or done() is booted

    session.wait = wait
    if booted:
        nvm.restart(session, node)
        assert len(waits) == 2
    else:
        with pytest.raises(SimulationError, match=r"^axis: does not tell that it started within"):
            nvm.restart(session, node)
    assert commands == [(0x81, 3)]
