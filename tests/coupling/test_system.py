"""Connections: every problem is listed at once, with the nearest right name."""

import pytest

from tests.component.test_component import Everything
from tests.coupling.parts import Gain, Lag, Millimeters
from tests.every_case import every_case
from twin.coupling import Connection, CoupledSystem, RecordMember
from twin.errors import CouplingError
from twin.graph import ordered_groups


def system(*connections):
    parts = {"lag": Lag(), "gain": Gain(), "mm": Millimeters(), "all": Everything()}
    catalog = {name: RecordMember(name, part).variables for name, part in parts.items()}
    return CoupledSystem(
        catalog, [Connection(*c.split(" -> "), where=f"s.yaml:{i}") for i, c in enumerate(connections)]
    )


@every_case(
    ("connection", "message"),
    [
        ("lagg.y -> gain.u", "no member 'lagg'. Did you mean 'lag'?"),
        ("lag.z -> gain.u", "lag has no variable 'z'"),
        ("lag.u -> gain.u", "the source is an input"),
        ("lag.y -> gain.k", "the target is no input but parameter"),
        ("lag.time_constant -> gain.u", "s does not convert to m"),
        ("lag.y -> all.vector", "1 values do not fit 3"),
        ("lag.y -> all.vector[4]", "has shape [3], elements count from 1"),
        ("lag.y -> all.number", "Float64 does not fit Int32"),
        ("all.big -> all.flag", "Int64 does not fit Boolean"),
        ("all.big -> all.number", "Int64 may overflow Int32"),
    ],
)
def test_problems(connection, message):
    problems = system(connection).check()
    assert len(problems) == 1
    assert problems[0].startswith("s.yaml:0: ")
    assert message in problems[0]


def test_two_sources_and_several_problems_at_once():
    problems = system("lag.y -> gain.u", "all.y -> gain.u", "x.y -> gain.u").check()
    assert len(problems) == 2
    assert "gain.u has two sources, lag.y and all.y" in problems[0]
    with pytest.raises(CouplingError):
        system("x.y -> gain.u").links()


def test_conversion_and_elements():
    links = system("lag.y -> mm.u", "all.x[2] -> gain.u", "lag.y -> all.vector[3]").links()
    assert (links[0].factor, links[0].offset) == (1000.0, 0.0)
    assert (links[1].source.first, links[1].source.size) == (1, 1)
    assert links[2].target.first == 2


def test_groups_come_after_what_they_need():
    followers = {"a": ["b"], "b": ["c", "a"], "c": ["d"], "e": ["a"]}
    assert ordered_groups(list("abcde"), followers) == [["e"], ["a", "b"], ["c"], ["d"]]
