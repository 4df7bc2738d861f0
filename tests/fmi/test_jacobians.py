"""Linearized FMUs: from directional derivatives of each, through the connections, and by parameters along a simulation."""

from types import MethodType, SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.fmi.linear_member import LinearMember, link, real
from twin.coupling import MemberVariable
from twin.fmi.fmi_version import FMI2, FMI3
from twin.fmi.importing.c_functions import CallError, MissingFunctionError
from twin.fmi.importing.calls import FmuCalls
from twin.fmi.importing.directional_derivatives import elements, slopes
from twin.fmi.model_description import Continuous
from twin.fmi.model_exchange.sensitivity import Sensitivity, watched
from twin.fmi.model_exchange.solvers import Discarded
from twin.fmi.model_exchange.system import ContinuousSystem
from twin.fmi.model_exchange.system_jacobian import Jacobian, offered

# der(x1, x2) and y1, y2, y3 by x1, x2 | u1, u2, u3
J = np.arange(1.0, 26.0).reshape(5, 5) ** 2
A, B, C, D = J[:2, :2], J[:2, 2:], J[2:, :2], J[2:, 2:]


def fmu(version, rows, columns, variables, failure=None, offers=True, states=(10, 11), derivatives=(20, 21)):
    """An FMU whose directional derivatives are those of J. `rows`, `columns`: reference -> rows or columns of J."""

    def call(function, instance, unknowns, count, known, known_count, seed, *rest):
        assert (function, instance, known_count) == (version.function("GetDirectionalDerivative"), 7, 1)
        if failure is not None:
            raise failure
        size, (change, *change_size) = (rest[0], rest[1:]) if version.has_sizes else (None, rest)
        own = columns[known[0]]
        result = np.concatenate(
            [J[rows[unknowns[i]]][:, own] @ [seed[k] for k in range(len(own))] for i in range(count)]
        )
        assert (size, change_size) == ((len(own), [len(result)]) if version.has_sizes else (None, []))
        for i, value in enumerate(result):
            change[i] = value

    structure = Continuous(states, derivatives, 0, False)
    made = SimpleNamespace(
        capabilities={"providesDirectionalDerivatives": offers},
        variables={one.name: one for one in variables},
        instance=7,
        _unpacked=SimpleNamespace(fmi=version, description=SimpleNamespace(continuous=structure)),
        _loaded=SimpleNamespace(call=call),
    )
    made.directional_derivative = MethodType(FmuCalls.directional_derivative, made)
    return made


def array(name, causality, references, size):
    """A variable of one value reference, or of one for each element."""
    return MemberVariable(name, causality, "continuous", "Float64", np.dtype(float), (size,), references=references)


def fmu_of(version, **options):
    """The FMU, with its inputs and outputs: arrays of two elements, and a number each."""
    if version is FMI2:  # a reference for each element
        u, y = array("u", "input", (30, 31), 2), array("y", "output", (41, 40), 2)
        rows, columns = (
            {reference: [i] for i, reference in enumerate(part)}
            for part in ((20, 21, 41, 40, 50), (10, 11, 30, 31, 60))
        )
        states = real("x1", "local", 10, 1), real("x2", "local", 11, 1)
    else:  # a reference for all
        u, y = array("u", "input", (30,), 2), array("y", "output", (40,), 2)
        rows, columns = {20: [0, 1], 40: [2, 3], 50: [4]}, {10: [0, 1], 30: [2, 3], 60: [4]}
        states = (array("x", "local", (10,), 2), array("der(x)", "local", (20,), 2))
        options |= {"states": (10,), "derivatives": (20,)}
    v, z = real("v", "input", 60, 1), real("z", "output", 50, 1)
    return fmu(version, rows, columns, [*states, u, v, y, z], **options), [u, v], [y, z]


@pytest.mark.parametrize("version", [FMI2, FMI3], ids=["2.0", "3.0"])
def test_a_linearized_fmu(version):
    member, inputs, outputs = fmu_of(version)
    for found, expected in zip(slopes(member, inputs, outputs), (A, B, C, D), strict=True):
        np.testing.assert_array_equal(found, expected)
    of_one = slopes(member, inputs[1:], outputs[1:])
    for found, expected in zip(of_one, (A, B[:, 2:], C[2:], D[2:, 2:]), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert [part.shape for part in slopes(member, [], [])] == [(2, 2), (2, 0), (0, 2), (0, 0)]


def test_references_with_the_size_of_each():
    assert elements(array("a", "input", (3,), 4)) == [(3, 4)]
    assert elements(array("a", "input", (5, 3, 4), 3)) == [(5, 1), (3, 1), (4, 1)]


@pytest.mark.parametrize("failure", [CallError("fmi3GetDirectionalDerivative", 3), MissingFunctionError("none")])
def test_no_linearization_of_an_fmu_that_cannot(failure):
    assert slopes(*fmu_of(FMI3, failure=failure)) is None
    assert slopes(*fmu_of(FMI3, offers=False)) is None
    member, inputs, outputs = fmu_of(FMI3)
    member._unpacked.description.continuous = None
    assert slopes(member, inputs, outputs) is None


def ring(level=None):
    """Two members in an algebraic ring, and a third that reads an element: y_b is 4 y_a, y_a is 0.5 y_b + ..."""
    a = LinearMember(
        "a",
        [[-1, 2], [0, -3]],
        [[1, 0], [0, 2]],
        [[1, 1]],
        [[0.5, 0]],
        e=[[1, 0], [0, 5]],
        f=[[0, 3]],
        p=(0.25, 0.5),
        start=(1, 2),
        level=level,
    )
    b = LinearMember("b", [[-4]], [[1]], [[2], [3]], [[0], [-0.5]], e=[[7]], f=[[1], [2]], p=(2,), start=(3,))
    c = LinearMember("c", [[-5]], [[1, 10]])
    links = [
        link((a, "y"), (b, "u"), factor=2.0),
        link((b, "y"), (a, "u"), first=1, size=1, to=0),
        link((b, "y"), (a, "u"), first=0, size=1, to=1, factor=-1.0, offset=4.0),
        link((b, "y"), (c, "u"), first=1, size=1, to=1),
        link((a, "y"), (c, "u"), size=1, to=0, factor=3.0),
        link((a, "n"), (b, "n")),  # a discrete variable is no part of it
    ]
    return [a, b, c], links


def close(found, expected, rtol=1e-9):
    """Equal but for rounding."""
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-12)


def differences(function, at):
    """The Jacobian of a linear function, exact but for rounding."""
    return np.array([(function(at + step) - function(at - step)) / 2.0 for step in np.eye(len(at))]).T


def started(members, links, **options):
    """A system at its start."""
    system = ContinuousSystem(members, [one for one in links if one.source.variable.name != "n"])
    for one in members:
        one.system = system
    system.start(**options)
    return system


def test_the_jacobian_of_a_ring():
    """By states and by parameters, of derivatives and of outputs; u_a = (3 x_b - 0.5 u_b + 2 p_b, ...), u_b = 2 y_a."""
    members, links = ring()
    a, b = members[:2]
    system = started(members, links)
    wanted = {"c": (), "a": ["y"], "b": ("y",)}
    jacobian = Jacobian(members, links, system.move_to, wanted)
    by_states = differences(lambda y: system.differentiate(0.5, y), system.y)
    close(jacobian(0.5, np.array([1.0, 2.0, 3.0, 4.0])), by_states)
    assert jacobian.outputs == {("a", "y"): 0, ("b", "y"): 1}

    def outputs(y):
        system.move_to(0.5, y)
        return np.concatenate([a.result(3), b.result(3)])

    by = [part.along([(4, len(part.member.p))]) for part in jacobian.parts]
    owners = [
        np.hstack([np.zeros((len(one), sum(before))), one, np.zeros((len(one), 3 - sum(before) - one.shape[1]))])
        for one, before in zip(by, ([], [2], [2, 1]), strict=True)
    ]
    f_x, f_p, g_x, g_p = jacobian.linearized(owners)

    def at_parameters(function):
        def of(p):
            a.p, b.p = p[:2], p[2:]
            return function()

        return differences(of, np.array([0.25, 0.5, 2.0]))

    close(f_x, by_states)
    close(f_p, at_parameters(lambda: system.differentiate(0.5, system.y)))
    close(g_x, differences(outputs, system.y))
    close(g_p, at_parameters(lambda: outputs(system.y)))


def test_members_without_connections():
    first, second = LinearMember("a", [[-1]], c=[[2]]), LinearMember("b", [[3, 4], [5, 6]])
    found = Jacobian([first, second], [], lambda *_: None, {"a": ["y"]}).linearized()
    expected = [[[-1, 0, 0], [0, 3, 4], [0, 5, 6]], np.zeros((3, 0)), [[2, 0, 0]], np.zeros((1, 0))]
    for part, numbers in zip(found, expected, strict=True):
        np.testing.assert_array_equal(part, numbers)
    assert offered([first, second])
    second.capabilities = {"providesDirectionalDerivatives": False}
    assert not offered([first, second])


def test_sensitivities_of_a_linear_system():
    """x1' = -x1 + p1, x2' = x1 - 2 x2 + p2, y1 = x1 + 3 p1, y2 = x2 + 2 p2: from zero, with the steps of the solver."""
    a = LinearMember("a", [[-1]], c=[[1]], e=[[1, 0]], f=[[3, 0]], p=(0.25, 0.5))
    b = LinearMember("b", [[-2]], [[1]], [[0], [1]], e=[[0, 1]], f=[[0, 0], [0, 2]], p=(9, 2))
    made = Sensitivity([("b", "p", 1), ("a", "p", 0)], [("b", "y", 1), ("a", "y", 0)])
    for one in (a, b):
        one.solver, one.tolerance, one.sensitivity = "RK45", 1e-6, made
    system = started([a, b], [link((a, "y"), (b, "u"))])
    for number in range(10):
        system.step(number * 0.1, 0.1)
    t = np.array(made.times)
    close(t, np.arange(11) * 0.1)
    fast, slow = np.exp(-2.0 * t), np.exp(-t)
    by_p2 = 2.0 + 0.5 * (1.0 - fast), 0.0 * t
    by_p1 = 0.5 * 4.0 * (1.0 - fast) - (slow - fast), 3.0 + (1.0 - slow)  # x2 is fed by x1 + 3 p1
    np.testing.assert_allclose(np.array(made.slopes), np.array([by_p2, by_p1]).T, atol=2e-3)
    assert made.failure == ""
    np.testing.assert_array_equal(made.slopes[0], [[2, 0], [0, 3]])


def test_a_parameter_of_version_2_has_a_reference_for_each_element():
    member = ring()[0][0]
    member.variables["p"] = array("p", "parameter", (14, 15), 2)
    for unknown, block in member.blocks.items():
        member.blocks[unknown] = block | {14: block[4][:, :1], 15: block[4][:, 1:]}
    member.sensitivity = Sensitivity([("a", "p", 1), ("a", "p", 0)], [("a", "y", 0)])
    started([member], [])
    np.testing.assert_array_equal(member.sensitivity.columns(member.system, "a"), [[0, 1], [5, 0], [3, 0]])


@pytest.mark.slow
@every_case(
    ("reset", "failure"),
    [
        (None, "a state jumps at an event at t = 1 s"),
        (lambda x: x * (1 + 2e-6), "a state jumps at an event at t = 1 s"),
        (lambda x: -x, "a state jumps at an event at t = 1 s"),
        (lambda x: x * (1 + 5e-7), ""),
        (lambda x: x, ""),
    ],
)
def test_a_jump_ends_it(reset, failure):
    """The time event at 1 s; a relative change of 1e-6 and more is a jump. The reason that came first stays."""
    member = LinearMember("a", [[-1]], c=[[1]], e=[[1]], p=(1,), start=(4,))
    member.sensitivity = Sensitivity([("a", "p", 0)], [("a", "y", 0)])
    system = started([member], [])
    member.reset, system.due = reset or (lambda x: x * 0), 1.0
    for number in range(4):
        system.step(number * 0.5, 0.5)
    assert member.sensitivity.failure == failure
    assert member.sensitivity.times == ([0.0, 0.5] if failure else [0.0, 0.5, 1.0, 1.5, 2.0])
    assert member.log == [1.0]


def test_a_derivative_that_jumps_ends_it():
    member = LinearMember("a", [[0]], c=[[1]], e=[[1]], p=(1,), start=(4,))
    member.sensitivity = Sensitivity([("a", "p", 0)], [("a", "y", 0)])
    system = started([member], [])

    def reset(x):
        member.p = np.array([2.0])
        return x

    member.reset, system.due = reset, 1.0
    system.step(0.0, 2.0)
    assert member.sensitivity.failure == "a derivative of a state jumps at an event at t = 1 s"


@every_case(("factor", "failure"), [(1.0, ""), (2.0, "a state jumps at an event at t = 0.5 s")])
def test_an_input_may_jump_but_no_state_with_it(factor, failure):
    member = LinearMember("a", [[-1]], [[1]], [[1]], e=[[1]], p=(1,), start=(4,))
    member.sensitivity = Sensitivity([("a", "p", 0)], [("a", "y", 0)])
    member.slot("u").values[:] = 0.0
    system = started([member], [])
    system.step(0.0, 0.5)
    member.slots["u"].values[:] = 3.0
    member.reset = lambda x: factor * x
    system.step(0.5, 0.5)
    assert member.sensitivity.failure == failure
    assert member.sensitivity.times == ([0.0, 0.5] if failure else [0.0, 0.5, 1.0])


def test_a_refusal_ends_it():
    member = LinearMember("a", [[-1]], c=[[1]], e=[[1]], p=(1,))
    member.sensitivity = Sensitivity([("a", "p", 0)], [("a", "y", 0)])
    system = started([member], [])
    direction = member.direction

    def refuse(unknowns, reference, seed, rows):
        if reference == 4 and system.t >= 0.5:
            raise Discarded("no")
        return direction(unknowns, reference, seed, rows)

    member.direction = refuse
    for number in range(4):
        system.step(number * 0.5, 0.5)
    assert member.sensitivity.failure == "a directional derivative by a parameter was refused at t = 0.5 s (no)"
    assert member.sensitivity.times == [0.0]


def test_which_systems_have_sensitivities(monkeypatch):
    monkeypatch.setattr("twin.fmi.model_exchange.model_exchange_member.ExchangeMember", LinearMember)
    (a, b, c), links = ring()
    members = {"a": a, "b": b, "c": c, "other": SimpleNamespace(name="other")}
    p, y = [("a", "p", 0)], [("b", "y", 0)]
    made = watched(members, links, p, y)
    assert (made.parameters, made.outputs) == (p, y)
    assert (a.sensitivity, b.sensitivity, c.sensitivity) == (made, made, made)
    assert watched(members, links, [], y) is None
    assert watched(members, links, [("other", "p", 0)], y) is None
    assert watched(members, links, p, [("other", "y", 0)]) is None
    assert watched({"a": a, "b": b}, links, p, y) is None  # c is not integrated
    b.capabilities = {"providesDirectionalDerivatives": False}
    assert watched(members, links, p, y) is None


def test_members_that_are_not_integrated_together():
    (a, *_), _ = ring()
    a.sensitivity = Sensitivity([("a", "p", 0)], [("b", "y", 0)])
    system = started([a], [])
    system.step(0.0, 0.1)
    assert (a.sensitivity.failure, a.sensitivity.times) == ("not all members are integrated together", [])
