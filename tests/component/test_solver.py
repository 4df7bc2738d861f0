"""Methods: order of convergence, stability, periods; statuses."""

from math import cos, log2, sin, sqrt

import numpy as np
import pytest

from tests.every_case import every_case
from twin.component import Boolean, Component, Float64, Int32, input, local, output, solver, state


def oscillator(method_):
    class Oscillator(Component):
        """x'' = -x + forcing in time."""

        method = method_
        x = state((1.0, 0.0), "", "position and speed")
        y = output("", "position")

        def derivatives(self, t):
            self.der_x[0] = self.x[1]
            self.der_x[1] = -self.x[0] + sin(2.0 * t)
            self.y = self.x[0]

    return Oscillator


def exact(t):
    return cos(t) + 2 / 3 * sin(t) - sin(2 * t) / 3


@pytest.mark.parametrize("method", [solver.euler, solver.heun, solver.rk4, solver.ros2])
def test_order_of_convergence(method):
    errors = []
    for substep in (0.02, 0.01):
        component = oscillator(method(substep))()
        component.start()
        for k in range(10):
            assert component.advance(k * 0.1, 0.1) == solver.OK
        errors.append(abs(component.y - exact(1.0)))
    assert log2(errors[0] / errors[1]) == pytest.approx(method(1.0).order, abs=0.15)


def test_ros2_is_stable_where_explicit_methods_are_not():
    def stiff(method_):
        class Stiff(Component):
            """Dahlquist's equation with a rate of 1e6 1/s, following an input."""

            method = method_
            u = input("", "target")
            x = state(0.0, "", "follower")

            def derivatives(self, t):
                self.der_x = 1e6 * (self.u - self.x)

        return Stiff

    fine = stiff(solver.ros2(1e-3))(u=1.0)
    fine.start()
    assert fine.advance(0.0, 0.01) == solver.OK
    assert fine.x == pytest.approx(1.0, abs=1e-6)
    wild = stiff(solver.rk4(1e-3))(u=1.0)
    wild.start()
    with np.errstate(all="ignore"):
        assert max(wild.advance(k * 0.1, 0.1) for k in range(10)) == solver.ERROR


def test_substeps_divide_the_step_evenly():
    seen = []

    class Probe(Component):
        """Notes when it is evaluated."""

        method = solver.euler(0.3)
        x = state(0.0, "", "x")

        def derivatives(self, t):
            seen.append(t)
            self.der_x = 1.0

    probe = Probe()
    probe.start()
    seen.clear()
    probe.advance(0.0, 1.0)
    assert seen == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    assert probe.x == pytest.approx(1.0)


class Sampler(Component):
    """Publishes its input one period later."""

    period = 0.01
    u = input("", "in")
    y = output("", "out")

    def step(self, t, h):
        self.y = self.u
        assert h == 0.01


@every_case("h", [0.01, 0.002, 0.005, 0.003, 0.025])
def test_a_sampled_component_keeps_its_period_under_any_step(h):
    sampler = Sampler()
    sampler.start()
    for k in range(int(0.1 / h)):
        begin = k * h
        sampler.u = begin
        sampler.advance(begin, h)
        # the tick that is due last by the end of this step saw the input of the communication step that held it
        ticks = int((begin + h) / 0.01 + 1e-9)
        if ticks:
            due = (ticks - 1) * 0.01
            assert sampler.y == pytest.approx(np.floor(due / h + 1e-9) * h)


def test_a_component_may_return_a_status():
    class Refuses(Component):
        """Fails when its input is negative."""

        u = input("", "in")

        def step(self, t, h) -> int:
            return solver.ERROR if self.u < 0.0 else solver.OK

    refuses = Refuses()
    assert refuses.advance(0.0, 1.0) == solver.OK
    refuses.u = -1.0
    assert refuses.advance(0.0, 1.0) == solver.ERROR


@every_case("states", [0, 3])
@every_case("method", [None, solver.rk4(0.1), solver.ros2(0.1)])
def test_fields_of_a_method_are_there_only_for_states(method, states):
    """Copies of states, slopes of every stage (two for ros2), and the Jacobian where the method takes one."""
    shapes = {name: shape for name, (_, shape) in solver.hidden(method, 0, states, {}).items()}
    expected = {}
    if method is not None and states:
        expected = {"_x0": (3,), "_k": (max(len(method.b), 2), 3)}
        if method.name == "ros2":
            expected |= {"_jacobian": (3, 3), "_nominal": (3,)}
    assert shapes == expected


def rates(t, x):
    """A system of two equations that is neither linear nor autonomous, and its Jacobian."""
    return np.array([x[0] * x[1] + t, -3.0 * x[1] ** 2 + t * x[0]]), np.array([[x[1], x[0]], [t, -6.0 * x[1]]])


def two_equations(method_):
    class Two(Component):
        """See `rates`."""

        method = method_
        x = state((0.5, -0.25), "", "both")

        def derivatives(self, t):
            self.der_x[0] = self.x[0] * self.x[1] + t
            self.der_x[1] = -3.0 * self.x[1] ** 2 + t * self.x[0]

    return Two()


def by_hand(name, t, h, x):
    def f(s, y):
        return rates(s, y)[0]

    if name == "euler":
        return x + h * f(t, x)
    if name == "heun":
        k1 = f(t, x)
        return x + h / 2 * (k1 + f(t + h, x + h * k1))
    if name == "rk4":
        k1 = f(t, x)
        k2 = f(t + h / 2, x + h / 2 * k1)
        k3 = f(t + h / 2, x + h / 2 * k2)
        k4 = f(t + h, x + h * k3)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    matrix = np.eye(2) - (1 - sqrt(0.5)) * h * rates(t, x)[1]  # ROS2: Verwer and others 1999, equation 2.5
    k1 = np.linalg.solve(matrix, f(t, x))
    k2 = np.linalg.solve(matrix, f(t + h, x + h * k1) - 2 * k1)
    return x + h * (1.5 * k1 + 0.5 * k2)


@pytest.mark.parametrize("name", ["euler", "heun", "rk4", "ros2"])
def test_a_step_is_that_of_the_textbook(name):
    component = two_equations(getattr(solver, name)(0.2))
    component.start()
    assert component.advance(1.5, 0.2) == solver.OK
    expected = by_hand(name, 1.5, 0.2, np.array([0.5, -0.25]))
    np.testing.assert_allclose(component.x, expected, rtol=1e-6 if name == "ros2" else 1e-14)
    np.testing.assert_allclose(component.der_x, rates(1.7, component.x)[0], err_msg="derivatives are those of the end")


@pytest.mark.parametrize("n", [1, 2, 4])
def test_equations_of_a_linearly_implicit_method_are_solved(n):
    """In the row that is asked for, with a matrix that is diagonally dominant."""
    random = np.random.default_rng(n)
    matrix, right = random.normal(size=(n, n)) + 10.0 * np.eye(n), random.normal(size=(2, n))
    factors, found = matrix.copy(), right.copy()
    solver.factorize(factors, n)
    solver.substitute(factors, found, 1, n)
    np.testing.assert_allclose(found, [right[0], np.linalg.solve(matrix, right[1])])


@pytest.mark.parametrize("bad", [0, 1])
def test_a_state_that_is_not_finite_is_an_error(bad):
    component = two_equations(solver.euler(0.1))
    component.start()
    component.x[bad] = np.nan
    assert component.advance(0.0, 0.1) == solver.ERROR


def test_the_inputs_of_a_tick_are_copied_element_by_element():
    """And exchanged with those of now: a Boolean is a condition in C, so it is written as one."""
    text = solver.hold((("u", Float64, ()), ("on", Boolean, ()), ("_v", Int32, (2,)), ("b", Boolean, (2, 3))))
    assert text["take_inputs"].splitlines() == [
        "def take_inputs(self):",
        "    self._held_u[0] = self.u",
        "    self._held_on[0] = self.on",
        "    for i0 in range(2):",
        "        self._held__v[i0] = self._v[i0]",
        "    for i0 in range(2):",
        "        for i1 in range(3):",
        "            self._held_b[i0, i1] = self.b[i0, i1]",
    ]
    assert text["swap_inputs"].splitlines()[:9] == [
        "def swap_inputs(self):",
        "    new_u = self.u",
        "    self.u = self._held_u[0]",
        "    self._held_u[0] = new_u",
        "    new_on = self.on",
        "    self.on = self._held_on[0] != 0",
        "    self._held_on[0] = new_on",
        "    for i0 in range(2):",
        "        new_v = self._v[i0]",
    ]
    assert text["swap_inputs"].splitlines()[-3:] == [
        "            new_b = self.b[i0, i1]",
        "            self.b[i0, i1] = self._held_b[i0, i1]",
        "            self._held_b[i0, i1] = new_b",
    ]
    assert solver.hold(())["swap_inputs"].splitlines() == ["def swap_inputs(self):", "    pass"]


class Journal(Component):
    """Notes the times of its ticks and the inputs that it saw; its status is that of the tick."""

    period = 0.25
    u = input("", "in")
    seen = local(0.0, "", "times and inputs", shape=(8, 2))
    count = local(0, "", "ticks", type=Int32)

    def step(self, t, h) -> int:
        self.seen[self.count, 0] = t
        self.seen[self.count, 1] = self.u
        self.count += 1
        return solver.WARNING if self.count == 1 else solver.OK


class Source(Journal):
    """The same without an input."""

    u = local(0.0, "", "nothing")


@every_case("begin", [0.0, 100.0, 0.3, 0.1 + 0.2])
@every_case(
    ("steps", "seen"),
    [  # lengths of steps, and the ticks with their inputs, which are the numbers of the steps
        ([0.25, 0.25], [(0.0, 1), (0.25, 2)]),
        ([0.5, 0.25], [(0.0, 1), (0.25, 1), (0.5, 2)]),
        ([0.125, 0.125, 0.125, 0.125], [(0.0, 1), (0.25, 3)]),
        ([0.2, 0.2], [(0.0, 1)]),  # the next one is held from 0.25 on
        ([0.2, 0.2, 0.2], [(0.0, 1), (0.25, 2)]),
        ([0.125], []),
        ([1.0], [(0.0, 1), (0.25, 1), (0.5, 1), (0.75, 1)]),
    ],
)
def test_ticks_count_from_the_begin_of_the_run(begin, steps, seen):
    for cls in (Journal, Source):
        part = cls()
        for _ in range(2):
            part.start(*([begin] if begin else []))
            part.count, t, statuses = 0, begin, []
            for number, h in enumerate(steps):
                part.u = number + 1.0
                statuses.append(part.advance(t, h))
                t += h
            exact = 0.3 if begin not in (0.0, 100.0) else begin  # to the nanosecond
            expected = [(pytest.approx(exact + tick), float(number)) for tick, number in seen]
            assert part.count == len(seen)
            rows = [tuple(row) for row in part.seen[: len(seen)].tolist()]
            assert rows == expected if cls is Journal else [t for t, _ in rows] == [t for t, _ in expected]
            assert max(statuses) == (solver.WARNING if seen else solver.OK), "the worst of all its ticks"
            assert part.u == float(len(steps)), "inputs are those of now again"
