"""Python-side components for tests: a pymunk body pushed by a force, and some that fail."""

from __future__ import annotations

import pymunk

from twin.component import PythonComponent, input, output, parameter


class Puck(PythonComponent):
    """A disc on ice, pushed along x."""

    period = 1e-3

    force = input("N", "push along x")
    position = output("m", "place along x", display_unit="mm")
    mass = parameter(0.5, "kg", "mass", source="assumed")

    def initialize(self):
        self.space = pymunk.Space()
        self.body = pymunk.Body(float(self.mass), 1.0)
        self.space.add(self.body, pymunk.Circle(self.body, 0.1))
        self.position = self.body.position.x

    def step(self, t, h):
        self.body.apply_force_at_local_point((float(self.force), 0.0))
        self.space.step(h)
        self.position = self.body.position.x


class Burns(PythonComponent):
    """Fails after 0.3 s."""

    u = input("N", "load")
    y = output("s", "time")

    def step(self, t, h):
        self.y = t
        if t >= 0.3:
            raise RuntimeError("the motor\nburnt")


class BusGone(PythonComponent):
    """Fails when it is closed."""

    y = output("s", "time")

    def step(self, t, h):
        self.y = t

    def close(self):
        raise OSError("bus gone")


class Unmade(PythonComponent):
    """Forgets its base class."""

    y = output("s", "time")

    def __init__(self):
        pass

    def step(self, t, h):
        self.y = t
