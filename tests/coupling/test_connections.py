"""Which variables a connection may join, in which order members step, and how values are found at the start."""

import numpy as np
import pytest

from tests.coupling.parts import Gain, couple
from tests.every_case import every_case
from twin.coupling import (
    DTYPES,
    Connection,
    CoupledSystem,
    FixedPoint,
    MemberVariable,
    direct_followers,
    find,
    stepping_order,
)
from twin.coupling.initialization import set_targets, solve_initialization
from twin.coupling.system import check_periods
from twin.errors import CouplingError, SimulationError

MS = 1_000_000


def variable(name, causality, kind="Float64", unit="", **more):
    return MemberVariable(name, causality, "continuous", kind, DTYPES.get(kind, np.dtype(np.bool_)), unit=unit, **more)


def joined(source, target, **connection):
    """The connection of two variables, or the reason why there is none."""
    system = CoupledSystem({"a": {"y": source}, "b": {"u": target}}, [Connection("a.y", "b.u", **connection)])
    problems = system.check()
    return problems[0] if problems else system.links()[0]


WHOLE = [kind for kind in DTYPES if DTYPES[kind].kind in "iu" and kind != "Enumeration"]
FITTING = {
    "Float64": "Float64 Float32",
    "Float32": "Float64 Float32",
    "Boolean": f"Float64 Float32 Boolean Enumeration {' '.join(WHOLE)}",
    "String": "String",
    "Binary": "Binary",
    "Int8": "Float64 Float32 Int8 Int16 Int32 Int64 Enumeration",
    "UInt8": "Float64 Float32 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Enumeration",
    "Int32": "Float64 Float32 Int32 Int64 Enumeration",
    "UInt32": "Float64 Float32 UInt32 Int64 UInt64 Enumeration",
    "Int64": "Float64 Float32 Int64 Enumeration",
    "UInt64": "Float64 Float32 UInt64",
    "Enumeration": "Float64 Float32 Int64 Enumeration",
}


@every_case("source", list(FITTING))
def test_types_fit_where_no_value_is_lost(source):
    """Whole numbers of 64 bits may be rounded by a real number; nothing else is."""
    fitting = {
        kind
        for kind in DTYPES
        if not isinstance(joined(variable("y", "output", source), variable("u", "input", kind)), str)
    }
    assert fitting == set(FITTING[source].split())


@every_case(
    ("units", "connection", "expected"),
    [
        (("m", "mm"), {}, (1000.0, 0.0)),
        (("m", "mm"), {"convert": False}, (1.0, 0.0)),
        (("m", ""), {}, (1.0, 0.0)),
        (("m", "mm"), {"factor": 2.0, "offset": 5.0}, (2000.0, 5.0)),
        (("m", "mm"), {"factor": -1.0, "convert": False}, (-1.0, 0.0)),
        (("", ""), {"offset": 0.5}, (1.0, 0.5)),
    ],
)
def test_factor_and_offset_come_after_the_units(units, connection, expected):
    link = joined(variable("y", "output", unit=units[0]), variable("u", "input", unit=units[1]), **connection)
    assert (link.factor, link.offset) == expected


def test_an_offset_of_a_unit_is_scaled_too():
    """The pint-free definition of a unit: 1 K per unit, from 273.15 K."""
    celsius = variable("y", "output", unit="C {1.0 K + 273.15}")
    link = joined(celsius, variable("u", "input", unit="K"), factor=2.0, offset=1.0)
    assert (link.factor, link.offset) == (2.0, 2.0 * 273.15 + 1.0)


CLOCK = {"kind": "Clock"}


@every_case(
    ("source", "target", "connection", "message"),
    [
        (
            {"kind": "Int32", "unit": "m"},
            {"kind": "Int32", "unit": "mm"},
            {},
            "units of whole numbers are not converted",
        ),
        ({"kind": "Int32"}, {"kind": "Int32"}, {"factor": 2.0}, "factor and offset are for real numbers"),
        ({"kind": "Int32"}, {"kind": "Int32"}, {"offset": 1.0}, "factor and offset are for real numbers"),
        ({"kind": "String"}, {"kind": "String"}, {"factor": 2.0}, "factor and offset are for real numbers"),
        ({"kind": "String"}, {"kind": "Binary"}, {}, "String does not fit Binary. Connect two of one type."),
        (CLOCK, {"kind": "Float64"}, {}, "Clock does not fit Float64. Connect two clocks."),
        ({"kind": "Boolean"}, CLOCK, {}, "Boolean does not fit Clock. Connect two clocks."),
        (
            CLOCK,
            {**CLOCK, "interval": "constant"},
            {},
            "the target ticks by itself (constant). Connect to a triggered clock.",
        ),
        (CLOCK, CLOCK, {"factor": 2.0}, "factor and offset are for real numbers"),
        ({"shape": (2,)}, {"shape": (3,)}, {}, "2 values do not fit 3. Connect elements, like x[1]."),
        (
            {"kind": "Enumeration", "items": (("off", 1), ("on", 2))},
            {"kind": "Enumeration", "items": (("off", 1), ("on", 3))},
            {},
            "`on` is 2 in the source, and is 3 in the target. Convert it between.",
        ),
        (
            {"kind": "Enumeration", "items": (("off", 1), ("on", 2))},
            {"kind": "Enumeration", "items": (("off", 1), ("hot", 2))},
            {},
            "`on` is 2 in the source, and is not there: there are off, hot in the target. Convert it between.",
        ),
    ],
)
def test_what_does_not_fit_is_told(source, target, connection, message):
    problem = joined(variable("y", "output", **source), variable("u", "input", **target), **connection)
    assert problem.startswith(f"a.y -> b.u: {message}")


def test_clocks_and_enumerations_that_fit():
    items = (("off", 1), ("on", 2))
    source = variable("y", "output", "Enumeration", items=items)
    for other in ((), items, (*items, ("hot", 3))):
        assert not isinstance(joined(source, variable("u", "input", "Enumeration", items=other)), str)
    ticking = variable("y", "input", "Clock", interval="constant")
    assert joined(ticking, variable("u", "input", "Clock")).source.key == ("a", "y")
    assert "the source is an input" in joined(variable("y", "input", "Clock"), variable("u", "input", "Clock"))
    whole = joined(variable("y", "output", "Int32", "m"), variable("u", "input", "Int32", "m"), bond="b", hold=True)
    assert (whole.bond, whole.hold, whole.factor, whole.offset) == ("b", True, 1.0, 0.0)


@every_case(
    ("path", "first", "size"),
    [("a.m", 0, 6), ("a.m[1,1]", 0, 1), ("a.m[2,1]", 3, 1), ("a.m[2,3]", 5, 1), ("a.s", 0, 1)],
)
def test_elements_count_from_one_row_by_row(path, first, size):
    catalog = {"a": {"m": variable("m", "output", shape=(2, 3)), "s": variable("s", "output")}}
    found = find(path, catalog)
    assert (found.first, found.size) == (first, size)
    assert found.element == (first if "[" in path else None)
    for wrong in ("a.m[0,1]", "a.m[3,1]", "a.m[1,4]", "a.m[1]", "a.s[1]"):
        with pytest.raises(CouplingError, match="elements count from 1"):
            find(wrong, catalog)


@pytest.mark.parametrize(
    ("period", "message"),
    [
        (2 * MS, ""),
        (1_500_000, "m: period 1.5 ms is not a multiple of 1 ms. Use 1 ms or 2 ms, or a communication step of 500 us."),
        (400_000, "m: period 400 us is not a multiple of 1 ms. Use 1 ms, or a communication step of 200 us."),
        (
            2_750_000,
            "m: period 2.75 ms is not a multiple of 1 ms. Use 2 ms or 3 ms, or a communication step of 250 us.",
        ),
    ],
)
def test_a_period_that_does_not_divide_is_no_rounding(period, message):
    if not message:
        check_periods({"m": period, "n": MS}, MS)
        return
    with pytest.raises(CouplingError) as caught:
        check_periods({"n": 3 * MS, "m": period}, MS)
    assert str(caught.value) == message


def chain(*wires, direct=()):
    """Members a to d with an input u and an output y each, which depends on u in `direct` ones only."""
    catalog = {
        name: {"u": variable("u", "input"), "y": variable("y", "output", dependencies=("u",) if name in direct else ())}
        for name in "abcd"
    }
    return catalog, CoupledSystem(catalog, [Connection(f"{w[0]}.y", f"{w[1]}.u") for w in wires]).links()


@every_case(
    ("wires", "direct", "together", "order"),
    [
        ((), "", None, "abcd"),
        (("ba", "cb"), "", None, "cbad"),
        (("ab", "ba"), "", None, "abcd"),  # a loop: as declared
        (("ab", "ba"), "a", None, "bacd"),  # but a needs the value of b at once
        (("ab", "bc", "ca"), "a", None, "bcad"),
        (("da",), "", None, "bcda"),
        (("ba", "cb"), "", {"c": "a"}, "abd"),
    ],
)
def test_members_step_after_those_whose_values_they_need(wires, direct, together, order):
    catalog, links = chain(*wires, direct=direct)
    found = stepping_order(list("abcd"), links, catalog, together)
    assert (
        all(found.index(w[0]) < found.index(w[1]) for w in wires if not together and f"{w[1]}{w[0]}" not in wires)
        or direct
    )
    if order == "bcda":
        assert found.index("d") < found.index("a")
    else:
        assert "".join(found) == order


def test_outputs_that_depend_on_each_other_at_one_instant():
    catalog, links = chain("ab", "bc", "ca", direct="bc")
    assert direct_followers(links, catalog) == {("a", "y"): [("b", "y")], ("b", "y"): [("c", "y")], ("c", "y"): []}
    unknown = {name: {**own, "y": variable("y", "output")} for name, own in catalog.items()}
    assert direct_followers(links, unknown)[("c", "y")] == [("a", "y")]


class Holder:
    """A member in initialization; `outputs`: functions of its values."""

    def __init__(self, variables, outputs=(), **values):
        self.variables = {v.name: v for v in variables}
        self.values, self.outputs = values, dict(outputs)

    def get(self, name):
        return self.outputs[name](self.values) if name in self.outputs else self.values[name]

    def set(self, name, value):
        self.values[name] = value


def test_targets_get_their_part_of_the_source_in_their_unit():
    source = variable("y", "output", shape=(3,))
    b = Holder(
        [variable("whole", "input", shape=(3,)), variable("one", "input"), variable("part", "input", shape=(2, 2))],
        part=np.zeros((2, 2)),
    )
    catalog = {"a": {"y": source}, "b": b.variables}
    wires = [
        Connection("a.y", "b.whole", factor=10.0),
        Connection("a.y[3]", "b.one", offset=0.5),
        Connection("a.y[2]", "b.part[2,1]"),
    ]
    set_targets({"b": b}, CoupledSystem(catalog, wires).links(), np.array([1.0, 2.0, 3.0]))
    assert b.values["whole"].tolist() == [10.0, 20.0, 30.0]
    assert b.values["one"] == 3.5
    assert b.values["part"].tolist() == [[0.0, 0.0], [2.0, 0.0]]


def loop_of(gain, offset, kind="Float64"):
    """u of both is y of the other; y of a is gain u + offset, y of b is u."""
    own = [variable("u", "input", kind), variable("y", "output", kind)]
    a = Holder(own, {"y": lambda values: gain * values["u"] + offset}, u=0)
    b = Holder(own, {"y": lambda values: values["u"]}, u=0)
    members = {"a": a, "b": b}
    catalog = {name: member.variables for name, member in members.items()}
    return members, CoupledSystem(catalog, [Connection("a.y", "b.u"), Connection("b.y", "a.u")]).links()


@pytest.mark.parametrize(
    ("gain", "offset", "kind", "expected"),
    [(0.5, 1.0, "Float64", 2.0), (-3.0, 8.0, "Float64", 2.0), (0, 7, "Int32", 7)],
)
def test_a_loop_at_the_start_is_solved(gain, offset, kind, expected):
    members, links = loop_of(gain, offset, kind)
    solve_initialization(members, links)
    assert [member.values["u"] for member in members.values()] == pytest.approx([expected] * 2, rel=1e-9)


@pytest.mark.parametrize(("gain", "offset", "kind"), [(1.0, 1.0, "Float64"), (-1, 3, "Int32")])
def test_a_loop_without_a_solution_is_told(gain, offset, kind):
    members, links = loop_of(gain, offset, kind)
    with pytest.raises(
        SimulationError, match=r"initialization: the algebraic loop through [ab].y, [ab].y has no solution"
    ):
        solve_initialization(members, links)


def text_loop(more):
    """Two members that pass on a text; `a` adds to it until it has some length."""
    own = [variable("u", "input", "String"), variable("y", "output", "String")]
    a = Holder(own, {"y": lambda values: values["u"] + ("x" if len(values["u"]) < more else "")}, u="")
    b = Holder(own, {"y": lambda values: values["u"]}, u="")
    members = {"a": a, "b": b}
    catalog = {name: member.variables for name, member in members.items()}
    return members, CoupledSystem(catalog, [Connection("a.y", "b.u"), Connection("b.y", "a.u")]).links()


def test_texts_in_a_loop_are_passed_on_until_they_stay():
    members, links = text_loop(5)
    solve_initialization(members, links)
    assert [member.values["u"] for member in members.values()] == ["xxxxx"] * 2
    with pytest.raises(
        SimulationError, match=r"the values of [ab].y, [ab].y change each other without end. Break the loop"
    ):
        solve_initialization(*text_loop(10_000))


def fixed_point(function, **options):
    calls = []

    def evaluate(x):
        calls.append(x.copy())
        return np.asarray(function(x), float)

    return FixedPoint(evaluate, **{"tolerance": 1e-10, "iterations": 20, "smallest": 1e-6} | options), calls


def test_a_linear_equation_takes_one_step_of_newton():
    matrix = np.array([[0.5, -2.0], [3.0, 0.25]])
    equation, calls = fixed_point(lambda x: matrix @ x + [1.0, 2.0])
    x, image = equation.solve(np.zeros(2))
    np.testing.assert_allclose(x, np.linalg.solve(np.eye(2) - matrix, [1.0, 2.0]), rtol=1e-7)
    np.testing.assert_allclose(x, image, rtol=1e-10)
    np.testing.assert_array_equal(calls[-1], x)
    assert len(calls) <= 7
    np.testing.assert_allclose(equation.jacobian, matrix, rtol=1e-5)


def test_equations_of_different_sizes_are_solved():
    """A force of some N over a compliance of 1e-9 m/N, and its displacement over a stiffness of 1e6 N/m."""
    equation, _ = fixed_point(lambda x: np.array([1e6 * x[1] + 2.0, 1e-9 * x[0]]))
    x, _ = equation.solve(np.zeros(2))
    np.testing.assert_allclose(x, [2.0 / (1.0 - 1e-3), 2e-9 / (1.0 - 1e-3)], rtol=1e-6)


def test_a_jacobian_is_used_for_several_iterations_and_the_next_solution():
    equation, calls = fixed_point(lambda x: 0.1 * np.cos(x) + 1.0, renewal=100)
    equation.solve(np.zeros(1))
    first = len(calls)
    equation.solve(np.ones(1))
    assert len(calls) - first < first


@pytest.mark.parametrize(("renewal", "jacobians"), [(1, 6), (2, 4), (3, 3), (100, 1)])
def test_a_jacobian_is_renewed_after_some_iterations(renewal, jacobians):
    """x = x^2 + 1 has no real solution: all six iterations are made, in each of which it is evaluated once more."""
    equation, calls = fixed_point(lambda x: x * x + 1.0, iterations=6, renewal=renewal)
    assert equation.solve(np.array([0.3])) is None
    assert len(calls) == 6 + jacobians


def test_repeated_substitution():
    equation, calls = fixed_point(lambda x: 0.5 * x + 1.0, is_smooth=False, tolerance=1e-3)
    x, _ = equation.solve(np.zeros(1))
    assert x == pytest.approx(2.0, rel=2e-3)
    assert [round(float(one[0]), 3) for one in calls[:4]] == [0.0, 1.0, 1.5, 1.75]


@every_case(
    ("function", "options"),
    [
        (lambda x: x + 1.0, {}),
        (lambda x: x[::-1] + 1.0, {}),
        (lambda x: (1.0 - 1e-9) * x + 1.0, {}),
        (lambda x: x * np.nan, {}),
        (lambda x: 2.0 * x + 1.0, {"is_smooth": False}),  # diverges
        (np.cos, {"iterations": 1}),
    ],
)
def test_where_no_solution_is_found_there_is_none(function, options):
    equation, _ = fixed_point(function, **options)
    with np.errstate(all="ignore"):
        assert equation.solve(np.ones(1)) is None
    assert equation.jacobian is None, "the next attempt begins anew"


@every_case("size", [1e-3, 1.0, 1e6])
@every_case(("change", "solved"), [(0.9e-3, True), (1.2e-3, False)])
def test_a_tolerance_is_relative_to_the_value(size, change, solved):
    equation, _ = fixed_point(lambda _: np.array([size * (1.0 + change)]), tolerance=1e-3, iterations=1)
    assert (equation.solve(np.array([size])) is not None) == solved


def test_a_member_that_adds_to_its_own_output_has_no_start(build):
    """y = u + 1 m with u = y: a single equation is as singular as several."""
    simulated = couple(build, {"gain": Gain(k=1.0, c=1.0)}, ["gain.y -> gain.u"])
    with pytest.raises(SimulationError, match=r"initialization: the algebraic loop through gain\.y has no solution"):
        simulated.initialize(0)
    solved = couple(build, {"gain": Gain(k=0.9, c=1.0)}, ["gain.y -> gain.u"])
    solved.initialize(0)
    assert solved.value(("gain", "y")) == pytest.approx(10.0)
