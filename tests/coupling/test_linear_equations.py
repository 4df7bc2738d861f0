"""Linear algebra behind implicit coupling: LU factors in memory, the Jacobian of a coupling, linearized members."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from tests.coupling.mock import Mock, scalar
from tests.coupling.parts import couple
from tests.every_case import every_case
from twin.component import Component, input, output, parameter
from twin.coupling import Algorithm
from twin.coupling.stability.linear_member import LinearMember
from twin.coupling.variable_step.coupling_jacobian import Coupling, derivatives_by_differences
from twin.coupling.variable_step.linear_equations import factorize, substitute

MS = 1_000_000
GAIN_A = np.array([[0.1, -0.2, 0.3], [0.05, 0.4, -0.1]])
GAIN_B = np.array([[0.2, 0.7], [-0.3, 0.15], [0.6, -0.5]])


class ThreeToTwo(Component):
    """Two sums of three inputs."""

    u = input("m", "in", shape=(3,))
    y = output("m", "out", shape=(2,))
    offset = parameter(0.0, "m", "added to both")

    def derivatives(self, t):
        self.y[0] = 0.1 * self.u[0] - 0.2 * self.u[1] + 0.3 * self.u[2] + self.offset
        self.y[1] = 0.05 * self.u[0] + 0.4 * self.u[1] - 0.1 * self.u[2] + self.offset


class TwoToThree(Component):
    """Three sums of two inputs."""

    u = input("m", "in", shape=(2,))
    y = output("m", "out", shape=(3,))

    def derivatives(self, t):
        self.y[0] = 0.2 * self.u[0] + 0.7 * self.u[1]
        self.y[1] = -0.3 * self.u[0] + 0.15 * self.u[1]
        self.y[2] = 0.6 * self.u[0] - 0.5 * self.u[1]


@every_case("n", [1, 2, 3, 5, 8])
@every_case("kind", ["dense", "zero diagonal", "permutation"])
def test_factors_solve_what_numpy_solves(n, kind):
    random = np.random.default_rng(n)
    matrix = random.normal(size=(n, n))
    if kind == "zero diagonal" and n > 1:
        np.fill_diagonal(matrix, 0.0)
    elif kind == "permutation":
        matrix = np.eye(n)[random.permutation(n)] * random.uniform(1, 3, n)
    right = random.normal(size=n)
    factors, pivots, found = matrix.copy(), np.zeros(n, np.int64), right.copy()
    assert factorize(factors.ctypes.data, pivots.ctypes.data, n) == 0
    substitute(factors.ctypes.data, pivots.ctypes.data, found.ctypes.data, n)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-12)


def test_a_singular_matrix_is_refused():
    matrix = np.array([[1.0, 2.0], [0.5, 1.0]])
    pivots = np.zeros(2, np.int64)
    assert factorize(matrix.ctypes.data, pivots.ctypes.data, 2) == 1


CROSSED = ["a.y[2] -> b.u[1]", "a.y[1] -> b.u[2]", "b.y[3] -> a.u[1]", "b.y[1] -> a.u[2]", "b.y[2] -> a.u[3]"]
WHOLE = ["a.y -> b.u", "b.y -> a.u"]
ENDS = {  # each scalar connection: member and index of its source, and of its target
    "crossed": [[(end[0], int(end[4]) - 1) for end in wire.split(" -> ")] for wire in CROSSED],
    "whole": [[("a", i), ("b", i)] for i in range(2)] + [[("b", i), ("a", i)] for i in range(3)],
}
WIRES = {"crossed": CROSSED, "whole": WHOLE}


def loop_of_vectors(kind, build, **options):
    """Two members whose vectors feed each other, as Newton's method solves it: the run, and its scalar Jacobian."""
    algorithm = Algorithm("iterative", acceleration="newton", **options)
    run = couple(build, {"a": ThreeToTwo(), "b": TwoToThree()}, WIRES[kind], algorithm)
    run.initialize(0, 4 * MS)
    gains = {"a": GAIN_A, "b": GAIN_B}
    ends = ENDS[kind]
    direct = [[gains[out[0]][out[1], into[1]] if out[0] == into[0] else 0.0 for _, into in ends] for out, _ in ends]
    return run, np.array(direct)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("kind", list(WIRES))
def test_the_jacobian_of_vectors_is_that_of_their_matrices(kind, build):
    run, direct = loop_of_vectors(kind, build)
    torn = [one.number for one in run.plan.all_elements if one.is_torn]
    found = Coupling(run.plan).jacobian(0.0, 1e-3)
    run.terminate()
    known = [i for i in range(len(direct)) if i not in torn]
    inner = np.linalg.solve(np.eye(len(known)) - direct[np.ix_(known, known)], direct[np.ix_(known, torn)])
    np.testing.assert_allclose(found, direct[np.ix_(torn, torn)] + direct[np.ix_(torn, known)] @ inner, atol=1e-9)
    assert len(torn) == 3  # the guesses of a, which is stepped first


@pytest.mark.parametrize("kind", list(WIRES))
def test_newton_solves_vectors_in_two_sweeps(kind, build):
    run, direct = loop_of_vectors(kind, build, iterations=2)
    run.set(("a", "offset"), 1.0)
    run.advance(4 * MS)
    run.terminate()
    ends = ENDS[kind]
    offsets = [float(out[0] == "a") for out, _ in ends]
    for (source, _), value in zip(ends, np.linalg.solve(np.eye(len(ends)) - direct, offsets), strict=True):
        assert run.recording().signals[f"{source[0]}.y"][-1][source[1]] == pytest.approx(value, rel=1e-6)


def test_a_linearized_member_moves_as_its_matrices_say(build):
    """Around u0, y0: x' = A x + B (u - u0), y = y0 + C x + D (u - u0), with u held over the step."""
    run = couple(build, {"a": ThreeToTwo()}, [])
    run.initialize(0, MS)
    member = run.members["a"]
    u0, y0 = np.array([0.3, -0.7, 0.2]), np.array([0.04, 0.09])
    member.set("u", u0)
    member.set("y", y0)
    random = np.random.default_rng(1)
    a, b = np.array([[-2.0, 5.0], [-3.0, -1.0]]), random.normal(size=(2, 3))
    c, d = random.normal(size=(2, 2)), random.normal(size=(2, 3))
    linear = LinearMember(member, [member.variables["u"]], [member.variables["y"]], (a, b, c, d))
    run.terminate()
    h, change, x = 0.01, np.array([0.1, 0.02, -0.05]), np.zeros(2)
    linear.set("u", u0 + change)
    whole = np.zeros((5, 5))
    whole[:2, :2], whole[:2, 2:] = a * h, b * h
    for _ in range(3):
        assert linear._step(0, 0.0, h) == 0
        x = (expm(whole) @ np.concatenate([x, change]))[:2]
        np.testing.assert_allclose(linear.get("y"), y0 + c @ x + d @ change, rtol=1e-12)


class Sum(Mock):
    """y = 2 u + 3 w + 1 after each step, which it may refuse from one on."""

    def __init__(self, refused=99):
        super().__init__("a")
        self.refused, self.made = refused, 0
        self.variables = {v.name: v for v in (scalar("u", "input"), scalar("y", "output"), scalar("w", "input"))}

    def step(self, _instance, t, h, *_):
        self.made += 1
        if self.made >= self.refused:
            return 3
        self.memory[1] = 2.0 * self.memory[0] + 3.0 * self.memory[2] + 1.0
        return 1  # a warning


def test_derivatives_of_a_member_that_tells_none_are_differences_of_steps():
    member = Sum()
    member.memory[:3] = 5.0, 7.0, 0.0
    variables = member.variables
    found = derivatives_by_differences(member, [variables["u"], variables["w"]], [variables["y"]], 0.5, 0.01)
    np.testing.assert_allclose(found, [[2.0, 3.0]], rtol=1e-6)
    assert member.memory[:3].tolist() == [5.0, 7.0, 0.0], "it is where it was"
    assert member.made == 3
    for refused in (1, 2, 3):
        given = Sum(refused), [variables["u"], variables["w"]], [variables["y"]]
        assert derivatives_by_differences(*given, 0.5, 0.01) is None


def test_a_coupling_has_no_jacobian_if_a_member_refuses_or_is_not_finite():
    member = Sum()
    found = []
    for slopes in (None, (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[np.nan]]))):
        member.slopes, member.refused = (lambda *_, given=slopes: given), 1
        coupling = Coupling.__new__(Coupling)
        end = SimpleNamespace(member="a", variable=member.variables["y"], first=0)
        target = SimpleNamespace(member="a", variable=member.variables["u"], first=0)
        element = SimpleNamespace(number=0, link=SimpleNamespace(source=end, target=target, factor=1.0))
        coupling.plan = SimpleNamespace(count=1, members={"a": member, "b": member}, fed={id(element.link): [element]})
        coupling.torn, coupling.forward, coupling.names = [element], [], ["b", "a"]
        coupling.inputs = {"a": [member.variables["u"]], "b": []}
        coupling.outputs = {"a": [member.variables["y"]], "b": [member.variables["y"]]}
        found.append(coupling.jacobian(0.0, 0.01))
    assert found == [None, None]
