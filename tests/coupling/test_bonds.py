"""What is a power bond, and what is not."""

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling import Connection, CoupledSystem, MemberVariable, TerminalMember
from twin.coupling.bonds import find_bonds, find_power_pairs
from twin.errors import CouplingError


def variable(name, causality, unit, terminal=""):
    places = (TerminalMember(terminal, name),) if terminal else ()
    return MemberVariable(name, causality, "continuous", "Float64", np.dtype(np.float64), unit=unit, terminals=places)


def system(effort, flow, connections, terminal=""):
    """Two members, one of which answers to a flow with an effort."""
    catalog = {
        "a": {"e": variable("e", "input", effort, terminal), "f": variable("f", "output", flow, terminal)},
        "b": {"e": variable("e", "output", effort, terminal), "f": variable("f", "input", flow, terminal)},
        "c": {"f": variable("f", "input", flow)},
    }
    return CoupledSystem(catalog, connections).links()


BOTH = [Connection("a.f", "b.f", bond="one"), Connection("b.e", "a.e", bond="one")]


@every_case(
    ("effort", "flow"),
    [("N", "mm/s"), ("N", "m"), ("mmHg", "mL/s"), ("Pa", "m^3"), ("N*m", "rad/s"), ("N*mm", "deg"), ("V", "A")],
)
def test_what_gives_a_power_or_an_energy_is_one(effort, flow):
    found = find_bonds(system(effort, flow, BOTH))
    assert [(link.source.key, link.target.key) for link in found["one"]] == [
        (("a", "f"), ("b", "f")),
        (("b", "e"), ("a", "e")),
    ]


def test_a_connection_of_terminals_is_one_by_itself():
    found = find_bonds(system("N", "m/s", [Connection("a.flange", "b.flange")], terminal="flange"))
    assert list(found) == ["a.flange -> b.flange"]
    assert find_bonds(system("N", "K", [Connection("a.flange", "b.flange")], terminal="flange")) == {}, "signals, then"


@pytest.mark.parametrize(
    ("connections", "units", "message"),
    [
        (BOTH, ("N", "K"), r"bond one: a.f \[K\] and b.e \[N\] give no power. Declare it at a force and a velocity"),
        (BOTH[:1], ("N", "m"), "bond one: goes one way only, from a. Declare it at a connection back, too"),
        (
            [*BOTH, Connection("a.f", "c.f", bond="one")],
            ("N", "m"),
            "bond one: is between more than two members: a, b, c. Give every pair a name of its own",
        ),
    ],
)
def test_what_is_declared_and_is_none_is_told(connections, units, message):
    with pytest.raises(CouplingError, match=message):
        find_bonds(system(*units, connections))


@pytest.mark.parametrize(("back", "kind"), [("K", "Float64"), ("N", "Int64")])
def test_a_power_goes_both_ways_in_real_numbers(back, kind):
    returned = {
        name: MemberVariable("x", name, "continuous", kind, np.dtype(kind.lower()), unit=back)
        for name in ("input", "output")
    }
    catalog = {
        "a": {"f": variable("f", "output", "m/s"), "e": variable("e", "output", "N"), "x": returned["input"]},
        "b": {"f": variable("f", "input", "m/s"), "e": variable("e", "input", "N"), "x": returned["output"]},
    }
    forward = [Connection(f"a.{name}", f"b.{name}", bond="one") for name in "ef"]
    links = CoupledSystem(catalog, [*forward, Connection("b.x", "a.x", bond="one")]).links()
    with pytest.raises(CouplingError, match=r"bond one: .* give no power"):
        find_bonds(links)


@pytest.mark.parametrize(
    ("effort", "flow", "factor"), [("N", "mm/s", 1e-3), ("mmHg", "mL/s", 133.322e-6), ("V", "A", 1.0)]
)
def test_a_power_pair_goes_there_and_back_in_watts(effort, flow, factor):
    (((there, back, unit),),) = find_power_pairs(system(effort, flow, BOTH))
    assert (there.source.key, back.source.key) == (("a", "f"), ("b", "e"))
    assert unit == pytest.approx(factor, rel=1e-5)


def test_an_energy_is_no_power():
    with pytest.raises(CouplingError, match="bond one: has a force and a place, but no velocity"):
        find_power_pairs(system("N", "mm", BOTH))
