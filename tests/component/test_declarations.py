"""What a class of a component declares: memory, terminals, switches, periods, start values; and what is refused."""

import numpy as np
import pytest

from tests.every_case import every_case
from twin.compiler import Tangents, tangents
from twin.component import (
    Boolean,
    Component,
    Float64,
    Int32,
    Int64,
    Role,
    input,
    local,
    output,
    parameter,
    solver,
    state,
    terminal,
)
from twin.component.buffers import overflows
from twin.component.component import evaluation, resampled
from twin.component.variable import layout
from twin.errors import BuildError, DeclarationError
from twin.fmi.exporting.model_description_writer import expose_scalars


class Mixed(Component):
    """Variables of all kinds."""

    method = solver.ros2(1e-3)
    flag = input("", "a Boolean", start=True)
    small = input("", "an Int32", type=Int32, start=3)
    u = input("N", "a vector", shape=(2,))
    y = output("m", "out")
    k = parameter((1.0, 2.0), "", "two gains")
    count = local(0, "", "an Int64", type=Int64)
    x = state((0.5, -0.5), "m", "a state", nominal=0.01, minimum=-1.0, display_unit="mm", source="assumed")
    n = state(2.0, "", "another")

    def derivatives(self, t):
        self.der_x[0] = self.u[0] - self.x[0]
        self.der_x[1] = self.u[1] - self.x[1]
        self.der_n = t
        self.y = self.k[0] * self.x[0] + self.k[1] * self.n


def test_variables_have_types_shapes_and_start_values():
    described = {v.name: (str(v.role), str(v.type), v.shape, v.start_array().tolist()) for v in Mixed.variables}
    assert described == {
        "flag": ("input", "Boolean", (), True),
        "small": ("input", "Int32", (), 3),
        "u": ("input", "Float64", (2,), [0.0, 0.0]),
        "y": ("output", "Float64", (), 0.0),
        "k": ("parameter", "Float64", (2,), [1.0, 2.0]),
        "count": ("local", "Int64", (), 0),
        "x": ("state", "Float64", (2,), [0.5, -0.5]),
        "der_x": ("derivative", "Float64", (2,), [0.0, 0.0]),
        "n": ("state", "Float64", (), 2.0),
        "der_n": ("derivative", "Float64", (), 0.0),
    }
    slope, other = Mixed.der_x, Mixed.der_n
    assert (slope.unit, other.unit, slope.description) == ("m/s", "1/s", "derivative of x")
    assert (slope.minimum, slope.nominal, slope.display_unit, slope.source) == (None, None, "", "")
    assert [v.size for v in Mixed.variables if v.role is Role.state] == [2, 1]


class Named(Component):
    """Types as text."""

    method = solver.rk4(1e-3)
    u = input("N", "Float64 by its name", type="Float64")
    y = output("N", "Float64 by its name", type="Float64")
    flags = input("", "Booleans by their name", type="Boolean", shape=(2,))
    number = input("", "Int64 by its name", type="Int64", start=2**40)
    x = state(0.0, "N*s", "integral")

    def derivatives(self, t):
        self.der_x = self.u
        self.y = 2.0 * self.u


def test_a_type_by_its_name_is_the_type_itself():
    """The name alone lost derivatives, units in FMUs, and the check of whole numbers for FMI 2.0."""
    assert all(type(variable.type) is type(Float64) for variable in Named.variables)
    assert Named.flags.dtype == np.int8
    assert isinstance(tangents(Named), Tangents)
    with pytest.raises(BuildError, match=r"Named\.number: start does not fit 32 bits"):
        expose_scalars(Named)
    with pytest.raises(
        DeclarationError, match=r"type 'Real' of 'force' is not known\. Use one of Float64, Int32, Int64, Boolean"
    ):
        input("N", "force", type="Real")


def test_memory_is_in_blocks_of_words_by_role_and_states_are_one_vector():
    """Inputs, outputs and so on in the order of `Role`; small variables share a word, arrays begin one."""
    order = [role for role in Role if any(v.role is role for v in Mixed.variables)]
    offsets = {v.name: Mixed.layout.offset(v.name) for v in Mixed.variables}
    assert (offsets["small"] - offsets["flag"], offsets["u"] - offsets["flag"]) == (4, 8)
    begins = [min(offsets[v.name] for v in Mixed.variables if v.role is role) for role in order]
    assert begins == sorted(begins)
    assert all(begin % 8 == 0 for begin in begins)
    part = Mixed()
    part.views["_x"][:] = 1.0, 2.0, 3.0
    part.views["_dx"][:] = 4.0, 5.0, 6.0
    assert (part.x.tolist(), part.n, part.der_x.tolist(), part.der_n) == ([1.0, 2.0], 3.0, [4.0, 5.0], 6.0)
    assert Mixed.layout.state_size == 3
    assert Mixed.layout.size == part.record.nbytes
    assert layout((), {}).size == 8, "no record is empty"


def test_states_are_compared_with_their_nominal_size_or_1():
    assert Mixed().views["_nominal"].tolist() == [0.01, 0.01, 1.0]
    assert "_nominal" not in type("Plain", (Mixed,), {"method": solver.rk4(1e-3)})().views


def test_whole_numbers_and_booleans_are_read_as_pythons_own():
    part = Mixed()
    assert (type(part.small), type(part.flag), type(part.count)) == (int, bool, int)
    assert part.flag is True
    part.u = 1.5, 2.5
    assert part.u.tolist() == [1.5, 2.5]


def test_a_record_moves_with_all_its_values():
    part = Mixed(n=7.0)
    memory = np.zeros(1, Mixed.layout.dtype)
    before = part.record
    part.move_record(memory)
    assert part.record is memory
    assert part.n == 7.0
    part.n = 8.0
    assert (memory["n"][0], before["n"][0], part.views["_x"][2]) == (8.0, 7.0, 8.0)


def test_derivatives_and_outputs_for_a_solver_outside():
    part = Mixed(u=(1.0, 2.0))
    assert evaluation(Mixed)(part, 0.25) == solver.OK
    assert (part.der_x.tolist(), part.der_n, part.y) == ([0.5, 2.5], 0.25, 4.5)
    assert evaluation(Every) is None


class Every(Component):
    """Counts its steps, and notes the last."""

    period = 0.01
    y = output("", "steps")
    begin = output("s", "begin of the last")

    def step(self, t, h):
        self.y += 1.0
        self.begin = t


@pytest.mark.parametrize(("step", "counts"), [(0.01, [1, 2, 3]), (0.004, [0, 0, 1, 1, 2, 2]), (0.025, [2, 5, 7])])
def test_a_sampled_source_steps_when_its_period_is_over(step, counts):
    part, seen = Every(), []
    part.start(1.0)
    for k in range(len(counts)):
        assert part.advance(1.0 + k * step, step) == solver.OK
        seen.append(part.y)
        assert part.begin == pytest.approx(1.0 + 0.01 * (part.y - 1) if part.y else 0.0)
    assert seen == counts


@pytest.mark.parametrize(
    ("period_ns", "name", "suffix"),
    [
        (20_000_000, "Every_20ms", "_20ms"),
        (2_000_000_000, "Every_2s", "_2s"),
        (250_000, "Every_250us", "_250us"),
        (1_000_001, "Every_1000001ns", "_1000001ns"),
    ],
)
def test_a_component_of_another_period_is_a_class_of_its_own(period_ns, name, suffix):
    made = resampled(Every, period_ns)
    assert (made.__name__, made.sampled_as, made.period_ns) == (name, suffix, period_ns)
    assert (made.__doc__, made.__module__, made.__mro__[1]) == (Every.__doc__, Every.__module__, Every)
    assert resampled(Every, period_ns) is made
    assert resampled(Every, 10_000_000) is Every


STEP = {"step": lambda self, t, h: None}
FLOW = {"derivatives": lambda self, t: None}


@every_case(
    ("body", "message"),
    [
        ({"period": -0.1, **STEP}, "Odd.period: -0.1 s is not positive. Use 0.001"),
        ({"x": state(0.0, "", "x"), "der_x": local(0.0, "", "x"), **FLOW}, "Odd.der_x: is declared by the state 'x'"),
        ({"größe": input("", "x"), **STEP}, "Odd.größe: FMI allows letters a to z, digits and _ only"),
        ({"_x": input("", "x"), **STEP}, "Odd._x: this name is the engine's own"),
        ({"z": Mixed.u, **STEP}, "Odd.z: already declared as 'u'. Declare it once more"),
        ({"switches": ("y",), "y": output("", "y"), **STEP}, "Odd: switches names 'y'. Name states"),
        ({"switches": ("k",), "k": parameter(0.0, "", "k"), **FLOW}, "Odd: switches names 'k'"),
        ({"switches": ("n",), "n": output("", "n", type=Int32), **FLOW}, "Odd: switches names 'n'"),
        ({"y": output("", "y"), "end": terminal("end", y=local(0.0, "", "l")), **STEP}, "Odd.end: y is no variable"),
        ({"end": terminal("end"), **STEP}, "Odd.end: nothing is no variable to connect"),
        (
            {"u": input("", "u"), "end": terminal("end", rule="best"), **STEP},
            "Odd.end: matching rule 'best' is not known",
        ),
        ({"step": terminal("end")}, "Odd.step: a terminal cannot have this name"),
    ],
)
def test_what_cannot_be_declared_is_refused_with_the_class(body, message):
    with pytest.raises(DeclarationError) as caught:
        type("Odd", (Component,), body)
    assert str(caught.value).startswith(message)


@every_case(
    ("body", "message"),
    [
        ({**STEP, **FLOW}, "Odd: needs either derivatives(self, t) or step(self, t, h)."),
        ({**FLOW, "period": 0.1}, "Odd: a continuous component has no period. Drop it, or use step."),
        ({"step": lambda self, t: None}, "Odd.step: expected step(self, t, h). Write it so."),
        ({"derivatives": lambda self, t, h: None}, "Odd.derivatives: expected derivatives(self, t). Write it so."),
        ({**STEP, "initialize": lambda self, t: None}, "Odd.initialize: expected initialize(self). Write it so."),
        (
            {"step": lambda self, t, h: 3 if t > h else 0},
            (
                "Odd.step: returns a value, which is a status only if it is declared. "
                "Write step(self, t, h) -> int, or return nothing."
            ),
        ),
        (
            {"derivatives": lambda self, t: 3},
            "Odd.derivatives: returns a value, which is lost. Only step returns a status.",
        ),
        (
            {**STEP, "initialize": lambda self: 3},
            "Odd.initialize: returns a value, which is lost. Only step returns a status.",
        ),
    ],
)
def test_functions_that_do_not_fit_are_refused_when_they_are_needed(body, message):
    part = type("Odd", (Component,), body)()
    with pytest.raises(DeclarationError) as caught:
        part.start()
    assert str(caught.value) == message


def test_what_may_be_declared():
    body = {
        "x": state(0.0, "", "x"),
        "y": output("", "y"),
        "l": local(0.0, "", "l"),
        "switches": ("x", "y", "l"),
        **FLOW,
    }
    assert type("Fine", (Component,), body).switches == ("x", "y", "l")
    u, k = input("", "u"), parameter(1.0, "", "k", type=Float64)
    found = type(
        "Rod",
        (Component,),
        {"u": u, "k": k, "on": input("", "on", type=Boolean), "end": terminal("end", force=u, gain=k), **STEP},
    )
    assert {name: v.name for name, v in found.terminals["end"].members.items()} == {"force": "u", "gain": "k"}
    assert type("More", (found,), {}).terminals == found.terminals


class Delaying(Component):
    """Has buffers for half a second and for a rate."""

    buffers = (("delay", 50.0), ("rate", 100.0))
    delay = parameter(0.5, "s", "delay")
    rate = parameter(1.0, "Hz", "rate")
    y = output("", "out")

    def step(self, t, h):
        self.y = t


@every_case(
    ("values", "period", "expected"),
    [
        ({}, 0.01, []),
        (
            {"delay": 0.51},
            0.01,
            [
                "delay = 0.51 s needs 51 periods of 0.01 s, and its buffer holds 50. Give at most 0.5 s, or sample less often."
            ],
        ),
        (
            {"delay": 0.25},
            0.005,
            [
                "rate = 1 Hz needs 200 periods of 0.005 s, and its buffer holds 100. Give at least 2 Hz, or sample less often."
            ],
        ),
        (
            {"rate": 0.5, "delay": 0.1},
            0.01,
            [
                "rate = 0.5 Hz needs 200 periods of 0.01 s, and its buffer holds 100. Give at least 1 Hz, or sample less often."
            ],
        ),
        ({"rate": 0.0}, 0.01, []),
        (
            {"delay": np.array([0.1, 0.6])},
            0.01,
            [
                "delay = 0.6 s needs 60 periods of 0.01 s, and its buffer holds 50. Give at most 0.5 s, or sample less often."
            ],
        ),
    ],
)
def test_a_parameter_that_outgrows_its_buffer_is_told(values, period, expected):
    assert overflows(Delaying, values, period) == expected
