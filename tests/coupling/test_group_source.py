"""Source that is generated for a group, and what it computes: copies, periods, order of equations, start values."""

import numpy as np
import pytest

from tests.coupling.parts import Gain, Lag
from tests.every_case import every_case
from twin.compiler import tangents
from twin.component import Component, Int32, Role, input, output
from twin.coupling import Connection, CoupledSystem, RecordMember
from twin.coupling.component_member import driven
from twin.coupling.groups import group_equations
from twin.coupling.groups.group import compose
from twin.coupling.groups.group_writer import GroupMember, GroupWriter, subscript
from twin.errors import CouplingError

MS = 1_000_000


class Table(Component):
    """Rows of numbers, a switch and a count."""

    u = input("", "in", shape=(2,))
    y = output("mm", "rows", shape=(2, 3))
    on = output("", "switch", start=False)
    n = output("mm", "count", type=Int32)

    def step(self, t, h):
        for i in range(2):
            for j in range(3):
                self.y[i, j] = 10.0 * i + j + self.u[i]
        self.on = self.u[0] > 1.0
        self.n += 1


class Reader(Component):
    """Adds up what it is given."""

    one = input("m", "an element")
    every = input("mm", "all", shape=(2, 3))
    number = input("", "a switch as a number")
    counted = input("m", "a count as a length")
    own = input("", "from outside")
    total = output("m", "sum")

    def step(self, t, h):
        self.total = self.one + self.number + self.own


def links_of(parts, wires):
    catalog = {name: RecordMember(name, part.component()).variables for name, part in parts.items()}
    connections = [
        Connection(*wire.split(" -> ")) if isinstance(wire, str) else Connection(*wire[0].split(" -> "), **wire[1])
        for wire in wires
    ]
    return CoupledSystem(catalog, connections).links()


def parts_of(**periods):
    components = {"table": Table, "reader": Reader}
    return {name: GroupMember(component, {}, periods.get(name, MS)) for name, component in components.items()}


@every_case(
    ("wire", "lines"),
    [
        ("table.y[2,3] -> reader.one", ["    self.reader.one = self.table.y[1, 2] * 0.001 + 0.0"]),
        ("table.y[1,1] -> reader.every[2,2]", ["    self.reader.every[1, 1] = self.table.y[0, 0]"]),
        (
            "table.y -> reader.every",
            [
                "    for i0 in range(2):",
                "        for i1 in range(3):",
                "            self.reader.every[i0, i1] = self.table.y[i0, i1]",
            ],
        ),
        ("table.on -> reader.number", ["    self.reader.number = self.table.on * 1.0"]),
        ("table.n -> reader.every[1,1]", ["    self.reader.every[0, 0] = self.table.n * 1.0"]),
        ("table.n -> reader.counted", ["    self.reader.counted = self.table.n * 0.001 + 0.0"]),
        (
            ("table.on -> reader.number", {"factor": 2.0, "offset": 0.5}),
            ["    self.reader.number = self.table.on * 2.0 + 0.5"],
        ),
        (
            ("table.y[1,2] -> reader.number", {"factor": 2.0, "offset": 0.5, "convert": False}),
            ["    self.reader.number = self.table.y[0, 1] * 2.0 + 0.5"],
        ),
    ],
)
def test_a_connection_is_one_statement_with_its_conversion(wire, lines):
    parts = parts_of()
    links = links_of(parts, [wire])
    (copy,) = GroupWriter(parts, links, MS).copy(links[0])
    assert copy.lines == lines
    assert copy.tangent == [line.replace("self.", "dot.") for line in lines]


@every_case(
    ("shape", "flat", "path"),
    [((), 0, "x"), ((4,), 3, "x[3]"), ((2, 3), 0, "x[0, 0]"), ((2, 3), 4, "x[1, 1]"), ((2, 2, 3), 11, "x[1, 1, 2]")],
)
def test_elements_are_counted_row_by_row(shape, flat, path):
    assert subscript("x", shape, flat) == path


def test_what_a_slow_member_publishes_has_its_own_memory():
    writer = GroupWriter(parts_of(table=2 * MS), [], MS)
    assert [writer.divider(name) for name in ("table", "reader")] == [2, 1]
    paths = [writer.published(("table", name)) for name in ("on", "y", "on", "n")]
    assert paths == ["self._published0[0]", "self._published1", "self._published0[0]", "self._published2[0]"]
    assert writer.published(("reader", "total")) == "self.reader.total"


WIRES = [
    "table.y[2,3] -> reader.one",
    "table.y -> reader.every",
    "table.on -> reader.number",
    ("table.n -> reader.counted", {"factor": 3.0}),
]


def started(part):
    """Status of the start."""
    return type(part)._functions[0](part, 0.0)


def grouped(parts, wires, stages, outputs):
    return compose("g", parts, links_of(parts, wires), MS, stages, outputs)


def test_a_group_of_a_slow_and_a_fast_member():
    """The table steps every second time, and what it publishes is seen from the end of its period on."""
    parts = parts_of(table=2 * MS)
    cls = grouped(parts, WIRES, [["table"], ["reader"]], [("reader", "total"), ("table", "on")])
    assert (cls.period_ns, cls.__doc__) == (
        MS,
        "table, reader as one component.\n\nMade from components coupled at 1 ms.",
    )
    roles = {name: [v.name for v in cls.variables if v.role is role] for name, role in Role.__members__.items()}
    assert roles["input"] == ["table.u", "reader.own"]
    assert roles["output"] == ["table.on", "reader.total"]
    assert len(roles["local"]) == 6
    part = cls()
    part.views["table.u"][...] = 2.0, 5.0
    part.views["reader.own"][...] = 100.0
    assert started(part) == 0
    rows = []
    for tick in range(5):
        assert part.advance(tick * 1e-3, 1e-3) == 0
        rows.append([float(part.views["reader.total"]), bool(part.views["table.on"]), float(part.reader.counted)])
    first, later = [100.0, False, 0.0], 0.001 * (10 + 2 + 5) + 1.0 + 100.0
    assert rows == [
        first,
        *([later, True, 3 * 0.001 * 1] for _ in range(2)),
        *([later, True, 0.003 * 2] for _ in range(2)),
    ]
    assert part.reader.every.tolist() == [[2.0, 3.0, 4.0], [15.0, 16.0, 17.0]]
    assert started(part) == 0
    assert part.advance(0.0, 1e-3) == 0
    assert int(part.table.n) == 4, "its own ticks count from the start again"


def test_start_values_are_those_of_the_scenario_or_of_the_declaration():
    parts = {
        "lag": GroupMember(Lag, {"x": 2.0}, MS),
        "gain": GroupMember(Gain, {"k": 3.0}, MS),
        "table": GroupMember(Table, {"u": 4.0}, MS),
    }
    cls = grouped(parts, ["lag.y -> gain.u"], [["lag", "gain", "table"]], [("gain", "y")])
    starts = {name: np.asarray(value).tolist() for name, value in cls.start_values().items()}
    assert starts["lag.x"] == 2.0
    assert (starts["gain.k"], starts["gain.c"], starts["lag.time_constant"]) == (3.0, 1.0, 0.1)
    assert (starts["table.u"], starts["table.on"]) == ([4.0, 4.0], False)
    part = cls(**{"gain.c": 7.0})
    assert {name: part.views[name].tolist() for name in starts} == starts | {"gain.c": 7.0}
    part.views["table.y"][...] = 1.0
    assert part.table.y.tolist() == [[1.0] * 3] * 2, "the member's record lies in the group's"
    assert part.record.shape == (1,)


def equations(wires, values=(), outputs=(("last", "y"),)):
    """A group of a lag and two gains of 0.5 u + 1, one after the other."""
    components = {"lag": Lag, "gain": Gain, "last": Gain}
    parts = {name: GroupMember(component, dict(values), MS) for name, component in components.items()}
    return compose("g", parts, links_of(parts, wires), MS, [["lag"], ["gain"], ["last"]], list(outputs))


def test_equations_are_evaluated_after_those_whose_values_they_need():
    """A member is evaluated again when its inputs have changed since: the lag, whose output needs its state only."""
    cls = equations(["gain.y -> lag.u", "gain.y -> last.u", "lag.y -> gain.u"])
    assert cls.text.partition("def evaluate(self, t):\n")[2].splitlines() == [
        "    status = 0",
        "    status = max(status, evaluate_lag(self.lag, t))",
        "    self.gain.u = self.lag.y",
        "    status = max(status, evaluate_gain(self.gain, t))",
        "    self.lag.u = self.gain.y",
        "    self.last.u = self.gain.y",
        "    status = max(status, evaluate_lag(self.lag, t))",
        "    status = max(status, evaluate_last(self.last, t))",
        "    return status",
    ]
    constants = {"gain.k", "gain.c"}
    assert cls.flows["last.y"] == constants | {"last.k", "last.c"}
    assert cls.flows["lag.der_x"] == constants | {"lag.time_constant"}
    assert cls.flows["gain.u"] == frozenset()
    assert cls.reaches["last.y"] == {"lag.x"}
    part = cls(**{"lag.x": 8.0})
    assert started(part) == 0
    assert cls._evaluation(part, 0.0) == 0
    assert part.views["gain.y"] == 0.5 * 8.0 + 1.0
    assert part.views["last.y"] == 0.5 * 5.0 + 1.0
    assert part.views["lag.der_x"] == pytest.approx((5.0 - 8.0) / 0.1)


def test_tangents_of_a_group_are_those_of_its_members_one_after_the_other():
    """A change of 2 of the state, with gains of 0.5, whose offsets and those of the connections do not count."""
    wires = ["lag.y -> gain.u", ("gain.y -> last.u", {"factor": -3.0, "offset": 10.0})]
    cls = equations(wires, outputs=[("last", "y"), ("gain", "y")])
    part, dot = cls(**{"lag.x": 8.0}), cls()
    for view in dot.views.values():
        view[...] = 0.0
    dot.views["lag.x"][...] = 2.0
    assert cls._tangents.at(part, dot, 0.0, 0.0) == 0
    assert part.views["last.y"] == 0.5 * (-3.0 * 5.0 + 10.0) + 1.0
    assert dot.views["gain.y"] == 0.5 * 2.0
    assert dot.views["last.y"] == 0.5 * -3.0 * 1.0
    assert dot.views["lag.der_x"] == pytest.approx(-2.0 / 0.1)


def test_a_group_has_no_tangents_if_a_member_has_none(monkeypatch):
    def some(component):
        return "it is not smooth" if component is Gain else tangents(component)

    monkeypatch.setattr(group_equations, "tangents", some)
    assert equations(["lag.y -> gain.u"])._tangents == "gain: it is not smooth"
    monkeypatch.setattr(group_equations, "order", lambda *given: None if len(given) > 2 else [])
    monkeypatch.setattr(group_equations, "tangents", tangents)
    assert equations(["lag.y -> gain.u"])._tangents == "its initialization goes around in a loop"


def test_a_group_has_equations_unless_a_period_or_a_loop_forbids():
    assert "def evaluate" in equations(["lag.y -> gain.u"]).text
    assert "def evaluate" not in equations(["gain.y -> last.u", "last.y -> gain.u"]).text
    parts = {"lag": GroupMember(Lag, {}, 2 * MS), "gain": GroupMember(Gain, {}, MS)}
    assert "def evaluate" not in compose("g", parts, [], MS, [["lag", "gain"]], [("gain", "y")]).text
    assert "def evaluate" not in grouped(parts_of(), [], [["table", "reader"]], [("reader", "total")]).text


def test_a_loop_at_the_start_is_solved_by_substitution():
    """y = 0.5 (0.5 y + 1) + 1, so y = 2."""
    cls = equations(["gain.y -> last.u", "last.y -> gain.u"])
    part = cls()
    assert started(part) == 0
    assert float(part.views["last.y"]) == pytest.approx(2.0, abs=1e-11)
    assert float(part.views["gain.u"]) == pytest.approx(2.0, abs=1e-11)
    diverging = equations(["gain.y -> last.u", "last.y -> gain.u"], {})
    part = diverging(**{"gain.k": 2.0, "last.k": 2.0})
    assert started(part) == 3, "FMI's error"


def test_a_group_without_outputs_is_refused():
    with pytest.raises(CouplingError, match=r"g: nothing leaves the group\. Add a member whose outputs others read\."):
        compose("g", parts_of(), [], MS, [["table", "reader"]], [])


def test_inputs_of_parts_that_are_driven_inside_are_known_by_their_paths():
    """Also those of a group in a group; one that is open is the group's own input."""
    inner = grouped(
        {"lag": GroupMember(Lag, {}, MS), "gain": GroupMember(Gain, {}, MS)},
        ["lag.y -> gain.u"],
        [["lag", "gain"]],
        [("gain", "y")],
    )
    assert driven(inner) == {"gain.u"}
    outer = grouped(
        {"both": GroupMember(inner, {}, MS), "last": GroupMember(Gain, {}, MS)},
        ["both.gain.y -> last.u"],
        [["both", "last"]],
        [("last", "y")],
    )
    assert driven(outer) == {"both.gain.u", "last.u"}
    assert driven(Gain) == frozenset()
