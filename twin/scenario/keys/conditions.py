"""Conditions of events: comparisons of expressions, joined by `and`, `or`, `not`.

`sensor.force > 0.3 N and not gripper.closed`. Numbers with a unit become text, then Python's parser reads the condition. What is
compared is an expression as in metrics, in coherent SI units. The loop evaluates it as instructions of `condition_loop`.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from twin.coupling import Reference, condition_loop, find
from twin.errors import CouplingError, ScenarioError
from twin.results import Expression, dimension, expression, si_conversion
from twin.scenario.keys import quantities

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from twin.coupling import Catalog

    Instruction = tuple[int, float | Reference | None]

SYMBOL = r"(?!(?:and|or|not)\b)[A-Za-zµμΩ°%][A-Za-z0-9_µμΩ°%²³]*(?:(?:\^|\*\*)-?\d+)?(?![\w.(\[])"
UNIT = rf"(?:1\s*/\s*)?{SYMBOL}(?:\s*[*/·]\s*(?:{SYMBOL}|\({SYMBOL}(?:\s*[*/·]\s*{SYMBOL})*\)))*"
QUANTITY = re.compile(rf"(?<![\w.\])])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{{1,3}}|(?![eE][-+]?\d))\s*{UNIT}")

HINT = "Compare signals, as in sensor.force > 0.3 N, and join comparisons by and, or, not."
COMPARISONS: dict[type[ast.cmpop], tuple[int, bool]] = {  # instruction, and whether the sides are exchanged
    ast.Lt: (condition_loop.LESS, False),
    ast.LtE: (condition_loop.LESS_EQUAL, False),
    ast.Gt: (condition_loop.LESS, True),
    ast.GtE: (condition_loop.LESS_EQUAL, True),
    ast.Eq: (condition_loop.EQUAL, False),
    ast.NotEq: (condition_loop.NOT_EQUAL, False),
}
OPERATORS: dict[type[ast.operator], int] = {
    ast.Add: condition_loop.ADD,
    ast.Sub: condition_loop.SUBTRACT,
    ast.Mult: condition_loop.MULTIPLY,
    ast.Div: condition_loop.DIVIDE,
    ast.Pow: condition_loop.POWER,
}
FUNCTIONS = {
    "abs": condition_loop.ABS,
    "sqrt": condition_loop.SQRT,
    "min": condition_loop.MIN,
    "max": condition_loop.MAX,
}


@dataclass(frozen=True)
class Comparison:
    """An expression, whose value must be scalar, and the unit of the number that it is compared with.

    Of `a.x < b.x` the expression is the difference. `is_boolean`: a Boolean signal without a comparison.
    """

    expression: Expression
    unit: str = ""
    is_boolean: bool = False


@dataclass(frozen=True)
class ConditionExpression:
    """A parsed condition. `comparisons`: in order of appearance; `tree`: the condition with all numbers in SI."""

    text: str
    comparisons: tuple[Comparison, ...] = field(compare=False)
    tree: ast.expr = field(compare=False, repr=False)

    def instructions(self, catalog: Catalog) -> Sequence[Instruction]:
        """Return the instructions that evaluate the condition; `catalog`: member -> variables, in which it is valid."""
        return tuple(logic(self.tree, catalog))


def parse(text: Any) -> ConditionExpression:
    """Parse a condition; ScenarioError describes the mistake."""
    if not isinstance(text, str) or not text.strip():
        raise ScenarioError("expected a condition, such as sensor.force > 0.3 N")
    if len(text) > expression.MAX_LENGTH:
        raise ScenarioError(f"a condition of {len(text)} characters is too long. Let a component compute it")
    text = " ".join(text.split())
    if {'"', "'"} & set(text):
        raise ScenarioError(f"`{text}`: a condition contains no quotes. {HINT}")
    comparisons: list[Comparison] = []
    try:
        tree = resolve(ast.parse(QUANTITY.sub(r'"\g<0>"', text), mode="eval").body, text, comparisons)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ScenarioError(f"`{text}` is no condition. {HINT}") from None
    return ConditionExpression(text, tuple(comparisons), tree)


def resolve(node: ast.expr, text: str, comparisons: list[Comparison]) -> ast.expr:
    """Return a node of a condition with all numbers in SI; add its comparisons."""
    match node:
        case ast.BoolOp(op=operator, values=values):
            return ast.BoolOp(operator, [resolve(value, text, comparisons) for value in values])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return ast.UnaryOp(ast.Not(), resolve(operand, text, comparisons))
        case ast.Compare(left=left, ops=operators, comparators=others) if all(
            type(op) in COMPARISONS for op in operators
        ):
            parts: list[ast.expr] = []
            for sides, code in zip(pairwise([left, *others]), operators, strict=True):
                comparison, (first, second) = compare(*sides, text)
                comparisons.append(comparison)
                parts.append(ast.Compare(first, [code], [second]))
            return parts[0] if len(parts) == 1 else ast.BoolOp(ast.And(), parts)
        case ast.Attribute() | ast.Subscript():
            comparisons.append(Comparison(expression.parse(ast.unparse(node)), is_boolean=True))
            return node
    raise ScenarioError(f"`{text}`: `{source_text(node)[:40]}` is no comparison. {HINT}")


def compare(left: ast.expr, right: ast.expr, text: str) -> tuple[Comparison, tuple[ast.expr, ast.expr]]:
    """Return the comparison of two sides, and the sides with their numbers in SI."""
    sides = [left, right]
    numbers = [quantity_text(side) for side in sides]
    for side, number in zip(sides, numbers, strict=True):
        if not number and any(
            isinstance(part, ast.Constant) and isinstance(part.value, str) for part in ast.walk(side)
        ):
            raise ScenarioError(
                f"`{source_text(side)[:40]}`: a number with a unit stands alone on its side of a comparison. "
                "Write numbers in an expression in SI, without a unit"
            )
    operands = [expression.parse(ast.unparse(side)) for side, number in zip(sides, numbers, strict=True) if not number]
    if not any(operand.signals for operand in operands):
        raise ScenarioError(f"`{text}` compares numbers only. {HINT}")
    if len(operands) == 2:
        return Comparison(expression.parse(f"{operands[0].text} - ({operands[1].text})")), (left, right)
    (compared,) = operands
    number = "".join(numbers)
    parts = quantities.split(number)
    try:
        value = quantities.si(number, "", f"`{text}`", dimension.is_difference(compared))
    except CouplingError as error:
        raise ScenarioError(str(error)) from None
    constant = ast.Constant(value)
    return Comparison(compared, parts[1] if parts else ""), (constant, right) if numbers[0] else (left, constant)


def quantity_text(node: ast.expr) -> str:
    """Return the text of a number with a unit; empty for another node."""
    match node:
        case ast.Constant(value=str() as text):
            return text
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=str() as text)):
            return f"-{text}"
    return ""


def source_text(node: ast.expr) -> str:
    """Return a node as it was written."""
    return ast.unparse(node).replace("'", "")


def logic(node: ast.expr, catalog: Catalog) -> Iterator[Instruction]:
    """Yield the instructions of a condition, whose result is 0 or 1."""
    match node:
        case ast.BoolOp(op=operator, values=values):
            yield from logic(values[0], catalog)
            for value in values[1:]:
                yield from logic(value, catalog)
                yield (condition_loop.AND if isinstance(operator, ast.And) else condition_loop.OR), None
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield from logic(operand, catalog)
            yield condition_loop.NOT, None
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            code, is_exchanged = COMPARISONS[type(operator)]
            for side in (right, left) if is_exchanged else (left, right):
                yield from arithmetic(side, catalog)
            yield code, None
        case _:
            yield from arithmetic(node, catalog)
            yield condition_loop.NUMBER, 0.0
            yield condition_loop.NOT_EQUAL, None


def arithmetic(node: ast.expr, catalog: Catalog, element: int | None = None) -> Iterator[Instruction]:
    """Yield the instructions of an expression, or of an element of its array, counted from 0."""
    match node:
        case ast.Constant(value=value):
            yield condition_loop.NUMBER, float(value)  # type: ignore[arg-type]
        case ast.UnaryOp(op=operator, operand=operand):
            yield from arithmetic(operand, catalog, element)
            if isinstance(operator, ast.USub):
                yield condition_loop.NEGATE, None
        case ast.BinOp(left=left, op=operator, right=right):
            yield from arithmetic(left, catalog, element)
            yield from arithmetic(right, catalog, element)
            yield OPERATORS[type(operator)], None
        case ast.Call(func=ast.Name(id="norm"), args=[argument]):
            yield from norm(argument, catalog)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            yield from arithmetic(arguments[0], catalog, element)
            if len(arguments) == 1:
                yield FUNCTIONS[name], None
            for argument in arguments[1:]:
                yield from arithmetic(argument, catalog, element)
                yield FUNCTIONS[name], None
        case _:
            yield from value_of(node, catalog, element)


def norm(argument: ast.expr, catalog: Catalog) -> Iterator[Instruction]:
    """Yield the instructions of the Euclidean norm of an array, or of the size of a single value."""
    shapes = {f"{member}.{name}": v.shape for member, variables in catalog.items() for name, v in variables.items()}
    shape = expression.shape(argument, shapes)
    if not shape:
        yield from arithmetic(argument, catalog)
        yield condition_loop.ABS, None
        return
    for element in range(shape[0]):
        yield from arithmetic(argument, catalog, element)
        yield from arithmetic(argument, catalog, element)
        yield condition_loop.MULTIPLY, None
        if element:
            yield condition_loop.ADD, None
    yield condition_loop.SQRT, None


def value_of(node: ast.expr, catalog: Catalog, element: int | None) -> Iterator[Instruction]:
    """Yield the instructions that read a signal and convert it to SI."""
    reference = find(str(expression.node_signal(node)), catalog)
    if element is not None and reference.size > 1:
        reference = Reference(reference.member, reference.variable, element, 1)
    yield condition_loop.VALUE, reference
    factor, offset = si_conversion(reference.variable.unit)
    if (factor, offset) != (1.0, 0.0):
        yield condition_loop.NUMBER, factor
        yield condition_loop.MULTIPLY, None
        yield condition_loop.NUMBER, offset
        yield condition_loop.ADD, None
