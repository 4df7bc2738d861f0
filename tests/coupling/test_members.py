"""Members by themselves: bounds and names of variables, saved states, what a component does when something fails."""

import ctypes
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.mock import Mock
from tests.coupling.parts import Bomb, Diverging, Hold, Lag, SlowClock
from tests.every_case import every_case
from twin.compiler import machine
from twin.component import Component, Int32, PythonComponent, input, local, output, parameter, solver, state, terminal
from twin.component.component import resampled
from twin.coupling import Access, MemberVariable, RecordMember, renamed
from twin.coupling import model_exchange_groups as groups
from twin.coupling.component_member import declared_variables, importable_class
from twin.coupling.member import TerminalMember
from twin.errors import CouplingError, SimulationError

FLOAT, SINGLE, INT = np.dtype(np.float64), np.dtype(np.float32), np.dtype(np.int32)


def bounded(low, high, dtype=FLOAT, unit="m", display_unit="mm", shape=()):
    return MemberVariable(
        "u", "input", "continuous", "Float64", dtype, shape, unit, display_unit, minimum=low, maximum=high
    )


@pytest.mark.parametrize(
    ("variable", "value", "expected"),
    [
        (bounded(None, None), 1e300, ("", "")),
        (bounded(-1.0, 2e-3), 2e-3, ("", "")),
        (bounded(-1.0, 2e-3), np.nextafter(2e-3, 1.0), ("", "")),  # rounding of a conversion
        (
            bounded(-1.0, 2e-3),
            2e-3 * (1 + 1e-14),
            (": 2.00000000000002 mm is above the maximum", "Give -1000 mm to 2 mm."),
        ),
        (bounded(-1.0, 2e-3), -1.5, (": -1500 mm is below the minimum", "Give -1000 mm to 2 mm.")),
        (bounded(-1.0, 2e-3), -1.0, ("", "")),
        (bounded(-1.0, 2e-3), np.nan, (": nan mm is no number", "Give -1000 mm to 2 mm.")),
        (bounded(1e-3, None), 0.0, (": 0 mm is below the minimum", "Give at least 1 mm.")),
        (bounded(None, 0.5, unit="", display_unit=""), 0.75, (": 0.75 is above the maximum", "Give at most 0.5.")),
        pytest.param(
            bounded(0.0, None, unit="K", display_unit="degC"),
            -1.0,
            (": -274.15 degC is below the minimum", "Give at least -273.15 degC."),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            bounded(1.0, 2.0, display_unit="no unit"),
            3.0,
            (": 3 m is above the maximum", "Give 1 m to 2 m."),
            marks=pytest.mark.slow,
        ),
        (bounded(1, 2, INT, "1"), np.int32(3), (": 3 is above the maximum", "Give 1 to 2.")),
        (bounded(1, 2, INT, "1"), np.int32(2), ("", "")),
        (
            bounded(0.0, 1.0, shape=(2, 2)),
            np.array([[0.0, 1.0], [0.5, 2.0]]),
            ("[2,2]: 2000 mm is above the maximum", "Give 0 mm to 1000 mm."),
        ),
        (bounded(0.0, 1.0, np.dtype(object), shape=()), "text", ("", "")),
    ],
)
def test_a_value_outside_its_bounds_is_told_in_its_unit(variable, value, expected):
    assert variable.outside(value) == expected


def test_limits_have_a_margin_for_rounding_in_the_type_of_the_variable():
    largest = float(np.finfo(FLOAT).max)
    assert bounded(None, None).limits == (-largest, largest)
    assert bounded(1, 2, INT).limits == (1, 2)
    for dtype in (FLOAT, SINGLE):
        low, high = bounded(-2.0, 4.0, dtype).limits
        part = 8 * float(np.finfo(dtype).eps)
        assert (low, high) == (-2.0 - 2.0 * part, 4.0 + 4.0 * part)
    assert [bounded(*ends).is_bounded for ends in ((None, None), (0.0, None), (None, 0.0))] == [False, True, True]


def test_variables_under_other_names_depend_on_the_other_names():
    u, y, z = (
        MemberVariable(name, causality, "continuous", "Float64", FLOAT, dependencies=inputs)
        for name, causality, inputs in (("u", "input", ()), ("y", "output", ("u",)), ("z", "output", None))
    )
    variables = {v.name: v for v in (u, y, z)}
    found = renamed(variables, {"u": "force", "z": "u"})
    assert {name: (v.name, v.dependencies) for name, v in found.items()} == {
        "force": ("force", ()),
        "y": ("y", ("force",)),
        "u": ("u", None),
    }
    assert renamed(variables, {}) == variables
    with pytest.raises(CouplingError, match="names: there is no variable `v`"):
        renamed(variables, {"v": "w"})
    for names in ({"u": "y"}, {"u": "w", "y": "w"}):
        with pytest.raises(CouplingError, match=r"names: there is another variable `[yw]`. Choose a name that is free"):
            renamed(variables, names)


@pytest.mark.parametrize(("takes_size", "size"), [(True, 3), (False, machine.NO_SIZE)])
def test_an_access_calls_with_or_without_the_number_of_values(takes_size, size):
    journal = []
    kind = machine.ACCESS if takes_size else machine.ACCESS_2
    function = kind(lambda *arguments: journal.append(arguments) or 1)
    references = np.array([7, 8], np.uint32)
    access = Access(ctypes.cast(function, ctypes.c_void_p).value, references, 2, 3, takes_size=takes_size)
    assert (access.size_argument, access.call(5, 6)) == (size, 1)
    assert journal == [(5, references.ctypes.data, 2, 6, *([3] if takes_size else []))]


class Saving(Mock):
    """A member that is brought back by Python alone."""

    def state_access(self, count):
        return super(Mock, self).state_access(count)


def test_a_member_is_brought_back_by_its_own_save_and_restore():
    member = Saving("m")
    with pytest.raises(CouplingError, match="m: can be brought back to one point only"):
        member.state_access(2)
    access = member.state_access(1)
    (pointer,) = access.pointer_addresses
    assert (access.address, access.words) == (0, 0)
    member.memory[:] = 1.0
    assert machine.call_state(access.get, member.instance, pointer) == 0
    assert machine.read64(pointer) == pointer, "a state that is not null"
    member.memory[:] = 2.0
    assert machine.call_state(access.set, member.instance, machine.read64(pointer)) == 0
    assert member.memory.tolist() == [1.0] * 8
    member.save = lambda: (_ for _ in ()).throw(CouplingError("m: no."))
    assert machine.call_state(access.get, member.instance, pointer) == 3
    assert member.log == ["m: no."]


@pytest.mark.parametrize(("cheap", "problem"), [(True, ""), (False, "its state cannot be serialized")])
def test_a_state_is_written_if_it_can_be_saved(cheap, problem):
    member = Mock("m")
    member.has_cheap_fmu_state = cheap
    assert member.serialization_problem() == problem


def test_a_member_goes_to_another_process_with_its_values_and_its_period():
    member = RecordMember("m", SlowClock(y=0.25), log=["a line"], identity={"kind": "component"})
    again = pickle.loads(pickle.dumps(member))
    assert (again.name, again.get("y"), again.period_ns, again.code) == ("m", 0.25, 10_000_000, None)
    assert (again.log, again.identity) == (["a line"], {"kind": "component"})
    sampled = RecordMember("m", Hold())
    sampled.set("y", 3.0)
    assert pickle.loads(pickle.dumps(sampled)).get("y") == 3.0
    local = type("Main", (Hold,), {"__module__": "__main__"})
    with pytest.raises(pickle.PicklingError, match="Main is in the script that runs"):
        pickle.dumps(RecordMember("m", local()))


def test_a_serialized_state_is_that_of_its_model():
    one, other = RecordMember("one", Lag(x=3.0)), RecordMember("other", Lag())
    assert one.serialization_problem() == ""
    data = one.serialize()
    other.deserialize(data)
    assert other.get("x") == 3.0
    expected = f"other: a state of {len(data) - 8} byte is not of this model, which has {len(data)}."
    with pytest.raises(SimulationError, match=expected):
        other.deserialize(data[8:])
    saved = one.save()
    one.set("x", 4.0)
    one.failure = ValueError("of a step")
    one.restore(saved)
    assert (one.get("x"), one.failure) == (3.0, None)
    with pytest.raises(CouplingError, match="one: a record is read and written in place"):
        one.access(["x"], write=False)
    access = one.state_access(2)
    assert (access.address, 8 * access.words) == (one.instance, len(data))


class Stubborn(PythonComponent):
    """Starts and closes with an error."""

    y = output("m", "out")

    def initialize(self):
        raise ValueError("no start")

    def step(self, t, h):
        self.y = t

    def close(self):
        raise OSError("no end")


def test_errors_of_python_are_told_where_they_happen():
    bomb = RecordMember("bomb", Bomb())
    assert bomb.serialization_problem() == "it is Python-side, and its state lies in Python objects"
    bomb.enter_initialization(0.0, None)
    bomb.exit_initialization()
    assert bomb.try_step(0.0, 0.01, np.zeros(4, np.int64)) == 0
    assert bomb.try_step(0.05, 0.01, np.zeros(4, np.int64)) == 3
    assert str(bomb.failure) == "boom"
    assert "boom" in bomb.log[-1]
    bomb.close()
    bomb.close()
    assert bomb.component.closed == 1
    stubborn = RecordMember("stubborn", Stubborn())
    stubborn.enter_initialization(0.0, None)
    with pytest.raises(SimulationError, match=r"stubborn: initialization failed: .*no start"):
        stubborn.exit_initialization()
    stubborn.close()
    assert "close failed: " in stubborn.log[-1]
    assert "no end" in stubborn.log[-1]


def test_outputs_are_computed_again_while_inputs_change_in_initialization():
    member = RecordMember("lag", Lag(x=1.0))
    member.enter_initialization(0.0, None)
    assert member.get("y") == 1.0
    member.set("x", 2.0)
    assert member.get("y") == 2.0
    member.exit_initialization()
    member.set("x", 3.0)
    assert member.get("y") == 2.0, "in the next step"
    assert RecordMember("d", Diverging()).get("y") == 0.0


def linked(*pairs, continuous="abcde"):
    """Connections between members of which some are equations."""
    end = SimpleNamespace(connectable=True)
    links = [
        SimpleNamespace(source=SimpleNamespace(member=a, variable=end), target=SimpleNamespace(member=b, variable=end))
        for a, b in pairs
    ]
    joined = []
    members = {
        name: SimpleNamespace(
            continuous=name in continuous,
            join=lambda own, inside, name=name: joined.append((name, own, inside)),
        )
        for name in "abcdef"
    }
    return members, links, joined


@every_case(
    ("pairs", "expected"),
    [
        ([], {}),
        (["ab"], {"a": "a", "b": "a"}),
        (["ba", "bc"], {"a": "a", "b": "a", "c": "a"}),
        (["ab", "dc"], {"a": "a", "b": "a", "c": "c", "d": "c"}),
        (["af", "fb"], {}),  # through a member that steps by itself
        (["aa"], {}),
    ],
)
def test_connected_equations_are_integrated_together(pairs, expected):
    members, links, joined = linked(*pairs)
    assert groups.together(members, links) == expected
    groups.join(members, links, dict.fromkeys(members, 1_000_000))
    wanted = {}
    for name, leader in expected.items():
        wanted.setdefault(leader, []).append(members[name])
    assert [(name, own) for name, own, _ in joined] == list(wanted.items())
    assert [link for _, _, inside in joined for link in inside] == groups.between(members, links)[
        : len(pairs) * bool(expected)
    ]


def test_equations_that_step_differently_are_not_integrated_together():
    members, links, _ = linked("ab")
    expected = r"a, b: are connected and integrated together, but step differently \(a 1 ms, b 2 ms\)"
    with pytest.raises(CouplingError, match=expected):
        groups.join(members, links, dict.fromkeys(members, 1_000_000) | {"b": 2_000_000})


class Declared(Component):
    """A continuous component with a variable of each kind."""

    method = solver.rk4(1e-3)
    u = input("N", "force", display_unit="mN", minimum=-1.0, maximum=2.0)
    n = input("", "a count", type=Int32)
    y = output("m", "place")
    z = output("", "a count", type=Int32)
    k = parameter((1.0, 2.0), "N/m", "stiffness", source="assumed")
    f = parameter(3.0, "s", "set before the run", fixed=True, source="assumed")
    memory = local(0.0, "", "memory", shape=(2, 3))
    x = state(0.5, "m", "place")
    end = terminal("the end", force=u, place=y)

    def derivatives(self, t):
        self.der_x = self.u / self.k[0]
        self.y = self.x
        self.z = self.n


class Stepped(Component):
    """The same, which steps."""

    y = output("m", "place")
    x = local(0.0, "m", "memory")

    def step(self, t, h):
        self.y = t


def test_variables_of_a_member_are_what_its_component_declares():
    found = declared_variables(Declared)
    kinds = {name: (v.causality, v.variability, v.type, v.shape) for name, v in found.items()}
    assert kinds == {
        "u": ("input", "continuous", "Float64", ()),
        "n": ("input", "discrete", "Int32", ()),
        "y": ("output", "continuous", "Float64", ()),
        "z": ("output", "discrete", "Int32", ()),
        "k": ("parameter", "tunable", "Float64", (2,)),
        "f": ("parameter", "fixed", "Float64", ()),
        "memory": ("local", "continuous", "Float64", (2, 3)),
        "x": ("local", "continuous", "Float64", ()),
        "der_x": ("local", "continuous", "Float64", ()),
    }
    u, k = found["u"], found["k"]
    assert (u.unit, u.display_unit, u.description, u.minimum, u.maximum) == ("N", "mN", "force", -1.0, 2.0)
    assert (k.unit, k.display_unit, k.start.tolist(), k.minimum, k.maximum) == ("N/m", "", [1.0, 2.0], None, None)
    assert {name: v.dependencies for name, v in found.items() if v.causality == "output"} == {"y": (), "z": ("n",)}
    assert u.terminals == (TerminalMember("end", "force", "plug", "signal"),)
    assert found["y"].terminals == (TerminalMember("end", "place"),)
    assert k.terminals == ()
    assert (found["der_x"].unit, found["der_x"].description) == ("m/s", "derivative of x")
    assert [v.variability for v in declared_variables(Stepped).values()] == ["discrete", "discrete"]


def test_another_process_imports_a_class_and_samples_it_anew():
    assert importable_class(Hold) == (Hold, 0)
    assert importable_class(SlowClock) == (SlowClock, 10_000_000)
    assert importable_class(resampled(Hold, 5_000_000)) == (Hold, 5_000_000)
    script = type("Script", (Hold,), {"__module__": "__main__"})
    with pytest.raises(pickle.PicklingError, match="Script is in the script that runs"):
        importable_class(script)
