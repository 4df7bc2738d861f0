"""Tables of the loop for members whose memory and calls are numbers that a test chooses."""

from types import SimpleNamespace

import numpy as np

from tests.every_case import every_case
from twin.compiler import machine
from twin.coupling import Connection, CoupledSystem, MemberVariable
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.loop_tables import Tables
from twin.coupling.execution.plan import LoopPlan
from twin.coupling.execution.value_memory import bits, view
from twin.coupling.member import Access

MS = 1_000_000
GET, SET, STEP = 1000, 2000, 3000
TYPES = {"f8": "Float64", "f4": "Float32", "i4": "Int32", "b1": "Boolean", "i8": "Int64"}


def variable(name, causality, code="f8", shape=(), reference=0, **more):
    dtype = np.dtype("?" if code == "b1" else code)
    return MemberVariable(name, causality, "continuous", TYPES[code], dtype, shape, references=(reference,), **more)


class Fake:
    """A member; `base`: address of its record, or 0 for one that is read and written by calls."""

    writes_flags, may_return_early, step_name, step_signature = True, False, "step", 5

    def __init__(self, number, *variables, base=0):
        self.variables, self.base, self.instance, self.step_function = {}, base, 10 + number, STEP + number
        at = base
        self.offsets, self.values = {}, {}
        for each in variables:
            self.variables[each.name], self.offsets[each.name] = each, at
            self.values[each.name] = np.full(each.shape, 1.0 + number)
            at += -(-each.size * each.dtype.itemsize // 8) * 8

    def address(self, name):
        return self.offsets[name] if self.base else 0

    def get(self, name):
        return self.values[name]

    def access(self, names, write):
        chosen = [self.variables[name] for name in names]
        references = np.array([one.references[0] for one in chosen], np.uint32)
        function, name = (SET, "set") if write else (GET, "get")
        return Access(function + self.instance, references, len(names), sum(one.size for one in chosen), name)


def planned(members, wires, order=None, recorded=(), watched=(), periods=None, **fields):
    catalog = {name: member.variables for name, member in members.items()}
    connections = [Connection(*wire.split(" -> ")) if isinstance(wire, str) else wire for wire in wires]
    periods = {name: (periods or {}).get(name, MS) for name in members}
    plan = LoopPlan(members, MS, periods, **fields)
    plan.build(order or [list(members)], CoupledSystem(catalog, connections).links(), list(recorded), watched)
    return plan


def records():
    """A record at 400 with a vector, a small real, a switch and inputs; another one at 800."""
    a = Fake(
        0,
        variable("y", "output", shape=(3,)),
        variable("s", "output", "f4"),
        variable("b", "output", "b1"),
        variable("u", "input", shape=(2,)),
        base=400,
    )
    b = Fake(1, variable("y", "output"), variable("u", "input", shape=(3,)), variable("n", "input", "i4"), base=800)
    return {"a": a, "b": b}


@every_case(
    ("wire", "copies", "converts"),
    [
        ("a.y -> b.u", [[400, 808, 3]], []),
        ("a.y[2] -> b.u[3]", [[408, 824, 1]], []),
        ("b.y -> a.u[2]", [[800, 448, 1]], []),
        ("a.s -> b.u[2]", [], [[424, KINDS["f4"], 816, KINDS["f8"], 1, bits(1.0), bits(0.0)]]),
        ("a.b -> b.n", [], [[432, KINDS["b1"], 832, KINDS["i4"], 1, bits(1.0), bits(0.0)]]),
        (
            Connection("a.y", "b.u", factor=2.0, offset=-1.0),
            [],
            [[400, KINDS["f8"], 808, KINDS["f8"], 3, bits(2.0), bits(-1.0)]],
        ),
        (
            Connection("a.y[3]", "b.u[1]", offset=0.5),
            [],
            [[416, KINDS["f8"], 808, KINDS["f8"], 1, bits(1.0), bits(0.5)]],
        ),
    ],
)
def test_a_connection_of_records_is_a_copy_or_a_conversion(wire, copies, converts):
    plan = planned(records(), [wire])
    assert (plan.copies, plan.converts, plan.accesses) == (copies, converts, [])
    table, count = ("copies", len(copies)) if copies else ("converts", len(converts))
    (operation,) = plan.operations
    assert operation[table] == (0, count)
    assert (operation["steps"], operation["divider"], operation["h"]) == ((0, 2), 1, bits(1e-3))


def test_readers_and_writers_know_the_rows_of_a_connection():
    plan = planned(records(), ["a.y[2] -> b.u[3]", "a.y[1] -> b.u[1]", "a.s -> b.u[2]"])
    assert plan.readers == {("a", "y"): [("copies", 0, 0, 8), ("copies", 1, 0, 0)], ("a", "s"): [("converts", 0, 0, 0)]}
    assert plan.writers == {("b", "u"): [("copies", 0, 0, 16), ("copies", 1, 0, 0), ("converts", 0, 0, 8)]}
    assert plan.rows_at_events(("b", "u")) == [("copies", 0), ("copies", 1), ("converts", 0)]
    assert plan.rows_at_events(("a", "u")) == []


def test_a_row_of_a_recording_has_the_tick_then_a_word_for_each_scalar():
    recorded = [("a", "y"), ("a", "b"), ("b", "y"), ("a", "s")]
    plan = planned(records(), [], recorded=recorded)
    assert plan.records == [[400, 8, 3], [800, 40, 1]]
    one = [1, bits(1.0), bits(0.0)]
    assert plan.converts == [
        [432, KINDS["b1"], 32, KINDS["i8"], *one],
        [424, KINDS["f4"], 48, KINDS["f8"], *one],
    ]
    assert plan.columns == [
        (key, word, size) for key, word, size in zip(recorded, (1, 4, 5, 6), (3, 1, 1, 1), strict=True)
    ]
    assert (plan.row_words, plan.record_converts) == (7, (0, 2))
    assert plan.readers[("a", "y")] == [("records", 0, 0, 0)]
    assert plan.readers[("a", "s")] == [("converts", 1, 0, 0)]
    wired = planned(records(), ["a.s -> b.u[2]"], recorded=[("a", "b")])
    assert wired.record_converts == (1, 2), "after those of the connections"


def test_a_slow_record_publishes_copies_when_its_period_is_over():
    """Of a vector, and of a switch within a word; its inputs are taken every third point."""
    members = records()
    plan = planned(
        members,
        ["a.y[2] -> b.u[1]", "b.y -> a.u[1]"],
        recorded=[("a", "b")],
        periods={"a": 3 * MS},
    )
    (y, words), (switch, _) = (plan.publishes["a"][i][1:] for i in range(2))
    assert plan.publishes["a"] == [[400, y, 3], [432, switch, 1]]
    assert words == 3
    assert plan.published == {("a", "y"): y, ("a", "b"): switch, ("b", "y"): 800}
    assert plan.copies[:2] == [[y + 8, 808, 1], [800, 440, 1]]
    fast, slow = {"divider": 1, "h": bits(1e-3)}, {"divider": 3, "h": bits(3e-3)}
    none = {"converts": (0, 0), "accesses": (0, 0)}
    assert plan.operations == [
        fast | none | {"copies": (0, 1)},
        slow | none | {"copies": (1, 2)},
        fast | {"steps": (0, 1)},
        slow | {"steps": (1, 2)},
        fast | {"shift": 1, "accesses": (0, 0), "copies": (1, 1)},
        slow | {"shift": 1, "accesses": (0, 0), "copies": (2, 4)},
    ]
    assert plan.copies[2:] == plan.publishes["a"]
    assert [row[-1] for row in plan.steps] == [1, 0]
    assert [plan.divider(name) for name in members] == [3, 1]
    assert [plan.is_read_directly(name) for name in members] == [False, True]


def foreign(number=2, **limits):
    """A member that is read and written by calls, one for each type."""
    return Fake(
        number,
        variable("y", "output", shape=(2,), reference=7),
        variable("z", "output", reference=8),
        variable("m", "output", "i4", reference=9),
        variable("u", "input", reference=4, **limits),
        variable("k", "input", "i4", shape=(2,), reference=5),
    )


def test_a_foreign_member_is_read_and_written_by_a_call_for_each_type():
    members = {"r": records()["b"], "f": foreign()}
    wires = ["f.y[2] -> r.u[1]", "f.z -> r.u[3]", "f.m -> r.n", "r.y -> f.u"]
    plan = planned(members, wires, recorded=[("f", "k")])
    reals, whole, staged = plan.published["f", "y"], plan.published["f", "m"], plan.staged["f", "u"]
    assert plan.published["f", "z"] == reals + 16
    setter, getter, other = plan.accesses
    assert setter == [SET + 12, 12, setter[2], 1, staged, 1, 1]
    assert getter == [GET + 12, 12, getter[2], 2, reals, 3, 1]
    assert other == [GET + 12, 12, other[2], 1, whole, 1, 1]
    assert plan.copies == [[reals + 8, 808, 1], [reals + 16, 824, 1], [800, staged, 1]]
    assert plan.converts[0] == [whole, KINDS["i4"], 832, KINDS["i4"], 1, bits(1.0), bits(0.0)]
    assert set(plan.access_names.values()) == {
        ("y (value reference 7)", "z (value reference 8)"),
        ("m (value reference 9)",),
        ("u (value reference 4)",),
    }
    assert plan.functions == {GET + 12: "get", SET + 12: "set"}
    assert plan.steps[0][:3] == [STEP + 1, 5, 11]
    assert [row[-3:] for row in plan.steps] == [[0, 0, 0], [1, 2, 1]], "it is read at once after its step"
    (operation,) = plan.operations
    assert (operation["accesses"], operation["copies"]) == ((0, 1), (0, 3))
    # an input that is recorded as it was set, and that nothing sets
    assert plan.recorded_inputs == {("f", "k")}
    assert plan.published["f", "k"] == plan.buffers["f", "k"]
    assert plan.columns == [(("f", "k"), 1, 2)]


@every_case(
    ("wire", "more", "is_direct"),
    [
        ("g.z -> f.u", {}, True),
        ("g.y[2] -> f.u", {}, True),
        ("r.y -> f.u", {}, False),  # a record's value lies somewhere else at each step
        (Connection("g.z", "f.u", factor=2.0), {}, False),
        (Connection("g.z", "f.u", offset=1.0), {}, False),
        ("g.m -> f.u", {}, False),
        ("g.z -> f.u", {"recorded": [("f", "u")]}, False),
        ("g.z -> f.u", {"maximum": 1.0}, False),
        ("g.m -> f.k[1]", {}, False),  # half of what the call sets
    ],
)
def test_a_setter_may_read_what_a_getter_wrote(wire, more, is_direct):
    limits = {name: value for name, value in more.items() if name == "maximum"}
    members = {"r": records()["b"], "g": foreign(3), "f": foreign(2, **limits)}
    plan = planned(members, [wire], recorded=more.get("recorded", ()))
    target = ("f", "k") if plan.staged.get(("f", "u")) is None else ("f", "u")
    (setter,) = (row for row in plan.accesses if row[0] == SET + 12)
    moves = plan.copies + plan.converts
    if is_direct:
        offset = 8 if "[2]" in wire else 0
        source = ("g", wire.split(" -> ")[0][2])
        assert moves == []
        assert setter[4] == plan.staged[target] == plan.published[source] + offset
        assert plan.readers[source] == [("accesses", 0, 4, offset)]
        assert plan.writers[target] == [("accesses", 0, 4, 0)]
    else:
        assert len(moves) >= 1
        assert setter[4] == plan.buffers[target] == plan.staged[target]


def test_single_elements_that_may_be_replaced_are_published_one_by_one():
    split = frozenset({("a", "y"), ("a", "s")})
    plan = planned(records(), ["a.y[2] -> b.u[1]", "a.s -> b.u[2]"], split=split)
    y, s = plan.published["a", "y"], plan.published["a", "s"]
    assert plan.unsplit == {("a", "y"): 400, ("a", "s"): 424}
    assert plan.copies == [[y + 8, 808, 1], *([400 + 8 * i, y + 8 * i, 1] for i in range(3))]
    assert plan.converts[1:] == [[424, KINDS["f4"], s, KINDS["f4"], 1, bits(1.0), bits(0.0)]]
    assert plan.elements == {("a", "y"): [("copies", 1), ("copies", 2), ("copies", 3)], ("a", "s"): [("converts", 1)]}
    assert [operation.get("shift", 0) for operation in plan.operations] == [0, 1]
    assert (plan.operations[1]["copies"], plan.operations[1]["converts"]) == ((1, 4), (1, 2))


def test_members_of_a_stage_that_others_follow_publish_before_them():
    members = {"f": foreign(), "r": records()["b"]}
    plan = planned(members, ["f.y[1] -> r.u[1]", "r.y -> f.u"], [["f"], ["r"]])
    assert [operation["steps"] for operation in plan.operations] == [(0, 1), (1, 2)]
    assert [operation["copies"] for operation in plan.operations] == [(0, 1), (1, 2)]
    assert plan.steps[0][-3:] == [1, 1, 0]


def test_the_events_of_clocks_are_a_call_at_the_end():
    events = SimpleNamespace(address=99, index=1)
    plan = planned(records(), ["a.y -> b.u"], events=events)
    assert plan.accesses == [[99, 0, 0, 0, 0, 0, 1]]
    assert plan.operations[-1] == {"divider": 1, "h": 0, "accesses": (0, 1)}
    assert plan.functions == {99: "events"}


def test_flags_are_shared_by_members_that_write_none():
    members = records() | {"c": foreign(2), "d": foreign(3)}
    members["a"].writes_flags = members["c"].writes_flags = False
    plan = planned(members, [])
    flags = [row[3] for row in plan.steps]
    assert flags[0] == flags[2] == plan.no_flags
    assert len(set(flags)) == 3
    assert min(abs(one - other) for one in set(flags) for other in set(flags) - {one}) >= 32


def test_tables_have_the_rows_and_their_addresses():
    members = {"f": foreign(), "r": records()["b"]}
    members["f"].may_return_early = True
    plan = planned(
        members, ["f.y[1] -> r.u[1]", "r.y -> f.u"], recorded=[("r", "y"), ("f", "m")], periods={"r": 2 * MS}
    )
    tables = Tables(plan, members)
    arrays = tables.arrays
    assert {name: array.shape for name, array in arrays.items()} == {
        "copies": (len(plan.copies), 3),
        "converts": (1, 7),
        "accesses": (3, 7),
        "steps": (2, 7),
        "records": (1, 3),
        "instructions": (1, 1),
    }
    rows = plan.operation_rows(arrays)
    assert rows.shape == (len(plan.operations), 11)
    for row, operation in zip(rows.tolist(), plan.operations, strict=True):
        assert row[:3] == [operation["divider"], operation.get("shift", 0), operation["h"]]
        for at, name in zip(range(3, 11, 2), ("copies", "converts", "accesses", "steps"), strict=True):
            begin, end = operation.get(name, (0, 0))
            assert row[at : at + 2] == [arrays[name].ctypes.data + begin * arrays[name].strides[0], end - begin]
    get_columns = arrays["steps"][:, -3].tolist()
    assert get_columns == [arrays["accesses"].ctypes.data + 56 * row[-3] for row in plan.steps]
    calls = plan.calls(arrays)
    assert list(calls.values()) == [("f", "set"), ("f", "get"), ("f", "get"), ("f", "step"), ("r", "step")]
    assert list(calls)[:3] == [arrays["accesses"].ctypes.data + 56 * i for i in range(3)]

    tables.publish()
    for key, value in ((("f", "y"), [3.0, 3.0]), (("f", "m"), [3]), (("r", "y"), [2.0])):
        assert view(plan.published[key], members[key[0]].variables[key[1]]).tolist() == value
    assert view(plan.buffers["f", "u"], members["f"].variables["u"]).tolist() == [3.0]
    state = {}
    tables.write_addresses(state)
    assert state["operation_count"] == len(rows)
    assert state["row_bytes"] == 8 * 3
    assert state["record_converts"] == arrays["converts"].ctypes.data
    assert (state["record_convert_count"], state["record_count"], state["early_return_count"]) == (1, 1, 1)
    assert machine.read64(state["early_returns"]) == plan.steps[0][3]
    assert machine.read_float(state["early_returns"] + 8) == 1e-3
    assert machine.read64(state["early_returns"] + 16) == 0
    arrays["copies"][0] = 0
    tables.reset("copies", 0)
    assert arrays["copies"][0].tolist() == plan.copies[0]
