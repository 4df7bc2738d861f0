"""Datagrams of a rig, whatever they hold: numbers with their names and units, or a problem in one line."""

import math

from tests.every_case import every_case
from twin.follow.sources import Message
from twin.follow.sources.messages import parse

HUGE = b"1" + b"0" * 400
NO_TIME = "`time` of a message is no number of seconds"


def read(data):
    return parse("rig", data, 100.0, "time")


@every_case(
    ("data", "stamp", "values", "units"),
    [
        (b'{"time": 1.25, "tip": 0.1}', 1.25, {"tip": 0.1}, {}),
        (b'{"tip": 3}', None, {"tip": 3.0}, {}),
        (b'{"time": null, "tip": null, "on": true, "off": false}', None, {"on": 1.0, "off": 0.0}, {}),
        (b'{"time": 0, "a": {"x": 1, "b": {"y": -2}}, "x": 3}', 0.0, {"a.x": 1.0, "a.b.y": -2.0, "x": 3.0}, {}),
        (b'{"time": 1, "a": {"time": 2}, "units": {"a": "mm", "b": 3}}', 1.0, {"a.time": 2.0}, {"a": "mm", "b": "3.0"}),
        (b'{"tip": 1, "units": "mm"}', None, {"tip": 1.0}, {}),
        (b'{"tip": ' + HUGE + b', "low": -1e400}', None, {"tip": math.inf, "low": -math.inf}, {}),  # left out later
    ],
)
def test_what_a_datagram_holds(data, stamp, values, units):
    assert read(data) == Message("rig", 100.0, stamp, values, units)


@every_case("time", [b"NaN", b"Infinity", b"-Infinity", b"1e400", HUGE, b'"1"', b"[1]", b"{}"])
def test_a_time_that_is_none(time):
    assert read(b'{"tip": 1, "time": ' + time + b"}") == Message("rig", 100.0, problem=NO_TIME)


@every_case(
    ("data", "problem"),
    [
        (b"", "a message is no JSON (Expecting value)"),
        (b"\xff", "a message is no JSON ('utf-8' codec can't decode byte 0xff in position 0)"),
        (b"[1]", "a message is no JSON object such as {'time': 1.25, 'tip': 0.1}"),
        (b'{"tip": "1"}', "`tip` of a message is no number"),
        (b'{"a": {"b": [1]}}', "`a.b` of a message is no number"),
    ],
)
def test_what_is_no_datagram(data, problem):
    assert read(data) == Message("rig", 100.0, problem=problem)


def test_nesting_of_any_depth_is_read_or_refused():
    """One level more than Python reads is a problem, too."""
    depths = (1, 10, *range(700, 1000, 3), 5_000)
    found = [read(b'{"a":' * depth + b"1" + b"}" * depth) for depth in depths]
    assert found[1].values == {".".join("a" * 10): 1.0}
    assert found[-1].problem.startswith("a message is no JSON (maximum recursion depth exceeded")
    assert all(bool(message.values) is not bool(message.problem) for message in found)
