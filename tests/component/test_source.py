"""What the linter and the declarations of components teach."""

from __future__ import annotations

import math

import pytest

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


@pytest.mark.parametrize(
    ("cls", "expected"),
    [
        (NoDerivative, "NoDerivative.der_x: is never set. Write self.der_x = ... in derivatives(self, t)."),
        (WithoutSelf, "WithoutSelf.y: is never set. Write self.y = ... in step(self, t, h)."),
        (Outside, "`self.a[4]` is outside of a, whose indices end at 3. Correct it."),
        (Unit, "Unit.y: unit 'metr' is not known"),
    ],
)
def test_source_problem(cls: type[Component], expected: str) -> None:
    problems = source.check(cls)
    assert len(problems) == 1
    assert expected in problems[0]


@pytest.mark.parametrize(
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
