"""Methods: order of convergence, stability, periods; statuses."""

from math import cos, log2, sin

import numpy as np
import pytest

from twin.component import Component, input, output, solver, state


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


@pytest.mark.parametrize("h", [0.01, 0.002, 0.005, 0.003, 0.025])
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


@pytest.mark.parametrize("states", [0, 3])
@pytest.mark.parametrize("method", [None, solver.rk4(0.1), solver.ros2(0.1)])
def test_fields_of_a_method_are_there_only_for_states(method, states):
    """Copies of states, slopes of every stage (two for ros2), and the Jacobian where the method takes one."""
    shapes = {name: shape for name, (_, shape) in solver.hidden(method, 0, states, {}).items()}
    expected = {}
    if method is not None and states:
        expected = {"_x0": (3,), "_k": (max(len(method.b), 2), 3)}
        if method.name == "ros2":
            expected |= {"_jacobian": (3, 3), "_nominal": (3,)}
    assert shapes == expected
