"""Clocks as they are declared, and the exact times at which they tick; messages and statuses of FMUs in words."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from lxml import etree

from tests.every_case import every_case
from tests.fmi.linear_member import real
from twin.fmi.clocks import clock_declarations
from twin.fmi.clocks.clock_declarations import CHANGED, UNCHANGED, UNKNOWN, Clock, Timer
from twin.fmi.clocks.simulate_clocks import Fed
from twin.fmi.csv_tables import InputColumn, Inputs
from twin.fmi.importing import binary

MS = 1_000_000


def declared(**attributes):
    """A clock from its element."""
    return clock_declarations.declared(etree.Element("Clock", {"name": "c", "valueReference": "7"} | attributes))


@every_case(
    ("attributes", "expected"),
    [
        ({}, Clock("c", 7, "local", "triggered")),
        ({"causality": "input", "intervalVariability": "changing"}, Clock("c", 7, "input", "changing")),
        (
            {"intervalDecimal": "0.25", "shiftDecimal": "0.5", "priority": "3", "supportsFraction": "true"},
            Clock("c", 7, "local", "triggered", 250 * MS, 500 * MS, 3, True),
        ),
        (
            {"intervalCounter": "1", "shiftCounter": "2", "resolution": "3", "supportsFraction": "1"},
            Clock("c", 7, "local", "triggered", Fraction(10**9, 3), Fraction(2 * 10**9, 3), 0, True),
        ),
        (
            {"intervalCounter": "1", "resolution": "4", "supportsFraction": "false"},
            Clock("c", 7, "local", "triggered", 250 * MS),
        ),
        ({"intervalCounter": "1", "intervalDecimal": "0.5"}, Clock("c", 7, "local", "triggered", 500 * MS)),
    ],
)
def test_declarations(attributes, expected):
    assert declared(**attributes) == expected


@pytest.mark.parametrize(
    ("attributes", "words"), [({"priority": "x"}, "invalid literal"), ({"intervalDecimal": "soon"}, "soon")]
)
def test_declarations_that_are_wrong(attributes, words):
    with pytest.raises(ValueError, match=f"^line None: clock 'c': .*{words}"):
        declared(**attributes)


@every_case(
    ("causality", "variability", "interval", "is_time_based", "is_settable"),
    [
        ("input", "triggered", 5, False, False),
        ("input", "constant", 5, True, False),
        ("input", "fixed", 5, True, True),
        ("input", "tunable", 5, True, True),
        ("input", "tunable", None, True, False),
        ("output", "tunable", 5, False, False),
    ],
)
def test_which_clocks_the_importer_lets_tick(causality, variability, interval, is_time_based, is_settable):
    own = Clock("c", 7, causality, variability, interval)
    assert (own.is_time_based, own.is_settable) == (is_time_based, is_settable)


def test_clocks_of_variables():
    """By value reference; of clocked variables those that initialization computes."""
    text = (
        '<a><ModelVariables><Clock name="c" valueReference="1"/><!-- x --><Float64 name="x" valueReference="2" clocks="1 3"/>'
        '<Clock name="d" valueReference="3" clocks="1"/><Float64 name="y" valueReference="4"/></ModelVariables>'
        '<ModelStructure><InitialUnknown valueReference="2"/><InitialUnknown valueReference="4"/></ModelStructure></a>'
    )
    bare = [
        SimpleNamespace(name=name, reference=i, type=kind)
        for i, (name, kind) in enumerate((("c", "Clock"), ("x", "Float64"), ("d", "Clock"), ("y", "Float64")), 1)
    ]
    found = clock_declarations.read(etree.fromstring(text), bare)
    assert [one.name for one in found.every] == ["c", "d"]
    assert (found.of, found.initial) == ({2: (1, 3)}, frozenset({2}))
    with pytest.raises(ValueError, match=r"^line 1: 'x', clocks: there is no clock 9$"):
        clock_declarations.read(etree.fromstring(text.replace("1 3", "1 9")), bare)
    assert clock_declarations.read(etree.fromstring("<a><ModelVariables/></a>"), []).every == ()


@every_case(
    ("variability", "interval", "shift", "given", "due", "after"),
    [
        ("constant", 10, 3, None, 103, 113),
        ("fixed", 10, 0, 20, 100, 120),
        ("tunable", None, 0, 20, 100, 120),
        ("changing", None, 3, 20, 120, None),  # the first interval counts from the start
        ("countdown", None, 0, 20, 120, None),
        ("countdown", None, 0, None, None, None),
    ],
)
def test_when_a_clock_ticks(variability, interval, shift, given, due, after):
    """From the start at 100; again after a tick at that time."""
    timer = Timer(Clock("c", 7, "input", variability, interval, shift))
    timer.begin(100, given)
    assert timer.due == due
    if due is not None:
        timer.ticked(due)
        assert timer.due == after


@every_case(
    ("variability", "due", "interval", "qualifier", "expected"),
    [
        ("changing", None, 30, CHANGED, (30, 230)),
        ("changing", 210, 30, CHANGED, (30, 230)),
        ("changing", None, None, UNCHANGED, (20, 220)),  # as long as the last one
        ("changing", 210, None, UNCHANGED, (20, 210)),
        ("changing", 210, None, UNKNOWN, (20, None)),
        ("countdown", None, None, UNCHANGED, (20, None)),
        ("countdown", 210, None, UNCHANGED, (20, 210)),
        ("countdown", 210, None, CHANGED, (20, 210)),
    ],
)
def test_intervals_that_the_fmu_gives_at_events(variability, due, interval, qualifier, expected):
    timer = Timer(Clock("c", 7, "input", variability), 20, due)
    timer.update(200, interval, qualifier)
    assert (timer.interval, timer.due) == expected


@every_case(
    ("variability", "interval", "expected"),
    [
        ("changing", None, True),
        ("countdown", 5, True),
        ("tunable", None, True),
        ("tunable", 5, False),
        ("fixed", None, False),
    ],
)
def test_which_intervals_are_queried(variability, interval, expected):
    assert Timer(Clock("c", 7, "input", variability, interval)).needs_interval_query is expected


@every_case(
    ("seconds", "now", "expected"),
    [
        (0.1 + 0.2, 0, 300 * MS),  # within rounding of whole nanoseconds
        (0.3 - 0.2, 0, 100 * MS),
        (1.5e-9, 0, Fraction(3, 2)),
        (0.0, 0, 0),
        (1000.1 - 1000.0, 1000 * 10**9, 100 * MS),  # a difference is as exact as what it was made of
    ],
)
def test_times_that_an_fmu_computes(seconds, now, expected):
    assert clock_declarations.computed(seconds, "x", now) == expected


def test_a_table_lets_clocks_tick_once():
    """At the times of rows with a true value; a time that has passed is left out."""
    seen = []
    member = SimpleNamespace(set=lambda name, value: seen.append((name, np.array(value).tolist())))
    u, v = real("u", "input", 1, 1), real("v", "input", 2, 2)
    clock = SimpleNamespace(name="c", type="Clock")
    rows = np.array([[True], [False], [True], [True]])
    columns = [
        InputColumn(u, np.array([[0.0], [1.0], [2.0], [3.0]])),
        SimpleNamespace(variable=clock, rows=rows),
        InputColumn(v, np.zeros((4, 2))),
    ]
    fed = Fed(member, Inputs(np.array([0.0, 0.1, 0.2, 0.3]), columns))
    assert fed.due == 0
    fed(0.05)
    assert seen == [("u", 0.5), ("v", [0.0, 0.0])]
    seen.clear()
    fed.let_tick(0)
    assert (seen, fed.due) == ([("c", True)], 200 * MS)
    fed.let_tick(100 * MS)
    assert fed.due == 200 * MS
    fed.let_tick(250 * MS)
    assert (seen, fed.due) == ([("c", True)], 300 * MS)
    fed.let_tick(300 * MS)
    assert (seen, fed.due) == ([("c", True)] * 2, None)


# --- messages


def test_the_last_lines_of_a_log():
    """A line each with its status; the last 20 are kept."""
    lines = []
    log = binary.Log("a", lines)
    for status, message in ((0, b"one\n two"), (5, None), (4, b"\xff"), (-1, b"x"), (6, b"y")):
        log.add(status, message)
    assert lines == ["OK: one two", "PENDING: ", "FATAL: �", "-1: x", "6: y"]
    for number in range(18):
        log.add(1, str(number).encode())
    assert (len(lines), lines[0], lines[-1]) == (20, "-1: x", "WARNING: 17")
    log.close()
    log.close()
    assert log.key not in binary.Log.table


def test_messages_find_their_instance():
    """By the environment that was given to it, else by its name."""
    first, second = binary.Log("a", []), binary.Log("b", [])
    binary._dispatch(second.key, b"a", 0, b"", b"by key")
    binary._dispatch(None, b"a", 1, b"", b"by name")
    binary._dispatch(0, b"c", 1, b"", b"lost")
    binary._dispatch(None, None, 1, b"", b"lost")
    assert (first.lines, second.lines) == (["WARNING: by name"], ["OK: by key"])
    first.close()
    second.close()
    binary._dispatch(first.key, b"a", 0, b"", b"too late")
    assert len(first.lines) == 1


@every_case(
    ("status", "lines", "hint", "expected"),
    [
        (3, [], "", "a: f returned ERROR."),
        (0, ["x"], " Hint.", "a: f returned OK. Hint. It logged: x"),
        (5, ["w", "x", "y", "z"], "", "a: f returned PENDING. It logged: x | y | z"),
        (6, [], "", "a: f returned the unknown status 6."),
        (-1, [], "", "a: f returned the unknown status -1."),
    ],
)
def test_failed_calls(status, lines, hint, expected):
    assert str(binary.failed("a", "f", status, lines, hint)) == expected
