"""Two masses, and a quarter of a car, cut in two: what co-simulation algorithms are measured with.

Force/displacement: one side tells where it is, the other one answers with the force of what connects them, which depends
on that at once. Displacement/displacement: both tell where they are, and both know what connects them.
All values: assumed, of usual size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.component import Component, input, output, parameter, solver, state


class Mass(Component):
    """A mass on a spring and a damper of its own, pushed by a force from outside."""

    method = solver.rk4(2.5e-4)
    f = input("N", "force on the mass")
    x = output("m", "where it is")
    v = output("m/s", "how fast it is")
    m = parameter(1.0, "kg", "mass")
    k = parameter(100.0, "N/m", "stiffness of its own spring")
    d = parameter(1.0, "N*s/m", "damping of its own")
    begin = parameter(0.0, "m", "where it begins", fixed=True)
    position = state(0.0, "m", "where it is")
    speed = state(0.0, "m/s", "how fast it is")

    def initialize(self):
        self.position = self.begin

    def derivatives(self, t):
        self.x, self.v = self.position, self.speed
        self.der_position = self.speed
        self.der_speed = (self.f - self.k * self.position - self.d * self.speed) / self.m


class Answering(Mass):
    """The same, and a spring and a damper to another mass, whose force on that one it tells."""

    other_x = input("m", "where the other mass is")
    other_v = input("m/s", "how fast the other mass is")
    force = output("N", "on the other mass")
    between_k = parameter(200.0, "N/m", "stiffness of the spring between")
    between_d = parameter(2.0, "N*s/m", "damping between")
    cubic = parameter(0.0, "N/m^3", "what makes the spring between stiffer when it is long")
    square = parameter(0.0, "N*s^2/m^2", "what makes the damper between stiffer when it is fast")

    def derivatives(self, t):
        self.x, self.v = self.position, self.speed
        long, fast = self.position - self.other_x, self.speed - self.other_v
        self.force = (self.between_k + self.cubic * long * long) * long + (
            self.between_d + self.square * abs(fast)
        ) * fast
        self.der_position = self.speed
        self.der_speed = (self.f - self.force - self.k * self.position - self.d * self.speed) / self.m


FORCE = (("a.x", "b.other_x"), ("a.v", "b.other_v"), ("b.force", "a.f"))
PLACES = (("a.x", "b.other_x"), ("a.v", "b.other_v"), ("b.x", "a.other_x"), ("b.v", "a.other_v"))


@dataclass(frozen=True)
class Pair:
    """A coupling: what it is made of, how it is cut, and for how long and with which steps [ms] it is looked at."""

    first: dict[str, float]
    second: dict[str, float]
    between: dict[str, float]
    connections: tuple[tuple[str, str], ...]
    duration: int = 1024  # [ms]
    steps: tuple[float, ...] = (16, 8, 4, 2, 1)
    begin: float = 0.01  # where the first mass begins [m]

    @property
    def is_bond(self) -> bool:
        """Whether a force goes one way, and the place of what it moves the other."""
        return self.connections is FORCE

    def parts(self) -> dict[str, Component]:
        """The two sides."""
        kind, knows = (Mass, {}) if self.connections is FORCE else (Answering, self.between)
        return {"a": kind(begin=self.begin, **self.first, **knows), "b": Answering(**self.second, **self.between)}

    def rates(self, y):
        """Derivatives of both places and speeds, uncut."""
        x1, v1, x2, v2 = y
        own = {"m": 1.0, "k": 100.0, "d": 1.0}
        one, two = own | self.first, own | self.second
        long, fast = x2 - x1, v2 - v1
        c = {"between_k": 200.0, "between_d": 2.0, "cubic": 0.0, "square": 0.0} | self.between
        force = (c["between_k"] + c["cubic"] * long**2) * long + (c["between_d"] + c["square"] * abs(fast)) * fast
        return np.array(
            [
                v1,
                (force - one["k"] * x1 - one["d"] * v1) / one["m"],
                v2,
                (-force - two["k"] * x2 - two["d"] * v2) / two["m"],
            ]
        )


WHEEL, BODY = {"m": 40.0, "k": 150e3, "d": 0.0}, {"m": 400.0, "k": 0.0, "d": 0.0}
SUSPENSION = {"between_k": 15e3, "between_d": 1e3}
PAIRS = {
    "two masses, force": Pair({}, {}, {}, FORCE),
    "two masses, places": Pair({}, {}, {}, PLACES),
    "two masses, stiffening, force": Pair({}, {}, {"cubic": 1e6}, FORCE),
    "quarter car, force": Pair(WHEEL, BODY, SUSPENSION, FORCE, 512, (8, 4, 2, 1, 0.5)),
    "quarter car, places": Pair(WHEEL, BODY, SUSPENSION, PLACES, 512, (8, 4, 2, 1, 0.5)),
    "quarter car, progressive damper, force": Pair(
        WHEEL, BODY, SUSPENSION | {"square": 2e3}, FORCE, 512, (8, 4, 2, 1, 0.5)
    ),
}
