"""Texts and numbers of the operator's panel: what a field shows, accepts and sends, and which commands are listed."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from tests.every_case import every_case

pytest.importorskip("nicegui")

from twin.console.curves import shown_value, start_value
from twin.console.operator_panel import HELD, RELEASED, condense, parse_entry, read
from twin.live import EXPIRED, ExecutedCommand, RefusedError

SIGNAL = SimpleNamespace(name="a.m", start=[[1.0, 2.0], [3.0, 4.0]], factor=1e3, offset=-2.0)


@every_case(
    ("text", "low", "high", "value"),
    [
        ("1.0", None, None, 1.0),
        ("1", 1.0, 1.0, 1.0),
        ("0.99", 1.0, None, "0.99 is refused: at least 1 mm."),
        ("0.1", 2 / 3, None, "0.1 is refused: at least 0.667 mm."),
        ("9", -1.0, 5 / 3, "9 is refused: at most 1.66 mm."),  # a number that is accepted
        ("1e6", None, 123456.0, "1e6 is refused: at most 123456 mm."),
        ("1.01", None, 1.0, "1.01 is refused: at most 1 mm."),
        ("", None, None, "Expected a number."),
        ("-", None, None, "`-` is not a quantity. Write a number and a unit: 0.2 mm."),
        ("1e999", None, None, "`1e999` is not a finite number."),
        ("0.0", 0.0, None, 0.0),
        ("-0.5", None, 0.0, -0.5),
        ("51.", None, None, 51.0),
        (" 1e-3 ", None, None, 1e-3),
        ("\N{MINUS SIGN}2 cm", None, None, -20.0),
        ("42,5", None, None, "42,5: write a decimal point, not a comma."),
        ("5 N", None, None, "`5 N` does not convert to mm."),
    ],
)
def test_what_a_field_takes_and_refuses(text, low, high, value):
    if isinstance(value, str):
        with pytest.raises(RefusedError, match=re.escape(value)):
            parse_entry(text, "mm", low, high)
    else:
        assert parse_entry(text, "mm", low, high) == pytest.approx(value)


def test_what_a_field_shows():
    """An element by its index from 1, in the display unit with nine digits."""
    assert [start_value(name, SIGNAL) for name in ("a.m", "a.m[1,2]", "a.m[2,1]", "a.m[2]")] == [
        SIGNAL.start,
        2.0,
        3.0,
        [3.0, 4.0],
    ]
    assert start_value("a.m[1]", SimpleNamespace(name="a.m", start=None)) is None
    assert [shown_value(SIGNAL, value) for value in (0.0, 0.5, None, "3 mm", 1 / 3)] == [
        -2.0,
        498.0,
        -2.0,
        -2.0,
        331.333333,
    ]


@every_case(
    ("text", "value"),
    [(" 2.5 ", 2.5), ("-1e3", -1000.0), ("TRUE", True), ("false ", False), ("0.6 N", "0.6 N"), (" a ", "a")],
)
def test_what_is_read(text, value):
    found = read(text)
    assert (found, type(found)) == (value, type(value))


@every_case(
    ("name", "start", "value"),
    [
        ("a.m", 2.0, 2.0),
        ("a.m", None, None),
        ("a.m[1]", None, None),
        ("a.m[1]", 2.0, None),
        ("a.m[2]", [], None),
        ("a.m[2]", (1.0, 3.0), 3.0),
        ("a.m[2,1]", [[1.0, 2.0], [3.0, 4.0]], 3.0),
        ("a.m[2,1]", [1.0, 3.0], None),
    ],
)
def test_the_start_of_an_element(name, start, value):
    """None where the start is not known for each element."""
    assert start_value(name, SimpleNamespace(name="a.m", start=start)) == value


def test_a_hold_is_two_lines():
    """Its begin and its end, by the dead-man switch too; what is set along with it is left out, other commands stay.

    The texts are those of `CommandExecutor.shown`: in the display unit, with the unit.
    """
    controls = {
        "a.x": SimpleNamespace(rest=0.0, label="hand", along=("a.on",), factor=1e3, offset=0.0, display_unit="mm"),
        "a.y": SimpleNamespace(rest=1.0, label="foot", along=(), factor=1.0, offset=0.0, display_unit=""),
        "a.b": SimpleNamespace(rest=False, label="valve", along=(), factor=1.0, offset=0.0, display_unit=""),
    }
    for name, control in controls.items():
        control.input = name
    texts = [
        "set a.k = 3",
        "set a.x = 100 mm",
        "set a.on = true",
        "set a.x = 200 mm",
        "set a.y = 1.0",
        "override a.on",
        "set a.x = 0 mm",
        "set a.on = false",
        "set a.y = 2.0",
        "release a.x",
        "set a.x = -300 mm",
        "a.x: nothing came from the page for 620 ms",
        "set a.x = 0 mm",
        "set a.b = true",
        "set a.b = false",
        "End",
    ]
    kinds = {11: EXPIRED, 15: "stop"}
    done = [ExecutedCommand(i, float(i), kinds.get(i, "set"), text, "line") for i, text in enumerate(texts)]
    expected = {
        0: "set a.k = 3",
        1: f"hand{HELD} at 100 mm",
        5: "override a.on",
        6: f"hand{RELEASED}",
        8: f"foot{HELD} at 2",
        9: "release a.x",
        10: f"hand{HELD} at -300 mm",
        11: f"hand{RELEASED} by the dead-man switch: nothing came from the page for 620 ms",
        13: f"valve{HELD}",
        14: f"valve{RELEASED}",
        15: "End",
    }
    assert condense(done, controls) == [replace(done[i], text=text) for i, text in expected.items()]
    assert condense(done, {}) == done
