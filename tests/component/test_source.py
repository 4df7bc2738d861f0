"""What the linter and the declarations of components teach."""

from __future__ import annotations

import math

import pytest

from tests.every_case import every_case
from twin.component import Component, catalog, functions, local, output, source, state
from twin.errors import DeclarationError


class NoDerivative(Component):
    y = output("m", "y")
    x = state(0.0, "m", "x")

    def derivatives(self, t):
        self.y = self.x


class WithoutSelf(Component):
    y = output("m", "y")

    def step(self, t, h):
        y = math.sin(t)  # noqa: F841


class Outside(Component):
    y = output("m", "y")
    a = local(0.0, "m", "a", shape=(4,))

    def step(self, t, h):
        self.a[4] = t
        self.y = self.a[-1]


class Unit(Component):
    y = output("metr", "y")

    def step(self, t, h):
        self.y = math.sin(t)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cls", "expected"),
    [
        (NoDerivative, "NoDerivative.der_x: is never set. Write self.der_x = ... in derivatives(self, t)."),
        (WithoutSelf, "WithoutSelf.y: is never set; step sets a local variable `y`. Write self.y = ..."),
        (Outside, "`self.a[4]` is outside of a, whose indices end at 3. Correct it."),
        (Unit, "Unit.y: unit 'metr' is not known"),
    ],
)
def test_source_problem(cls: type[Component], expected: str) -> None:
    problems = source.check(cls)
    assert len(problems) == 1
    assert expected in problems[0]


@every_case(
    ("fields", "expected"),
    [
        ({"time": output("s", "t")}, "time: this name is the engine's own"),
        ({"step": output("s", "t")}, "step: this name is the engine's own"),
        ({"größe": output("m", "y")}, "letters a to z, digits and _ only"),
        ({"x": state(0.0, "m", "x"), "der_x": output("m/s", "d")}, "der_x: is declared by the state 'x'"),
        ({"period": -1e-3}, "period: -0.001 s is not positive"),
    ],
)
def test_declaration_problem(fields: dict[str, object], expected: str) -> None:
    with pytest.raises(DeclarationError, match=expected):
        type("Part", (Component,), {"derivatives": lambda self, t: None, **fields})


MISTAKES = [
    ("raise ValueError", "`raise` is lost in native code. Return a status (`-> int`, ERROR of twin.solver) instead."),
    ("assert t > 0.0", "`assert` is lost in native code. Return a status instead."),
    ("a = [1.0]", "a list allocates. Declare an array with shape=..., or use a tuple of the module."),
    ("print(t)", "`print()` would do I/O and cannot stand in a component. Use a PythonComponent for that."),
    (
        "a = sorted(self.v)",
        "`sorted()` would allocate and cannot stand in a component. Use a PythonComponent for that.",
    ),
    (
        "a = np.zeros(3)",
        "`np.zeros()` allocates an array. Declare a local() with shape=... and loop over it, or derive from PythonComponent.",
    ),
    ("a = np.random.normal()", "`np.random.normal()` has no form in C. Use normal of twin.component."),
    (
        "a = np.linalg.norm(self.v)",
        "`np.linalg.norm()` has no form in C. Use a loop over the elements, or derive from PythonComponent.",
    ),
    (
        "a = self.v.max()",
        "`.max()` of an array has no form in C. Write the loop over its elements, or derive from PythonComponent.",
    ),
    ("self.vv[0] = 1.0", "`self.vv` is not declared. Did you mean `v`? Known: p, u, v, w, y. Else declare it."),
    ("self.v[2] = self.v[3]", "`self.v[3]` is outside of v, whose indices end at 2. Correct it."),
    ("self.w[1, 2] = self.w[1, 1]", "`self.w[1, 2]` is outside of w, whose indices end at 1. Correct it."),
    ("self.u = 1.0", "writes input `self.u`, which is set from outside. Use a local() for it."),
    ("self.p[0] += 1.0", "writes parameter `self.p`, which is set from outside. Use a local() for it."),
    ("self.y, self.u = 1.0, 2.0", "writes input `self.u`, which is set from outside. Use a local() for it."),
    ("self.v = self.v", "assigns the whole array `self.v`. Loop over its elements: self.v[i] = ...."),
    ("self.y = helped(t)", None),
]
WRONG = """import numpy as np
from twin.component import Component, input, local, output, parameter


def helped(t):
    return max([t, 0.0])


def unused(t):
    raise ValueError


class Wrong(Component):
    \"\"\"Everything that a component cannot do.\"\"\"

    u = input("", "in")
    y = output("", "out")
    v = local(0.0, "", "three", shape=(3,))
    w = local(0.0, "", "two by two", shape=(2, 2))
    p = parameter((1.0, 2.0), "", "two", source="assumed")

    def step(self, t, h):
        self.y = self.v[0] + self.v[-1] + self.w[1, 1] + abs(self.p[1]) + np.sin(t)
"""


def test_each_mistake_is_told_with_its_line(tmp_path, monkeypatch) -> None:
    """In order; what a helper does wrong comes after, and a function that is not called is not looked at."""
    text = WRONG + "".join(f"        {line}\n" for line, _ in MISTAKES)
    (tmp_path / "wrong_part.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    problems = source.check(catalog.component("wrong_part:Wrong"))
    first = WRONG.count("\n") + 1
    where = f"Wrong ({tmp_path}/wrong_part.py:%d): "
    expected = [f"{where % (first + i)}{message}" for i, (_, message) in enumerate(MISTAKES) if message]
    helper = f"{where % 6}a list allocates. Declare an array with shape=..., or use a tuple of the module."
    assert sorted(problems) == sorted([*expected, helper])
    assert source.check(catalog.component("wrong_part:Wrong")) == problems


def test_a_name_that_hides_a_builtin_may_be_called() -> None:
    class Own(Component):
        """Calls what is called like a builtin, and a method of a module."""

        y = output("m", "y")

        def step(self, t, h):
            self.y = print(t) + math.copysign(1.0, t)

    Own.step.__globals__["print"] = print_nothing
    try:
        assert source.check(Own) == []
    finally:
        del Own.step.__globals__["print"]


def print_nothing(t):
    return t


def test_arguments_are_counted() -> None:
    part = type("Part", (Component,), {"step": lambda self, t: None})
    with pytest.raises(DeclarationError, match=r"Part.step: expected step\(self, t, h\)"):
        functions(part)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("divides", "1 / 0\n", r"divides.py:1: ZeroDivisionError: division by zero. Correct it there."),
        ("leaves", "import sys\nsys.exit(3)\n", r"leaves.py:2: SystemExit: 3"),
        ("stutters", "class A(:\n", r"stutters.py:1: SyntaxError"),
        ("needs", "import nothing_there\n", "No module named 'nothing_there'"),
    ],
)
def test_module_that_cannot_be_imported(tmp_path, monkeypatch, name: str, text: str, expected: str) -> None:
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(DeclarationError, match=expected):
        catalog.component(f"{name}:Part")
