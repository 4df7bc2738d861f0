"""Small components for tests of the algorithm."""

from pathlib import Path

import numpy as np

from twin import compiler
from twin.component import Component, Float64, Int32, PythonComponent, input, local, output, parameter, solver, state
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, RecordMember


class Lag(Component):
    """A first-order lag."""

    method = solver.rk4(1e-3)
    u = input("m", "in")
    y = output("m", "out")
    time_constant = parameter(0.1, "s", "time constant")
    x = state(0.0, "m", "state")

    def derivatives(self, t):
        self.der_x = (self.u - self.x) / self.time_constant
        self.y = self.x


class Clock(Component):
    """The time at the end of the step."""

    y = output("s", "time")

    def step(self, t, h):
        self.y = t + h


class SlowClock(Clock):
    """A clock that ticks every 10 ms."""

    period = 0.01


class Hold(Component):
    """What came in, one step later."""

    u = input("s", "in")
    y = output("s", "out")
    count = local(0, "", "steps made", type=Int32)

    def step(self, t, h):
        self.y = self.u
        self.count += 1


class SlowHold(Hold):
    """What came in, one period of 10 ms later."""

    period = 0.01


class Gain(Component):
    """Direct feedthrough: y = k u + c."""

    u = input("m", "in")
    y = output("m", "out")
    k = parameter(0.5, "", "gain")
    c = parameter(1.0, "m", "offset")

    def derivatives(self, t):
        self.y = self.k * self.u + self.c


class Millimeters(Component):
    """Shows what came in, declared in mm, and in mixed types."""

    u = input("mm", "in")
    y = output("mm", "out")
    n = input("", "a number", type=Float64)
    positive = output("", "sign", start=False)

    def step(self, t, h):
        self.y = self.u
        self.positive = self.u > 0.0


class Bomb(PythonComponent):
    """Raises at a time."""

    u = input("m", "in")
    y = output("m", "out")
    at = parameter(0.05, "s", "when")
    closed = 0

    def step(self, t, h):
        self.y = self.u
        if t >= self.at - 1e-9:
            raise ValueError("boom")

    def close(self):
        self.closed += 1


class Diverging(Component):
    """A state that becomes infinite."""

    y = output("m", "out")
    x = state(1.0, "m", "state")
    method = solver.euler(1e-3)

    def derivatives(self, t):
        self.der_x = 1e6 * self.x * self.x
        self.y = self.x


def couple(
    build: Path,
    parts: dict,
    connections: list[str],
    algorithm=Algorithm.jacobi,
    step=1_000_000,
    mode="compiled",
    record=None,
    every=0,
    periods=None,
    recorder=None,
) -> CoSimulation:
    """A co-simulation of component instances; connections are `a.y -> b.u`."""
    members = {}
    for name, component in parts.items():
        native = mode == "compiled" and not isinstance(component, PythonComponent)
        members[name] = RecordMember(
            name, component, compiler.load_component(type(component), build) if native else None
        )
    catalog = {name: member.variables for name, member in members.items()}
    system = CoupledSystem(catalog, [Connection(*connection.split(" -> ")) for connection in connections])
    return CoSimulation(
        members,
        system.links(),
        step,
        algorithm,
        build=build,
        record=record,
        every=every,
        periods=periods,
        recorder=recorder,
    )


def trajectory(simulation: CoSimulation, stop: int, name: str) -> np.ndarray:
    """Run to `stop` [ns] and return one signal."""
    simulation.initialize(0, stop)
    simulation.advance(stop)
    simulation.terminate()
    return simulation.recording().signals[name]
