"""Connections of terminals: what they stand for, and what is said where two do not fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.every_case import every_case
from twin.coupling import Connection, CoupledSystem, MemberVariable, TerminalMember, declared_variables
from twin.errors import CouplingError

FLOAT = np.dtype(np.float64)


def variable(name, causality, place="", unit="N", shape=(), rule="plug", kind="signal"):
    """A variable with its place in a terminal, `grip.force`."""
    terminal, _, member = place.partition(".")
    places = (TerminalMember(terminal, member, rule, kind),) if place else ()
    return MemberVariable(name, causality, "continuous", "Float64", FLOAT, shape, unit, terminals=places)


def catalog(**members):
    return {member: {one.name: one for one in variables} for member, variables in members.items()}


SLEEVE = [variable("limit", "output", "grip.limit"), variable("load", "input", "grip.force", unit="kN")]
INSTRUMENT = [
    variable("limits", "input", "grip.limit", shape=(2,)),
    variable("forces", "output", "grip.force", shape=(2,)),
    variable("depth", "output", "tip.position", unit="m", rule="bus"),
    variable("push", "input", "tip.force", rule="bus"),
    variable("other", "input"),
]
TRACKER = [variable("place", "input", "tip.position", unit="mm")]
RIG = catalog(sleeve=SLEEVE, second=SLEEVE, instrument=INSTRUMENT, tracker=TRACKER)


def system(*connections, members=RIG):
    return CoupledSystem(
        members, [Connection(*c.split(" -> "), where=f"s.yaml:{i}") for i, c in enumerate(connections)]
    )


def shown(links):
    return {(*one.source.key, one.source.first, *one.target.key, one.target.first, one.factor) for one in links}


def test_two_terminals_stand_for_their_pairs_whichever_is_named_first():
    """An element is that of each array; the direction is that of the causalities."""
    single = system("sleeve.limit -> instrument.limits[2]", "instrument.forces[2] -> sleeve.load").links()
    assert shown(system("sleeve.grip -> instrument.grip[2]").links()) == shown(single)
    assert shown(system("instrument.grip[2] -> sleeve.grip").links()) == shown(single)
    assert {one.factor for one in single} == {1.0, 1e-3}


def test_members_of_a_bus_may_be_missing_on_the_other_side():
    (link,) = system("instrument.tip -> tracker.tip").links()
    assert (link.source.key, link.target.key) == (("instrument", "depth"), ("tracker", "place"))
    assert link.factor == 1e3


def test_the_same_terminal_may_be_connected_twice_as_long_as_no_input_has_two_sources():
    both = system("sleeve.grip -> instrument.grip[1]", "second.grip -> instrument.grip[2]").links()
    assert len(both) == 4


def test_an_input_with_two_sources_names_both_lines():
    (first, second) = ("sleeve.grip -> instrument.grip[1]", "second.limit -> instrument.limits[1]")
    (problem,) = system(first, second).check()
    assert problem == (
        "s.yaml:1: instrument.limits[1] has two sources, sleeve.limit and second.limit "
        f"(the first: s.yaml:0, {first}). Keep one."
    )
    (problem,) = system(second, first).check()
    assert problem == (
        f"s.yaml:1: {first}: instrument.limits[1] has two sources, second.limit and sleeve.limit "
        "(the first: s.yaml:0). Keep one."
    )


@every_case(
    ("connection", "message"),
    [
        ("sleeve.grip -> tracker.tip", "no partner at the other side for limit, force of sleeve.grip and position of"),
        ("instrument.tip -> second.grip", "no partner at the other side for limit of second.grip."),
        ("sleeve.grip -> second.grip", "limit: neither sleeve.limit nor second.limit is an input."),
        ("sleeve.grip -> second.grip", "force: both sleeve.load and second.load are inputs."),
        ("sleeve.grip -> instrument.grip", "sleeve.limit -> instrument.limits: 1 values do not fit 2."),
        ("sleeve.grip -> instrument.grip[3]", "instrument.grip[3]: limits has shape [2], elements count from 1."),
        ("sleeve.grip -> instrument.grip[1,1]", "instrument.grip[1,1]: limits has shape [2]"),
        ("sleeve.grip[1] -> instrument.grip[1]", "sleeve.grip[1]: none of its variables is an array."),
        ("sleeve.grip -> instrument.other", "sleeve.grip is a terminal, instrument.other is a variable."),
        ("sleeve.limit -> instrument.grip[1]", "instrument.grip[1] is a terminal, sleeve.limit is a variable."),
        ("sleeve.gripp -> instrument.grip[1]", "sleeve has no variable 'gripp'. Did you mean 'grip'?"),
        ("sleeve.grip -> instrumint.grip[1]", "no member 'instrumint'. Did you mean 'instrument'?"),
    ],
)
def test_what_does_not_fit_is_told_with_the_terminals(connection, message):
    problems = system(connection).check()
    assert any(message in problem for problem in problems), problems
    assert all(one.startswith(f"s.yaml:0: {connection}: ") and "\n" not in one for one in problems)
    with pytest.raises(CouplingError):
        system(connection).links()


def test_units_and_types_are_checked_like_single_connections():
    members = catalog(a=[variable("y", "output", "t.x", unit="m")], b=[variable("u", "input", "t.x", unit="N")])
    (problem,) = system("a.t -> b.t", members=members).check()
    (single,) = system("a.y -> b.u", members=members).check()
    assert problem == single.replace("s.yaml:0: ", "s.yaml:0: a.t -> b.t: ")


def test_a_bus_with_nothing_in_common():
    members = catalog(a=[variable("y", "output", "t.x", rule="bus")], b=[variable("u", "input", "t.z", rule="bus")])
    assert "nothing in common: x and z" in system("a.t -> b.t", members=members).check()[0]


@every_case(
    ("one", "other", "message"),
    [
        ("inflow", "outflow", ""),
        ("signal", "inflow", ""),
        ("inflow", "inflow", "x: a.y and b.u both count what flows in: one is minus the other."),
        ("stream", "stream", "are of the kind 'stream', whose values are not just copied."),
        ("signal", "org.example", "are of the kind 'org.example'"),
    ],
)
def test_flows_of_fmi(one, other, message):
    """A connection copies, and what flows into one side flows out of the other."""
    members = catalog(a=[variable("y", "output", "t.x", kind=one)], b=[variable("u", "input", "t.x", kind=other)])
    problems = system("a.t -> b.t", members=members).check()
    assert message in problems[0] if message else not problems


def test_an_unknown_matching_rule():
    members = catalog(
        a=[variable("y", "output", "t.x", rule="org.bus")], b=[variable("u", "input", "t.x", rule="org.bus")]
    )
    (problem,) = system("a.t -> b.t", members=members).check()
    assert "a.t has the matching rule 'org.bus'. Connect its variables one by one." in problem


def test_components_show_their_terminals():
    from fmus.actuators.servomotor.model import Servomotor

    places = {name: {p.terminal: p for p in one.terminals} for name, one in declared_variables(Servomotor).items()}
    assert places["position"]["rod"] == TerminalMember("rod", "position", "plug")
    assert places["current"] == {"drive": TerminalMember("drive", "current", "bus")}
    assert places["mass"] == {}


SIDES = st.dictionaries(st.sampled_from("abcdef"), st.sampled_from(["input", "output"]), min_size=1)


@pytest.mark.slow
@given(one=SIDES, more=st.sets(st.sampled_from("abcdef")), order=st.randoms(use_true_random=False))
def test_any_two_that_mirror_each_other_fit_in_any_order(one, more, order):
    """The links of a connection of terminals are those of its single ones; what only a bus has is left alone."""
    mirrored = {"input": "output", "output": "input"}
    left = [variable(f"l{n}", side, f"t.{n}") for n, side in one.items()]
    right = [variable(f"r{n}", mirrored[side], f"t.{n}", rule="bus") for n, side in one.items()]
    right += [variable(f"s{n}", "input", f"t.{n}", rule="bus") for n in more - one.keys()]
    order.shuffle(left)
    order.shuffle(right)
    members = catalog(l=left, r=right)
    single = [f"l.l{n} -> r.r{n}" if side == "output" else f"r.r{n} -> l.l{n}" for n, side in one.items()]
    wanted = shown(system(*single, members=members).links())
    assert shown(system("l.t -> r.t", members=members).links()) == wanted
    assert shown(system("r.t -> l.t", members=members).links()) == wanted
