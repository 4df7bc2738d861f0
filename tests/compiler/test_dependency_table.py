"""What the outputs of a component follow at one instant: by construct of Python, never less than the truth."""

import math  # noqa: F401 - names of the cases

from tests.every_case import every_case
from twin.compiler import flow
from twin.component import Component, Int64, define, input, local, output, parameter, state


def add(values, amount):
    """Changes an array."""
    values[0] += amount


def total(values, amount):
    """Reads an array."""
    return values[0] + amount


def publish(self, value):
    """Writes an output of the component."""
    self.y = value + self.c


def early(value):
    """Returns under a condition."""
    if value > 0.0:
        return 1.0
    return 0.0


ALL = "a b c n v x k"
CASES = [
    # lines, what y follows, what z follows
    ("self.y = self.a", "a", ""),
    ("self.y = self.a + self.b * self.x", "a b x", ""),
    ("self.y = 1.0\nself.z = self.k", "", "k"),
    ("w = self.a\nself.y = w\nself.z = self.b", "a", "b"),
    ("w: float = self.a\nself.y = w", "a", ""),
    ("w = self.a\nw = self.b\nself.y = w", "a b", ""),  # by name, whatever the order
    ("self.y, self.z = self.a, self.b", "a", "b"),
    ("p = self.a, self.b\nself.y, self.z = p", "a b", "a b"),
    ("self.y = self.a\nself.y += self.b", "a b", ""),
    ("if self.a > 0.0:\n    self.y = self.b\nelse:\n    self.z = self.c", "a b", "a c"),
    ("if self.a > 0.0:\n    if self.b > 0.0:\n        self.y = 1.0\n    self.z = 1.0", "a b", "a"),
    ("if self.a > 0.0:\n    return\nself.y = self.b\nself.z = 1.0", "a b", "a"),
    ("for i in range(self.n):\n    self.y = self.a\nself.z = self.b", "a n", "b"),
    ("for i in range(2):\n    if self.a > 0.0:\n        break\n    self.y = self.b\nself.z = 1.0", "a b", "a"),
    ("for i in range(2):\n    if self.a > 0.0:\n        continue\n    self.y = self.b", "a b", ""),
    ("i = 0\nwhile i < self.n:\n    i += 1\n    self.y = i\nself.z = 1.0", "n", ""),
    ("self.y = self.a if self.b > 0.0 else self.c", "a b c", ""),
    ("self.y = self.v[self.n]", "n v", ""),
    ("self.m[self.n] = self.a\nself.y = self.m[0]\nself.z = self.b", "a n", "b"),
    ("w = self.m\nw[0] = self.a\nself.y = self.m[1]", "a", ""),
    ("w = self.m if self.b > 0.0 else self.m\nw[0] = self.a\nself.y = self.m[1]", "a b", ""),
    ("add(self.m, self.a)\nself.y = self.m[0]\nself.z = self.b", "a", "b"),
    ("self.y = total(self.m, self.a)\nself.z = self.m[0]", "a", ""),
    ("publish(self, self.a)\nself.z = self.b", "a c", "b"),
    ("self.y = early(self.a)\nself.z = self.b", "a", "b"),
    ("self.y = math.sin(self.a) + min(self.b, self.c)", "a b c", ""),
    ("for value in self.v:\n    self.y += value", "v", ""),
]


def component(lines):
    """A component whose derivatives are these lines."""
    body = "\n".join(f"    {line}" for line in lines.split("\n"))
    return type(
        "Part",
        (Component,),
        {
            "__doc__": "A test.",
            **{name: input("", name) for name in "abc"},
            "n": input("", "whole", type=Int64),
            "v": input("", "array", shape=(2,)),
            "y": output("", "y"),
            "z": output("", "z"),
            "m": local(0.0, "", "array", shape=(2,)),
            "k": parameter(1.0, "", "k"),
            "x": state(0.0, "", "x"),
            "derivatives": define(
                "derivatives", f"def derivatives(self, t):\n    self.der_x = self.x\n{body}\n", dict(globals()), "cases"
            ),
        },
    )


@every_case(("lines", "y", "z"), CASES)
def test_what_an_output_follows(lines, y, z):
    found = flow(component(lines), ("derivatives",))
    sources = set(ALL.split())
    assert {name: set(found.get(name, ())) & sources for name in "yz"} == {"y": set(y.split()), "z": set(z.split())}
