"""Types, entries and the object dictionary: ranges, bytes, abort codes, and what each access does."""

import pytest

from hw_bridge.dictionary import (
    I8,
    I16,
    I32,
    OCTETS,
    TEXT,
    TYPES,
    U8,
    U16,
    U32,
    U64,
    Abort,
    Code,
    Command,
    Dictionary,
    Mode,
    NodeId,
    State,
    cia301,
    cia402,
    describe_abort_code,
    record,
    state_of,
    sub,
    supported,
    var,
)
from tests.every_case import every_case

# codes, sizes and ranges of CiA 301
KINDS = [
    (I8, 0x02, 1, True, (-128, 127)),
    (I16, 0x03, 2, True, (-32768, 32767)),
    (I32, 0x04, 4, True, (-(2**31), 2**31 - 1)),
    (U8, 0x05, 1, False, (0, 255)),
    (U16, 0x06, 2, False, (0, 65535)),
    (U32, 0x07, 4, False, (0, 2**32 - 1)),
    (U64, 0x1B, 8, False, (0, 2**64 - 1)),
]


@every_case(("kind", "code", "size", "signed", "span"), KINDS)
def test_numbers_of_cia_301(kind, code, size, signed, span):
    assert (kind.code, kind.size, kind.signed, kind.span) == (code, size, signed, span)
    assert TYPES[code] is kind
    low, high = span
    saturated = {low - 1: low, low: low, 0: 0, high: high, high + 1: high}
    assert {value: kind.saturated(value) for value in saturated} == saturated


def test_rounding_and_texts():
    assert [I8.saturated(value) for value in (1.4, 1.6, -1.6, 127.4, 127.6, -200.0)] == [1, 2, -2, 127, 127, -128]
    assert [(kind.code, kind.size) for kind in (TEXT, OCTETS)] == [(0x09, 0), (0x0A, 0)]
    assert sorted(TYPES) == [0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x09, 0x0A, 0x1B]


def test_an_entry_over_the_bus():
    (number,) = var(0x6064, "Position actual value [um]", I32, "rw", -2, -5, 5)
    assert (number.encode(-2), number.decode(b"\xfe\xff\xff\xff")) == (b"\xfe\xff\xff\xff", -2)
    assert (number.label, number.unit) == ("Position actual value", "um")
    (text,) = var(0x1008, "Name", TEXT, "const", "Maß")
    assert (text.encode("Maß"), text.decode(b"Ma\xdf"), text.label, text.unit) == (b"Ma\xdf", "Maß", "Name", "")
    for length, code in ((3, Code.TOO_SHORT), (5, Code.TOO_LONG), (0, Code.TOO_SHORT)):
        with pytest.raises(Abort) as aborted:
            number.decode(bytes(length))
        assert aborted.value.code is code


@pytest.mark.parametrize(
    ("access", "readable", "writable"),
    [("const", True, False), ("ro", True, False), ("wo", False, True), ("rw", True, True)],
)
def test_access(access, readable, writable):
    (entry,) = var(0x2000, "", U8, access)
    assert (entry.readable, entry.writable) == (readable, writable)


@every_case(
    ("low", "high", "value", "code"),
    [
        (-5, 5, 5, None),
        (-5, 5, -5, None),
        (-5, 5, 6, Code.VALUE_TOO_HIGH),
        (-5, 5, -6, Code.VALUE_TOO_LOW),
        (0, 0, 1, Code.VALUE_TOO_HIGH),
        (0, 0, -1, Code.VALUE_TOO_LOW),
        (None, 5, -1000, None),
        (5, None, 1000, None),
        (5, None, 4, Code.VALUE_TOO_LOW),
        (None, None, 1000, None),
        (5, 1, "text", None),
    ],
)
def test_the_range_of_an_entry(low, high, value, code):
    (entry,) = var(0x2000, "", I16, "rw", 0, low, high)
    if code is None:
        entry.check(value)
    else:
        with pytest.raises(Abort) as aborted:
            entry.check(value)
        assert aborted.value.code is code


def test_a_record_counts_its_subindices():
    rows = record(0x2000, "Title", sub(1, "a", U8, "rw", 7, 1, 9, pdo=True), sub(4, "b", U8, "ro"))
    assert [(row.index, row.sub, row.name, row.access, row.default, row.title) for row in rows] == [
        (0x2000, 0, "Highest sub-index supported", "const", 4, "Title"),
        (0x2000, 1, "a", "rw", 7, "Title"),
        (0x2000, 4, "b", "ro", 0, "Title"),
    ]
    assert (rows[1].low, rows[1].high, rows[1].mappable, rows[2].mappable) == (1, 9, True, False)
    assert record(0x2000, "", sub(0, "own", U8, "rw", 9), sub(1, "a", U8, "rw"))[0].default == 9
    assert record(0x2000, "", sub(1, "a", U8, "rw"), count="ro")[0].access == "ro"


ENTRIES = (
    *var(0x2000, "Number", I16, "rw", 5, -10, 10),
    *var(0x2001, "Constant", U8, "const", 1),
    *var(0x2002, "Write only", U8, "wo"),
    *var(0x1014, "COB-ID", U32, "rw", NodeId(0x80)),
    *record(0x1018, "Record", sub(2, "Two", U8, "ro", 7)),
)


def aborts(act, *arguments):
    with pytest.raises(Abort) as aborted:
        act(*arguments)
    return aborted.value.code


def test_values_of_a_new_device():
    dictionary = Dictionary(ENTRIES, 3)
    assert dictionary.values == {
        (0x2000, 0): 5,
        (0x2001, 0): 1,
        (0x2002, 0): 0,
        (0x1014, 0): 0x83,
        (0x1018, 0): 2,
        (0x1018, 2): 7,
    }
    assert [(entry.index, entry.sub) for entry in dictionary.entries()] == [
        (0x1014, 0),
        (0x1018, 0),
        (0x1018, 2),
        (0x2000, 0),
        (0x2001, 0),
        (0x2002, 0),
    ]
    assert dictionary.version == 1
    assert (0x1018 in dictionary, 0x1017 in dictionary) == (True, False)
    dictionary.remove(0x1018)
    dictionary.remove(0x1018)
    assert 0x1018 not in dictionary
    assert not [address for address in dictionary.values if address[0] == 0x1018]


def test_the_devices_own_access():
    dictionary = Dictionary(ENTRIES, 3)
    assert (
        dictionary.get(0x2000),
        dictionary.get(0x1018, 2),
        dictionary.get(0x3000),
        dictionary.get(0x3000, missing=9),
    ) == (5, 7, 0, 9)
    dictionary.put(0x2001, 200)
    dictionary.put(0x2000, 1000)  # without checks
    dictionary.put(0x1018, 9, 2)
    dictionary.put(0x1018, 9, 3)  # no such object
    assert (dictionary.get(0x2001), dictionary.get(0x2000), dictionary.get(0x1018, 2)) == (200, 1000, 9)
    assert (0x1018, 3) not in dictionary.values
    assert dictionary.version == 1


def test_missing_objects():
    dictionary = Dictionary(ENTRIES, 3)
    assert dictionary.entry(0x1018, 2).name == "Two"
    assert aborts(dictionary.entry, 0x3000) is Code.NO_OBJECT
    assert aborts(dictionary.entry, 0x1018, 1) is Code.NO_SUBINDEX
    assert aborts(dictionary.upload, 0x2002, 0) is Code.WRITE_ONLY
    assert aborts(dictionary.download, 0x2001, 0, b"\1") is Code.READ_ONLY


def test_a_clients_access():
    dictionary = Dictionary(ENTRIES, 3)
    called = []

    def check(entry, value):
        called.append(("check", entry.index, value, dictionary.get(0x2000)))
        if value == 9:
            raise Abort(Code.DEVICE_STATE)

    dictionary.checks[0x2000] = check
    dictionary.effects[0x2000] = lambda entry: called.append(("effect", entry.index, dictionary.get(0x2000)))
    dictionary.reads[0x2001] = lambda entry: called.append(("read", entry.index))
    assert (dictionary.upload(0x2000, 0), dictionary.upload(0x2001, 0)) == (b"\5\0", b"\1")
    dictionary.download(0x2000, 0, b"\xf6\xff")
    assert aborts(dictionary.download, 0x2000, 0, b"\x0b\x00") is Code.VALUE_TOO_HIGH
    assert aborts(dictionary.download, 0x2000, 0, b"\x09\x00") is Code.DEVICE_STATE
    assert called == [("read", 0x2001), ("check", 0x2000, -10, 5), ("effect", 0x2000, -10), ("check", 0x2000, 9, -10)]
    assert (dictionary.get(0x2000), dictionary.version) == (-10, 2)
    dictionary.restore({(0x2000, 0): 3})
    assert (dictionary.get(0x2000), dictionary.version) == (3, 3)


def test_texts_of_abort_codes():
    assert str(Abort(Code.NO_OBJECT)) == "06020000 no object"
    assert describe_abort_code(0x06090031) == "value too high"
    assert describe_abort_code(0x12345678) == "no code of CiA 301"


@every_case(
    ("value", "text"),
    [
        (0x00, "none"),
        (0x01, "generic"),
        (0x81, "generic, manufacturer"),
        (0x16, "current, voltage, communication"),
        (0x28, "temperature, device profile"),
        (0x40, "bit 6"),
        (0x100, "none"),
    ],
)
def test_bits_of_the_error_register(value, text):
    assert cia301.error_register(value) == text


@every_case(
    ("word", "state"),
    [
        (0x0000, State.NOT_READY),
        (0x0040, State.DISABLED),
        (0x0021, State.READY),
        (0x0023, State.SWITCHED_ON),
        (0x0027, State.ENABLED),
        (0x0007, State.QUICK_STOP),
        (0x000F, State.REACTION),
        (0x0008, State.FAULT),
        # other bits do not matter: voltage, warning, remote, target reached
        (0xFF90 | 0x27, State.ENABLED),
        (0xFFB0 | 0x40, State.DISABLED),
        (0xFFB0 | 0x08, State.FAULT),
        (0x0060, State.DISABLED),
        (0x002F, State.REACTION),
        (0x0028, State.FAULT),
        (0x0020, State.NOT_READY),
        (0x0061, State.NOT_READY),
        (0x0001, State.NOT_READY),
    ],
)
def test_states_in_a_statusword(word, state):
    assert state_of(word) is state


def test_transitions_by_controlword():
    """CiA 402-2, figure of the state machine: number of the transition by state, for each command."""
    words = {"shutdown": 0x06, "switch on": 0x07, "enable": 0x0F, "disable": 0x00, "quick stop": 0x02, "reset": 0x80}
    numbers = {
        State.NOT_READY: [None] * 6,
        State.DISABLED: [2, None, None, None, None, None],
        State.READY: [None, 3, 3, 7, 7, None],
        State.SWITCHED_ON: [6, None, 4, 10, 10, None],
        State.ENABLED: [8, 5, None, 9, 11, None],
        State.QUICK_STOP: [None, None, 16, 12, None, None],
        State.REACTION: [None] * 6,
        State.FAULT: [None, None, None, None, None, 15],
    }
    for state, row in numbers.items():
        steps = [cia402.transition(state, word, 0) for word in words.values()]
        assert [step and step.number for step in steps] == row, state
    assert cia402.transition(State.FAULT, 0x80, 0x80) is None  # no rising edge
    assert cia402.command_of(0x8F, 0x80) is Command.NONE


def test_modes_and_switches():
    assert supported() == 0
    assert supported(Mode.PP, Mode.PV, Mode.HM) == 0x25
    assert supported(*(mode for mode in Mode if mode)) == 0x3A5
    texts = [cia402.closed_limit_switches(inputs) for inputs in (0, 1, 2, 3, 4, 0xFFFC)]
    assert texts == [
        "",
        "negative limit switch",
        "positive limit switch",
        "negative limit switch and positive limit switch",
        "",
        "",
    ]
