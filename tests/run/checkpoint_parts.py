"""Components of checkpoint tests: a random walk with its random stream, a filter, and members that keep a run busy."""

import time

from twin.component import (
    Component,
    PythonComponent,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    solver,
    state,
)


class RandomWalk(Component):
    """Sum of random numbers, every 2 ms."""

    period = 2e-3

    seed = parameter(1, "", "random seed", type="Int64", fixed=True)
    y = output("1", "sum")
    stream = local(0, "", "random stream", shape=(6,), type="Int64")

    def initialize(self):
        seed_stream(self.stream, self.seed)
        self.y = 0.0

    def step(self, t, h):
        self.y = self.y + 0.1 * normal(self.stream)


class Oscillator(Component):
    """Mass on a spring, with two forces on it."""

    method = solver.rk4(1e-3)

    u = input("1", "force", start=0.0)
    w = input("1", "second force", start=0.0)
    gain = parameter(400.0, "", "stiffness")
    y = output("1", "position")
    x = state(0.0, "1", "position")
    v = state(1.0, "1/s", "velocity")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.u + self.w - self.gain * self.x - self.v
        self.y = self.x


class Slow(PythonComponent):
    """Count of its steps, each of 2 ms of the wall clock."""

    period = 1e-3
    state_is_record = True

    count = output("1", "steps")

    def step(self, t, h):
        time.sleep(2e-3)
        self.count = self.count + 1.0


class Remembers(PythonComponent):
    """Keeps its state in an attribute."""

    y = output("1", "steps")
    steps = 0

    def step(self, t, h):
        self.steps += 1
        self.y = float(self.steps)
