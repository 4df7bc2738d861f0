"""Arithmetic expressions over recorded signals, used by metrics, expectations and plots.

`sensor.force - controller.setpoint`, `abs(sheath.x[3])`, `norm(tip.position)`. Python's parser reads them, but only the
nodes listed here are evaluated. Every signal is in coherent SI units, regardless of its member's unit.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

Shape = tuple[int, ...]

MAX_LENGTH = 400

FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {  # with the minimum number of arguments
    "abs": (np.abs, 1),
    "sqrt": (np.sqrt, 1),
    "norm": (lambda x: np.sqrt(np.sum(np.square(x), axis=-1)) if np.ndim(x) > 1 else np.abs(x), 1),
    "min": (lambda *x: np.min(np.broadcast_arrays(*x), axis=0), 2),
    "max": (lambda *x: np.max(np.broadcast_arrays(*x), axis=0), 2),
}

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}

SYNTAX_HINT = "Use names like sensor.force or sheath.x[3], numbers, + - * / ** and abs, sqrt, norm, min, max."


@dataclass(frozen=True)
class SignalReference:
    """Reference to a signal in an expression: member.variable, and the element of an array counted from 1."""

    name: str
    index: tuple[int, ...] = ()

    def __str__(self) -> str:
        return self.name + (f"[{','.join(map(str, self.index))}]" if self.index else "")


@dataclass(frozen=True)
class Expression:
    """Parsed expression; `signals`: signals that it reads, in order of appearance."""

    text: str
    signals: tuple[SignalReference, ...] = field(compare=False)
    tree: ast.expr = field(compare=False, repr=False)

    def evaluate(self, values: Mapping[str, Any]) -> Any:
        """Evaluate at every sample; `values`: member.variable -> array (n, ...). KeyError: not recorded."""
        with np.errstate(all="ignore"):
            return evaluate(self.tree, values)

    def magnitude(self, values: Mapping[str, Any]) -> Any:
        """Return the size of the operands at every sample: of `a.x - b.x`, that of `abs(a.x) + abs(b.x)`."""
        with np.errstate(all="ignore"):
            return magnitude(self.tree, values)

    def shape(self, shapes: Mapping[str, Shape]) -> Shape:
        """Return the shape of the value at one sample; `shapes`: of each signal.

        KeyError and IndexError: no such signal or element. ScenarioError for operands of different shapes.
        """
        return shape(self.tree, shapes) or ()

    def array_problem(self, shapes: Mapping[str, Shape]) -> str:
        """Return the reason why the value at one sample is not scalar; empty if it is."""
        try:
            value_shape = self.shape(shapes)
        except ScenarioError as error:
            return str(error)
        if not value_shape:
            return ""
        alternative = f", or take norm({self.text})" if len(value_shape) == 1 and self.single else ""
        advice = f"{suggest_elements(self.tree, shapes)}{alternative}"
        return f"{self.text} {describe_shape(value_shape)}, expected a single value. {advice}."

    @property
    def single(self) -> SignalReference | None:
        """Signal, if the expression consists of its name only."""
        return self.signals[0] if isinstance(self.tree, ast.Attribute | ast.Subscript) else None


def parse(text: Any) -> Expression:
    """Parse an expression; ScenarioError describes the mistake."""
    if isinstance(text, int | float) and not isinstance(text, bool):
        text = repr(text)
    if not isinstance(text, str) or not text.strip():
        raise ScenarioError("expected an expression of signals, such as sensor.force")
    if len(text) > MAX_LENGTH:
        raise ScenarioError(f"an expression of {len(text)} characters is too long. Let a component compute it")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        signals: dict[str, SignalReference] = {}
        collect_signals(tree, text, signals)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        bracket = re.match(r"'.' was never closed|unmatched '.'", getattr(error, "msg", ""))
        reason = f": {bracket[0]}" if bracket else ""
        raise ScenarioError(f"`{text.strip()}` is not an expression{reason}. {SYNTAX_HINT}") from None
    return Expression(text.strip(), tuple(signals.values()), tree)


def collect_signals(node: ast.expr, text: str, signals: dict[str, SignalReference]) -> None:
    """Collect the signals of a node; ScenarioError for nodes that `evaluate` does not support."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if isinstance(value, int) and not is_exact(value):
                digits = f"{str(value)[:20]}{'...' * (value >= 10**20)}"
                raise ScenarioError(
                    f"`{digits}` has more digits than the 15 to 17 of a number here. Write fewer, or 1e20"
                )
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            collect_signals(operand, text, signals)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in OPERATORS:
            collect_signals(left, text, signals)
            collect_signals(right, text, signals)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            minimum = FUNCTIONS[name][1]
            if len(arguments) < minimum or (minimum == 1 and len(arguments) > 1):
                requirement = "one argument" if minimum == 1 else "two or more arguments"
                raise ScenarioError(f"`{text.strip()}`: {name} takes {requirement}, not {len(arguments)}")
            for argument in arguments:
                collect_signals(argument, text, signals)
        case ast.Attribute() | ast.Subscript():
            signal = node_signal(node)
            signals[str(signal)] = signal
        case _:
            raise ScenarioError(f"`{text.strip()}`: `{ast.unparse(node)[:40]}` cannot be used. {SYNTAX_HINT}")


def is_exact(value: int) -> bool:
    """Return whether a whole number is a 64-bit floating-point number without loss of digits."""
    try:
        return int(float(value)) == value
    except OverflowError:
        return False


def node_signal(node: ast.expr) -> SignalReference:
    """Return the signal that `member.variable` or `member.variable[1,2]` names."""
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
        raise ScenarioError(f"`{ast.unparse(node)[:40]}` is not a signal. {SYNTAX_HINT}")
    return SignalReference(".".join([node.id, *reversed(names)]), index)


def evaluate(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """Evaluate a checked node."""
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
    signal = node_signal(node)
    array = values[signal.name]
    return array[(slice(None), *(i - 1 for i in signal.index))] if signal.index else array


def magnitude(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """Return the size of a checked node's operands."""
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
    """Return the shape of a checked node at one sample; None for a number, which is compatible with any shape."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(operand=operand):
            return shape(operand, shapes)
        case ast.BinOp(left=left, right=right):
            return common_shape([left, right], node, shapes)
        case ast.Call(func=ast.Name(id="norm"), args=[argument]):
            inner = shape(argument, shapes)
            return inner[:-1] if inner else inner
        case ast.Call(args=arguments):
            return common_shape(arguments, node, shapes)
    signal = node_signal(node)
    signal_shape = shapes[signal.name]
    if not signal.index:
        return signal_shape
    if len(signal.index) != len(signal_shape) or any(i > n for i, n in zip(signal.index, signal_shape, strict=True)):
        raise IndexError(str(signal))
    return ()


def common_shape(operands: Sequence[ast.expr], node: ast.expr, shapes: Mapping[str, Shape]) -> Shape | None:
    """Return the common shape of all operands except numbers; ScenarioError if they differ."""
    operand_shapes = {
        ast.unparse(operand): (operand, operand_shape)
        for operand in operands
        if (operand_shape := shape(operand, shapes)) is not None
    }
    if len({operand_shape for _, operand_shape in operand_shapes.values()}) > 1:
        sizes = ", ".join(
            f"{text} {describe_shape(operand_shape)}" for text, (_, operand_shape) in operand_shapes.items()
        )
        raise ScenarioError(f"`{ast.unparse(node)}`: {sizes}, expected equal shapes. {suggest_elements(node, shapes)}.")
    return next((operand_shape for _, operand_shape in operand_shapes.values()), None)


def describe_shape(value_shape: Shape) -> str:
    """Describe a shape: `is an array of 3`."""
    return f"is an array of {' x '.join(map(str, value_shape))}" if value_shape else "is a single value"


def suggest_elements(node: ast.expr, shapes: Mapping[str, Shape]) -> str:
    """Suggest elements in place of the arrays in a node: `Name one of a.x[1] to a.x[3]`."""
    signals: dict[str, SignalReference] = {}
    collect_signals(node, ast.unparse(node), signals)
    spans = []
    for signal in signals.values():
        if (signal_shape := shapes[signal.name]) and not signal.index:
            ends = [f"{signal}[{','.join(map(str, index))}]" for index in ((1,) * len(signal_shape), signal_shape)]
            spans.append(" to ".join(dict.fromkeys(ends)) if all(signal_shape) else f"no element of {signal}")
    return f"Name one of {', one of '.join(spans)}"
