"""Values that are not finite: whose they are, since when, and what is said; rows of limits in the loop's table."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.test_plan import MS, Fake, planned, variable
from tests.every_case import every_case
from twin.coupling import Connection, CoupledSystem
from twin.coupling.execution import finite_value_monitor, loop
from twin.coupling.execution.finite_value_monitor import (
    LINE_NOTE,
    REMEDY,
    FiniteValueMonitor,
    finite_value,
    finite_variables,
)
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.value_memory import ValueMemory, bits

NAN, INF = float("nan"), float("inf")
LARGEST = float(np.finfo(np.float64).max)


class Watched(Fake):
    """A record that can be restored; `driven`: its local variables that are inputs of a part."""

    has_cheap_fmu_state, driven = True, frozenset()

    def __init__(self, name, number, *variables, base=0, **fields):
        super().__init__(number, *variables, base=base)
        self.name, self.log = name, []
        vars(self).update(fields)

    def get(self, name):
        return np.asarray(self.values[name])[()]

    def save(self):
        return {name: np.array(value) for name, value in self.values.items()}

    def restore(self, saved):
        self.values = {name: np.array(value) for name, value in saved.items()}


def chain():
    """Members "a" -> "b" -> "c", each with an input, an output and two local variables, one of them a vector."""
    members = {}
    for number, name in enumerate("abc"):
        members[name] = Watched(
            name,
            number,
            *(variable("u", "input"), variable("y", "output", dependencies=("u",)), variable("x", "local")),
            *(variable("v", "local", shape=(2, 2)), variable("n", "output", "i4"), variable("p", "parameter")),
        )
    wires = [Connection("a.y", "b.u"), Connection("b.y", "c.u")]
    links = CoupledSystem({name: member.variables for name, member in members.items()}, wires).links()
    return members, links


def monitor(exempt=(), **changes):
    members, links = chain()
    for path, value in changes.items():
        name, _, own = path.partition("_")
        members[name].values[own] = np.asarray(value)
    return FiniteValueMonitor(members, links, exempt)


@pytest.mark.parametrize(
    ("cheap", "driven", "names"),
    [(True, (), ["y", "x", "v"]), (False, (), ["y"]), (True, ("x",), ["y", "v"])],
)
def test_values_that_must_be_finite(cheap, driven, names):
    """Real outputs, and for our own members also what they compute inside, unless it is a part's input."""
    member = chain()[0]["a"]
    member.has_cheap_fmu_state, member.driven = cheap, frozenset(driven)
    assert [v.name for v in finite_variables(member)] == names
    watch = FiniteValueMonitor({"a": member, "b": chain()[0]["b"]}, [], ["b"])
    assert {name: [v.name for v in own] for name, own in watch.variables.items()} == {"a": names}
    assert watch.replays is cheap
    assert watch.published() == ([] if cheap else [("a", "y")])
    assert watch.is_saved is not cheap, "nothing is saved that is not needed"
    assert FiniteValueMonitor({"a": member}, [], ["a"]).replays is False


@every_case(
    ("changes", "bad", "source"),
    [
        ({"a_y": NAN}, ["a"], ("a", True)),
        ({"b_y": INF, "c_u": INF, "c_y": NAN}, ["b", "c"], ("b", True)),
        ({"b_u": NAN, "b_y": NAN}, ["b"], ("b", False)),
        ({"a_y": NAN, "b_u": NAN, "b_y": NAN, "c_u": NAN, "c_y": NAN}, ["c", "b", "a"], ("a", True)),
        ({"b_u": NAN, "b_y": NAN, "c_x": NAN}, ["b", "c"], ("c", True)),
    ],
)
def test_the_source_is_the_first_member_with_finite_inputs(changes, bad, source):
    assert monitor(**changes).find_source(bad) == source


def good(text):
    return f"{text}, with finite inputs. {LINE_NOTE}{REMEDY}"


@every_case(
    ("changes", "bad", "text"),
    [
        ({"a_y": NAN}, ["a"], good("a.y is nan at 5 ms")),
        ({"a_x": -INF, "a_y": NAN}, ["a"], good("a.x is -inf at 5 ms (a.y too)")),
        ({"a_v": [[1.0, 2.0], [INF, NAN]]}, ["a"], good("a.v[2,1] is inf at 5 ms")),
        (
            {"a_v": [[1.0, NAN], [1.0, 1.0]], "a_x": NAN, "a_y": NAN},
            ["a"],
            good("a.x is nan at 5 ms (a.y, a.v too)"),
        ),
        ({"b_u": NAN, "b_y": INF}, ["b"], f"b.y is inf at 5 ms, and not all of its inputs are finite. {REMEDY}"),
        ({"a_y": NAN, "b_u": NAN, "b_y": NAN}, ["a", "b"], good("a.y is nan at 5 ms")),
    ],
)
def test_what_is_not_finite_is_told_with_its_element_and_cause(changes, bad, text):
    assert monitor(**changes).described(bad, "at 5 ms") == text


def test_of_a_group_the_part_whose_inputs_are_finite_is_named():
    """Its inner connections are local variables, as which the values of other parts arrive."""
    names = ["one.y", "two.u", "two.y", "three.u", "three.y"]
    group = Watched("g", 0, *(variable(name, "local") for name in names), driven=frozenset(["two.u", "three.u"]))
    group.values = dict(zip(names, (0.0, 0.0, NAN, NAN, NAN), strict=True))
    watch = FiniteValueMonitor({"g": group}, [], ())
    assert watch.described(["g"], "now") == good("g.two.y is nan now")
    group.values["two.u"] = NAN
    assert watch.described(["g"], "now") == good("g.two.y is nan now (g.three.y too)")
    assert [finite_value(group, name) for name in names[:2]] == [True, False]
    group.variables["n"], group.values["n"] = variable("n", "local", "i4"), 3
    assert finite_value(group, "n") is True
    group.values |= {"one.y": NAN, "two.u": 0.0}
    assert watch.described(["g"], "now") == good("g.one.y is nan now (g.two.y too)")
    many = Watched("m", 0, *(variable(name, "output") for name in "abcd"))
    many.values = dict.fromkeys("abcd", NAN)
    expected = good("m.a is nan now (m.b, m.c and others too)")
    assert FiniteValueMonitor({"m": many}, [], ()).described(["m"], "now") == expected


def test_what_was_not_finite_for_a_while_is_found_in_the_recording():
    watch = monitor()
    time = np.array([0.0, 0.1, 0.2])
    clean = {"a.y": np.zeros(3), "b.v": np.zeros((3, 2, 2)), "c.n": np.zeros(3)}
    assert watch.spell([(time, clean)]) == ""
    late = {"a.y": np.array([0.0, 0.0, NAN]), "b.v": np.zeros((3, 2, 2))}
    late["b.v"][1, 0, 1] = INF
    expected = f"b.v was not finite at t = 0.4 s, and later was again. {LINE_NOTE}{REMEDY}"
    assert watch.spell([(time, clean), (time + 0.3, late), (time + 0.6, late)]) == expected
    assert watch.spell([(time, {"other.y": np.full(3, NAN)})]) == ""
    assert monitor(exempt=["b"]).spell([(time, late)]).startswith("a.y was not finite at t = 0.2 s")


def test_the_step_of_a_member_that_gave_a_value_is_named():
    """A controller with a period of 5 ms that divides by zero at 0 s was said to be infinite at 1 ms."""
    watch = monitor(a_y=INF)
    watch.periods = {"a": 5_000_000, "b": 5_000_000}
    first = "a.y is inf at t = 1 ms (in its step from 0 s to 5 ms), with finite inputs"
    assert watch.described(["a"], "at t = 1 ms", 1_000_000).startswith(first)
    assert "step" not in watch.described(["a"], "at t = 1 ms or somewhat before").partition(",")[0]
    recorded = {"b.v": np.zeros((3, 2, 2))}
    recorded["b.v"][1] = INF
    text = watch.spell([(np.array([1.0, 1.005, 1.01]), recorded)])
    assert text.startswith("b.v was not finite at t = 1.005 s (in its step from 1 s to 1.005 s), and later was again.")


class Reader:
    """Whether the values of a member are bad."""

    def __init__(self, bad):
        self.bad = bad

    def is_bad(self):
        return self.bad


@pytest.mark.parametrize(
    ("failed", "cheap", "found"), [("", True, ["a", "b"]), ("a", True, ["a", "b"]), ("a", False, ["b"])]
)
def test_values_of_a_failed_member_count_if_they_lie_in_memory(failed, cheap, found, monkeypatch):
    monkeypatch.setattr(finite_value_monitor, "value_reader", lambda member, _: Reader(member.name != "c"))
    watch = monitor()
    watch.members["a"].has_cheap_fmu_state = cheap
    assert watch.non_finite_members(failed) == found


@pytest.mark.parametrize("first", [3, 4, 7, 10, 11])
def test_the_first_point_is_found_by_bisection(first, monkeypatch):
    """Saved at point 2, not finite at 11; members and log lines are at the point found afterwards."""
    watch, (members, _) = monitor(), chain()
    watch.members = {"a": members["a"]}
    member, runs = members["a"], []
    monkeypatch.setattr(
        watch, "non_finite_members", lambda _failed="": ["a"] if float(member.values["x"]) >= first else []
    )
    plan = SimpleNamespace(memory=ValueMemory([np.array([5])]))
    record = np.zeros(1, loop.RECORD)
    record["tick"], record["limit_count"], record["condition_count"], record["derives"] = 2, 1, 1, 1
    member.values["x"], member.log[:] = np.array(2.0), ["before"]
    watch.save(record, plan)
    assert watch.is_saved
    member.values["x"], plan.memory.blocks[0][:] = np.array(11.0), 9
    member.log.append("later")

    def run(address):
        now = np.ctypeslib.as_array((ctypes.c_uint8 * loop.RECORD.itemsize).from_address(address))
        state = now.view(loop.RECORD)[0]
        runs.append(int(state["stop"]))
        assert all(int(state[name]) == 0 for name in ("limit_count", "condition_count", "derives"))
        assert int(state["every"]) == int(state["limit"]) == 1 << 62, "nothing is recorded"
        assert plan.memory.blocks[0].tolist() == [5]
        assert member.log == ["before"]
        assert float(member.values["x"]) == int(state["tick"]), "from the point that was saved last"
        state["tick"] = state["stop"]
        member.values["x"] = np.array(float(state["stop"]))

    assert watch.find_first_tick(11, run, plan) == first
    assert float(member.values["x"]) == first
    assert runs[-1] == first
    assert len(runs) <= 5
    watch.forget()
    assert not watch.is_saved


def test_rows_of_limits_are_those_of_values_that_cannot_be_checked_later_and_of_bounded_inputs():
    a = Watched("a", 0, variable("y", "output"), variable("z", "output", shape=(2,)), base=400)
    f = Watched(
        "f", 2, variable("y", "output", reference=1), variable("u", "input", reference=2, maximum=2.0, minimum=-1.0)
    )
    a.has_cheap_fmu_state = f.has_cheap_fmu_state = False
    members = {"a": a, "f": f}
    plan = planned(members, ["a.y -> f.u"], watched=[("f", "y")])
    catalog = {name: member.variables for name, member in members.items()}
    watch = FiniteValueMonitor(members, CoupledSystem(catalog, [Connection("a.y", "f.u")]).links(), ())
    rows = watch.rows(plan).tolist()
    finite = [bits(-LARGEST), bits(LARGEST)]
    low, high = f.variables["u"].limits
    assert rows[-1] == [plan.staged["f", "u"], KINDS["f8"], 1, bits(low), bits(high)]
    assert sorted(rows[:-1]) == sorted(
        [
            [400, KINDS["f8"], 1, *finite],
            [408, KINDS["f8"], 2, *finite],
            [plan.published["f", "y"], KINDS["f8"], 1, *finite],
        ]
    )
    assert [watch.row(i) for i in range(4)] == [None, None, None, ("f", "u")]
    assert watch.row_count == 4
    finite_value_monitor.view(plan.staged["f", "u"], f.variables["u"])[:] = 2.5
    assert watch.input_note(("f", "u"), plan, 5 * MS) == (
        "f.u: 2.5 is above the maximum at t = 5 ms, for the first time. Expected -1 to 2."
    )
    a.has_cheap_fmu_state = f.has_cheap_fmu_state = True
    replaying = FiniteValueMonitor(members, [], ())
    assert (replaying.rows(plan).tolist(), replaying.row_count) == ([rows[-1]], 1)
    del plan.staged["f", "u"]
    assert (replaying.rows(plan).tolist(), replaying.row_count) == ([[0] * 5], 0)
