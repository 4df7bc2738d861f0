"""Arithmetic over recorded signals: what metrics, expectations and plots are made of.

`sensor.force - controller.setpoint`, `abs(sheath.x[3])`, `norm(tip.position)`. Python's parser reads it, but only the
nodes named here are evaluated. Every signal is in coherent SI units, whatever unit its member has.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

Shape = tuple[int, ...]

MAX_LENGTH = 400

FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {  # with the least number of arguments
    "abs":  (np.abs, 1),
    "sqrt": (np.sqrt, 1),
    "norm": (lambda x: np.sqrt(np.sum(np.square(x), axis=-1)) if np.ndim(x) > 1 else np.abs(x), 1),
    "min":  (lambda *x: np.min(np.broadcast_arrays(*x), axis=0), 2),
    "max":  (lambda *x: np.max(np.broadcast_arrays(*x), axis=0), 2),
}  # fmt: skip

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add:  np.add,
    ast.Sub:  np.subtract,
    ast.Mult: np.multiply,
    ast.Div:  np.divide,
    ast.Pow:  np.power,
}  # fmt: skip

USE = "Use names like sensor.force or sheath.x[3], numbers, + - * / ** and abs, sqrt, norm, min, max."


@dataclass(frozen=True)
class Signal:
    """A name in an expression: member.variable, and the element of an array counted from 1."""

    name: str
    index: tuple[int, ...] = ()

    def __str__(self) -> str:
        return self.name + (f"[{','.join(map(str, self.index))}]" if self.index else "")


@dataclass(frozen=True)
class Expression:
    """A parsed expression; `signals` are those it reads, in order of appearance."""

    text: str
    signals: tuple[Signal, ...] = field(compare=False)
    tree: ast.expr = field(compare=False, repr=False)

    def evaluate(self, values: Mapping[str, Any]) -> Any:
        """The value at every sample; `values`: member.variable -> array (n, ...). KeyError: not recorded."""
        with np.errstate(all="ignore"):
            return evaluate(self.tree, values)

    def magnitude(self, values: Mapping[str, Any]) -> Any:
        """Size of the numbers that add up to the value at every sample: of `a.x - b.x`, that of `abs(a.x) + abs(b.x)`."""
        with np.errstate(all="ignore"):
            return magnitude(self.tree, values)

    def shape(self, shapes: Mapping[str, Shape]) -> Shape:
        """Shape of the value at one sample; `shapes`: of each signal. KeyError and IndexError: no such signal, element.

        ScenarioError says which parts do not go together.
        """
        return shape(self.tree, shapes) or ()

    def array_problem(self, shapes: Mapping[str, Shape]) -> str:
        """Why the value at one sample is no single number, or nothing."""
        try:
            found = self.shape(shapes)
        except ScenarioError as error:
            return str(error)
        if not found:
            return ""
        whole = f", or take norm({self.text})" if len(found) == 1 and self.single else ""
        return f"{self.text} {sized(found)}, expected a single value. {elements(self.tree, shapes)}{whole}."

    @property
    def single(self) -> Signal | None:
        """The signal, if the expression is nothing but its name."""
        return self.signals[0] if isinstance(self.tree, ast.Attribute | ast.Subscript) else None


def parse(text: Any) -> Expression:
    """Read an expression; ScenarioError says what is wrong with it."""
    if isinstance(text, int | float) and not isinstance(text, bool):
        text = repr(text)
    if not isinstance(text, str) or not text.strip():
        raise ScenarioError("expected an expression of signals, such as sensor.force")
    if len(text) > MAX_LENGTH:
        raise ScenarioError(f"an expression of {len(text)} characters is too long. Let a component compute it")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        found: dict[str, Signal] = {}
        check(tree, text, found)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ScenarioError(f"`{text.strip()}` is not an expression. {USE}") from None
    return Expression(text.strip(), tuple(found.values()), tree)


def check(node: ast.expr, text: str, found: dict[str, Signal]) -> None:
    """Refuse whatever `evaluate` does not know, and collect the signals."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            check(operand, text, found)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in OPERATORS:
            check(left, text, found)
            check(right, text, found)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            least = FUNCTIONS[name][1]
            if len(arguments) < least or (least == 1 and len(arguments) > 1):
                need = "one argument" if least == 1 else "two or more arguments"
                raise ScenarioError(f"`{text.strip()}`: {name} takes {need}, not {len(arguments)}")
            for argument in arguments:
                check(argument, text, found)
        case ast.Attribute() | ast.Subscript():
            signal = name_of(node)
            found[str(signal)] = signal
        case _:
            raise ScenarioError(f"`{text.strip()}`: `{ast.unparse(node)[:40]}` cannot be used. {USE}")


def name_of(node: ast.expr) -> Signal:
    """The signal that `member.variable` or `member.variable[1,2]` names."""
    index: tuple[int, ...] = ()
    if isinstance(node, ast.Subscript):
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        numbers = [part.value for part in parts if isinstance(part, ast.Constant)]
        index = tuple(value for value in numbers if type(value) is int and value >= 1)
        if len(index) != len(parts) or not index:
            raise ScenarioError(f"`{ast.unparse(node)}`: elements are counted from 1, as in sheath.x[1] or a.m[1,2]")
        node = node.value
    names: list[str] = []
    while isinstance(node, ast.Attribute):
        names.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name) or not names:
        raise ScenarioError(f"`{ast.unparse(node)[:40]}` is not a signal. {USE}")
    return Signal(".".join([node.id, *reversed(names)]), index)


def evaluate(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """Value of a checked node."""
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -evaluate(operand, values)
        case ast.UnaryOp(operand=operand):
            return evaluate(operand, values)
        case ast.BinOp(left=left, op=operator, right=right):
            return OPERATORS[type(operator)](evaluate(left, values), evaluate(right, values))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(evaluate(argument, values) for argument in arguments))
    signal = name_of(node)
    array = values[signal.name]
    return array[(slice(None), *(i - 1 for i in signal.index))] if signal.index else array


def magnitude(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """Size of what a checked node is made of."""
    match node:
        case ast.UnaryOp(operand=operand):
            return magnitude(operand, values)
        case ast.BinOp(left=left, op=operator, right=right):
            first = magnitude(left, values)
            if isinstance(operator, ast.Pow):
                return np.power(first, evaluate(right, values))
            combine = np.add if isinstance(operator, ast.Sub) else OPERATORS[type(operator)]
            return combine(first, magnitude(right, values))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][0](*(magnitude(argument, values) for argument in arguments))
    return np.abs(evaluate(node, values))


def shape(node: ast.expr, shapes: Mapping[str, Shape]) -> Shape | None:
    """Shape of a checked node at one sample; None: a number, which goes with any shape."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(operand=operand):
            return shape(operand, shapes)
        case ast.BinOp(left=left, right=right):
            return joined([left, right], node, shapes)
        case ast.Call(func=ast.Name(id="norm"), args=[argument]):
            inner = shape(argument, shapes)
            return inner[:-1] if inner else inner
        case ast.Call(args=arguments):
            return joined(arguments, node, shapes)
    signal = name_of(node)
    found = shapes[signal.name]
    if not signal.index:
        return found
    if len(signal.index) != len(found) or any(i > n for i, n in zip(signal.index, found, strict=True)):
        raise IndexError(str(signal))
    return ()


def joined(parts: Sequence[ast.expr], node: ast.expr, shapes: Mapping[str, Shape]) -> Shape | None:
    """The shape that all parts but numbers have; there is none for an array and a single value, or another array."""
    found = {ast.unparse(part): (part, of) for part in parts if (of := shape(part, shapes)) is not None}
    if len({of for _, of in found.values()}) > 1:
        sizes = ", ".join(f"{text} {sized(of)}" for text, (_, of) in found.items())
        raise ScenarioError(f"`{ast.unparse(node)}`: {sizes}, expected equal shapes. {elements(node, shapes)}.")
    return next((of for _, of in found.values()), None)


def sized(found: Shape) -> str:
    """`is an array of 3`."""
    return f"is an array of {' x '.join(map(str, found))}" if found else "is a single value"


def elements(node: ast.expr, shapes: Mapping[str, Shape]) -> str:
    """What to write instead of the arrays in a node: `Name one of a.x[1] to a.x[3]`."""
    found: dict[str, Signal] = {}
    check(node, ast.unparse(node), found)
    spans = []
    for signal in found.values():
        if (of := shapes[signal.name]) and not signal.index:
            ends = [f"{signal}[{','.join(map(str, index))}]" for index in ((1,) * len(of), of)]
            spans.append(" to ".join(dict.fromkeys(ends)) if all(of) else f"no element of {signal}")
    return f"Name one of {', one of '.join(spans)}"
