"""Slopes of operators and functions where a formula has a special case."""

import math
from math import copysign, sqrt

from tests.every_case import every_case
from twin.compiler import autodiff
from twin.component import Component, input, output


class Powers(Component):
    """Two operands."""

    a = input("", "base")
    b = input("", "exponent")
    y = output("", "power")

    def derivatives(self, t):
        self.y = self.a**self.b


class Kinks(Component):
    """At zero, functions continue as one of their branches."""

    u = input("", "input")
    w = input("", "second input")
    y = output("", "outputs", shape=(6,))

    def derivatives(self, t):
        self.y[0] = sqrt(max(self.u, 0.0))
        self.y[1] = abs(self.u)
        self.y[2] = max(self.u, 0.0)
        self.y[3] = min(self.u, 0.0)
        self.y[4] = max(self.u, self.w) + min(self.u, self.w)
        self.y[5] = copysign(self.u, self.w)


def slope(component, name):
    dot = type(component)(**dict.fromkeys([v.name for v in component.variables if v.role.name == "input"], 0.0))
    dot.record[...] = 0
    setattr(dot, name, 1.0)
    autodiff.tangents(type(component)).at(component, dot, 0.0, 0.0)
    return dot.y


@every_case(
    ("a", "b", "along_a", "along_b"),
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 1.0, 1.0, 0.0),
        (0.0, 2.0, 0.0, 0.0),
        (5.0, 0.0, 0.0, math.log(5.0)),
        (5.0, 1.0, 1.0, 5.0 * math.log(5.0)),
        (0.5, -1.0, -4.0, 2.0 * math.log(0.5)),
        (-3.0, 2.0, -6.0, 0.0),
    ],
)
def test_powers_of_zero_and_to_zero_have_finite_slopes(a, b, along_a, along_b):
    assert slope(Powers(a=a, b=b), "a") == along_a
    assert slope(Powers(a=a, b=b), "b") == along_b


def test_kinks_and_starts_of_roots_have_the_slope_of_a_branch():
    assert slope(Kinks(), "u").tolist() == [0.0, 0.0, 1.0, 1.0, 2.0, 1.0]
    assert slope(Kinks(), "w").tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert slope(Kinks(u=-2.0, w=1.0), "u").tolist() == [0.0, -1.0, 0.0, 1.0, 1.0, -1.0]
