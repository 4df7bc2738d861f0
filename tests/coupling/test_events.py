"""Events between members with clocks: the sequence of calls, what ends it, and the values that are moved."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling import Algorithm, Connection, CoupledSystem, MemberVariable
from twin.coupling.events import ERROR, INSTANTS, OK, SWEEPS, Events, check_supported, split_links
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.value_memory import bits
from twin.errors import CouplingError, SimulationError

MS = 1_000_000
FLOAT, OBJECT = np.dtype(np.float64), np.dtype(object)


def variable(name, causality, kind="Float64", interval="", shape=()):
    dtype = {"Clock": np.dtype(np.bool_), "String": OBJECT}.get(kind, FLOAT)
    return MemberVariable(name, causality, "discrete", kind, dtype, shape, interval=interval)


class Part:
    """A member with clocks. `due`: times of its clock `c`; `changes`, `more`: answers of `evaluate` and `finish`, then no.

    `fires`: whether its output clock `o` ticks whenever its clock `i` does.
    """

    clocked, has_fmu_state, period_ns = True, False, 0

    def __init__(self, name, journal, due=(), changes=(), more=(), news=(), fires=False, strings=("",)):
        self.name, self.journal = name, journal
        self.times, self.changes, self.more, self.news, self.fires = list(due), list(changes), list(more), news, fires
        self.ended, self.has_jumped, self.event_time = False, False, None
        own = [variable("c", "input", "Clock", "constant"), variable("i", "input", "Clock"), variable("u", "input")]
        own += [variable("o", "output", "Clock"), variable("y", "output")]
        own += [variable(n, c, "String", shape=(len(strings),)) for n, c in (("s", "input"), ("r", "output"))]
        self.variables = {v.name: v for v in own}
        self.texts = {n: SimpleNamespace(values=np.array(strings, object)) for n in "sr"}
        self.ticked = False

    def note(self, call):
        self.journal.append(f"{self.name} {call}")

    def slot(self, name):
        return self.texts[name]

    @property
    def due(self):
        return self.times[0] if self.times else None

    def due_clocks(self, now):
        if self.times and self.times[0] <= now:
            self.times.pop(0)
            return ["c"]
        return []

    def has_news(self, now):
        return now in self.news

    def enter_events(self, now):
        self.note(f"enters at {now // MS}")

    def tick(self, name, now):
        self.note(f"ticks {name}")
        self.ticked = self.fires and name == "i"
        return name == "c"

    def evaluate(self, now):
        self.note("evaluates")
        return self.changes.pop(0) if self.changes else False

    def ticked_clocks(self):
        ticked, self.ticked = self.ticked, False
        return ["o"] if ticked else []

    def finish(self, now):
        self.note("finishes")
        return self.more.pop(0) if self.more else False

    def leave_events(self):
        self.note("leaves")

    def rest(self):
        self.note("rests")


class Other:
    """A member without clocks."""

    clocked = False

    def __init__(self):
        self.variables = {"y": variable("y", "output"), "u": variable("u", "input")}


def made(*parts, wires=(), is_part=False):
    """Event handling of parts behind another member, and the times after which the next steps were planned."""
    members = {"other": Other(), **{part.name: part for part in parts}}
    catalog = {name: member.variables for name, member in members.items()}
    links = CoupledSystem(catalog, [Connection(*wire.split(" -> ")) for wire in wires]).links()
    found = Events(members, *split_links(links))
    found.checked = []
    found.steps = SimpleNamespace(is_part=is_part, time=lambda: 7 * MS, check=found.checked.append)
    return found


def test_an_event_is_an_instant_for_all_until_nothing_changes():
    """The clock of `a` ticks, along its wire that of `b`, whose own output clock lets `a` tick in the same instant."""
    journal = []
    a, b = Part("a", journal, due=[5 * MS], changes=[True]), Part("b", journal, more=[True], fires=True)
    events = made(a, b, wires=["a.c -> b.i", "b.o -> a.i", "other.y -> a.u", "a.y -> b.u"])
    assert (events.due, events.upcoming, events.index) == (5 * MS, 5 * MS, 1)
    events.look(5 * MS)
    sweep = ["a evaluates", "b evaluates"]
    assert journal == [
        *("a rests", "b rests", "a enters at 5", "b enters at 5"),
        *("a ticks c", "b ticks i"),
        *("a evaluates", "b evaluates", "a ticks i", *sweep),  # the second one changes nothing
        *("a finishes", "b finishes"),
        *sweep,  # another instant, which `b` has asked for
        *("a finishes", "b finishes"),
        *sweep,
        *("a leaves", "b leaves"),
    ]
    assert (events.now, events.checked, events.due) == (5 * MS, [5 * MS], None)
    assert [link.target.key for link in events.links] == [("a", "u"), ("b", "u")]


@every_case(
    ("due", "news", "now", "happens"),
    [
        ([], (), 5, False),
        ([5 * MS], (), 5 * MS - 1, False),
        ([5 * MS], (), 5 * MS, True),
        ([5 * MS], (), 5 * MS + 1, True),
        ([9 * MS], (5 * MS,), 5 * MS, True),
        ([], (5 * MS,), 5 * MS, True),
    ],
)
def test_what_is_an_event(due, news, now, happens):
    journal = []
    events = made(Part("a", journal), Part("b", journal, due=due, news=news))
    events.look(now)
    assert ("a leaves" in journal) == ("b leaves" in journal) == happens
    assert events.checked == ([now] if happens else [])


def test_clocks_rest_when_a_communication_step_begins_and_at_no_other_point():
    journal = []
    events = made(Part("a", journal), is_part=True)
    events.look(MS)
    events.look(2 * MS)
    assert journal == ["a rests"], "the second part of a step"
    events.steps.is_part = False
    events.look(3 * MS)
    events.look(4 * MS)
    assert journal == ["a rests"] * 2


def test_ticks_of_an_event_from_outside_belong_to_the_next_step():
    journal = []
    events = made(Part("a", journal))
    events.interfere(MS)
    assert journal == ["a rests", "a enters at 1", "a evaluates", "a finishes", "a evaluates", "a leaves"]
    events.interfere(MS)
    events.look(2 * MS)
    assert journal.count("a rests") == 1
    assert events.checked == [MS, MS]


def test_the_next_event_is_the_first_tick_or_announcement_of_any_member():
    a, b, c = Part("a", []), Part("b", [], due=[8 * MS]), Part("c", [], due=[6 * MS])
    events = made(a, b, c)
    assert (events.due, events.upcoming) == (6 * MS, 6 * MS)
    a.event_time = 7 * MS
    assert events.upcoming == 6 * MS
    b.event_time = 3 * MS
    assert (events.due, events.upcoming) == (6 * MS, 3 * MS)
    assert made().upcoming is None


def test_a_member_that_ends_the_simulation_ends_the_event():
    journal = []
    a, b = Part("a", journal, more=[True] * 9), Part("b", journal)
    events = made(a, b)
    assert events.ended == ""
    b.ended = True
    events.react(MS)
    assert events.ended == "b"
    assert journal[-4:] == ["a finishes", "b finishes", "a leaves", "b leaves"]
    assert journal.count("a finishes") == 1


@pytest.mark.parametrize(
    ("options", "calls", "message"),
    [
        (
            {"more": [True] * INSTANTS},
            f"finishes {INSTANTS}",
            "a, b: the event at t = 2 ms has no end after 100 instants.",
        ),
        (
            {"changes": [True] * SWEEPS},
            f"evaluates {SWEEPS}",
            "a, b: values and clocks at t = 2 ms change each other without end, 100 times. Break the loop.",
        ),
    ],
)
def test_an_event_without_end_is_told(options, calls, message):
    journal = []
    events = made(Part("a", journal, **options), Part("b", journal))
    with pytest.raises(SimulationError) as caught:
        events.react(2 * MS)
    assert str(caught.value).startswith(message)
    assert str(caught.value).count("2 ms") == 1
    name, count = calls.split()
    assert journal.count(f"a {name}") == int(count)


@pytest.mark.parametrize(("option", "count"), [("more", INSTANTS - 2), ("changes", SWEEPS - 1)])
def test_one_that_just_ends_is_no_error(option, count):
    """The last one but one asks for the last, in which nothing happens."""
    a = Part("a", [], **{option: [True] * count})
    made(a).react(MS)
    assert a.journal[-1] == "a leaves"


def test_what_a_member_says_in_an_event_gets_its_time():
    a = Part("a", [])
    a.finish = lambda now: (_ for _ in ()).throw(SimulationError("a: refuses."))
    events = made(a)
    with pytest.raises(SimulationError, match=r"^a: refuses. That was in the event at t = 3 ms.$"):
        events.react(3 * MS)
    assert events._call() == OK, "there is no event at that time"
    a.news = (7 * MS,)
    assert events._call() == ERROR
    assert str(events.failure) == "a: refuses. That was in the event at t = 7 ms."


def test_values_reach_inputs_by_the_rows_of_the_loop_and_texts_element_by_element():
    values, targets = np.array([1.5, 2.5, 4.0]), np.zeros(3)
    at = targets.ctypes.data
    converts = np.array([[0] * 7, [values.ctypes.data, KINDS["f8"], at, KINDS["f8"], 1, bits(10.0), bits(1.0)]])
    arrays = {"converts": converts, "copies": np.array([[values.ctypes.data + 8, at + 8, 2]], np.int64)}
    rows = {("a", "u"): [("converts", 1)], ("b", "u"): [("copies", 0)], ("b", "s"): [("copies", 0)]}
    a, b = Part("a", [], strings=("p", "q")), Part("b", [], strings=("", "x"))
    events = made(a, b, wires=["other.y -> a.u", "a.y -> b.u", "a.r[2] -> b.s[1]", "other.y -> other.u"])
    events.connect(SimpleNamespace(rows_at_events=lambda key: rows.get(key, [])), arrays)
    assert [events._rows[name] for name in "ab"] == [[("converts", 1)], [("copies", 0)]]
    events.look(MS)
    assert targets.tolist() == [16.0, 2.5, 4.0]
    assert b.texts["s"].values.tolist() == ["q", "x"]
    assert a.texts["s"].values.tolist() == ["p", "q"]


CLOCKS = [variable("c", "input", "Clock", "constant"), variable("i", "input", "Clock"), variable("y", "output")]


def checked(algorithm="jacobi", clocked=(True, True), states=True, period=0, periods=(MS, MS)):
    """Check two members, the first of which lets the second tick."""
    variables = {v.name: v for v in CLOCKS}
    members = {
        name: SimpleNamespace(clocked=has, has_fmu_state=states, period_ns=period, variables=variables)
        for name, has in zip("ab", clocked, strict=True)
    }
    wires = CoupledSystem({"a": variables, "b": variables}, [Connection("a.c", "b.i")]).links()
    assert split_links(wires) == ([], wires)
    check_supported(members, wires, Algorithm(algorithm), dict(zip("ab", periods, strict=True)), MS)


ITERATIVE, ORDER = {"name": "iterative"}, {"name": "jacobi", "order": 1}


@every_case(
    ("options", "message"),
    [
        ({}, ""),
        ({"states": False, "period": MS}, ""),
        ({"algorithm": ITERATIVE}, ""),
        ({"algorithm": ORDER, "states": False}, ""),
        (
            {"clocked": (False, True)},
            "a.c -> b.i: clocks are connected in Co-Simulation and in Scheduled Execution only",
        ),
        (
            {"clocked": (True, False)},
            "a.c -> b.i: clocks are connected in Co-Simulation and in Scheduled Execution only",
        ),
        ({"algorithm": ITERATIVE, "states": False}, "a: has clocks and cannot save its state .* algorithm iterative"),
        ({"algorithm": ORDER, "period": MS}, "a: has clocks and makes steps of one length only, .* algorithm jacobi"),
        ({"algorithm": ITERATIVE, "period": MS}, "a: has clocks and makes steps of one length only"),
        ({"periods": (MS, 2 * MS)}, "b: has clocks, so it steps with every communication step of 1 ms, not every 2 ms"),
    ],
)
def test_which_members_may_have_clocks(options, message):
    if not message:
        checked(**options)
        return
    with pytest.raises(CouplingError, match=message):
        checked(**options)
