"""Values with tangents: how expressions are rewritten, a function per construct.

Lines before an expression compute what it needs.
"""

from __future__ import annotations

import ast
from types import FunctionType
from typing import TYPE_CHECKING, Any

from twin.compiler.autodiff.derivative_rules import BINARY, FLAT, NAMES, OPERATORS, UNARY
from twin.compiler.autodiff.function import ACTIVE, PLAIN, RECORD, ZERO, Dual, TangentFunction, dot

if TYPE_CHECKING:
    from collections.abc import Callable

CONSTANT: Dual = "", None


def dual(f: TangentFunction, node: ast.expr) -> Dual:
    """Value and tangent of an expression."""
    if not f.touches(node):
        return plain(node)
    rule = EXPRESSIONS.get(type(node))
    if rule is None:
        raise f.unknown(node)
    return rule(f, node)


def plain(node: ast.expr) -> Dual:
    """An expression without a tangent."""
    text = ast.unparse(node)
    return text if isinstance(node, ast.Name | ast.Constant | ast.Attribute) else f"({text})", None


def named(f: TangentFunction, node: ast.expr) -> Dual:
    """An expression whose value may be written twice."""
    value, tangent = dual(f, node)
    if isinstance(node, ast.Name | ast.Constant) or value.startswith("_v"):
        return value, tangent
    return f.lines.temporary(value, tangent)


def ruled(f: TangentFunction, rules: tuple[str, str], text: str, a: Dual, b: Dual = CONSTANT) -> Dual:
    """A value made of two operands; its tangent is the sum of what both contribute."""
    value, tangent = f.lines.fresh()
    f.lines.emit(f"{value} = {text}")
    terms = [
        rule.format(v=value, a=a[0], b=b[0], d=derivative)
        for rule, derivative in zip(rules, (a[1], b[1]), strict=True)
        if derivative is not None and rule
    ]
    if not terms:
        return value, None
    f.lines.emit(f"{tangent} = {' + '.join(terms)}")
    return value, tangent


def _variable(f: TangentFunction, node: ast.expr) -> Dual:
    return ast.unparse(node), f.tangent_of(node)


def _compare(_: TangentFunction, node: ast.Compare) -> Dual:
    return plain(node)


def _boolop(f: TangentFunction, node: ast.BoolOp) -> Dual:
    if any(dual(f, value)[1] is not None for value in node.values):
        raise f.unknown(node, "is a number made by `and` or `or`")
    return plain(node)


def _tuple(f: TangentFunction, node: ast.Tuple) -> Dual:
    parts = [f.lines.temporary(*dual(f, element)) for element in node.elts]
    values = f"({', '.join(value for value, _ in parts)},)"
    if all(tangent is None for _, tangent in parts):
        return values, None
    return values, f"({', '.join(tangent or ZERO for _, tangent in parts)},)"


def _unaryop(f: TangentFunction, node: ast.UnaryOp) -> Dual:
    value, tangent = dual(f, node.operand)
    if isinstance(node.op, ast.Not) or tangent is None:
        return plain(node)
    sign = "-" if isinstance(node.op, ast.USub) else "+"
    return f.lines.temporary(f"{sign}{value}", f"{sign}{tangent}")


def _binop(f: TangentFunction, node: ast.BinOp) -> Dual:
    a, b = named(f, node.left), named(f, node.right)
    symbol = OPERATORS.get(type(node.op))
    if symbol is None:
        raise f.unknown(node)
    return ruled(f, BINARY[symbol], f"{a[0]} {symbol} {b[0]}", a, b)


def _ifexp(f: TangentFunction, node: ast.IfExp) -> Dual:
    if not (f.touches(node.body) or f.touches(node.orelse)):
        return plain(node)
    v, d = f.lines.fresh()
    for head, arm in ((f"if {ast.unparse(node.test)}:", node.body), ("else:", node.orelse)):
        with f.lines.inside(head):
            value, tangent = dual(f, arm)
            f.lines.emit(f"{v} = {value}")
            f.lines.emit(f"{d} = {tangent or ZERO}")
    return v, d


# ------------------------------------------------------------------------------------------------------------- calls


def _call(f: TangentFunction, node: ast.Call) -> Dual:
    called = f.source.reached(node.func)
    name = NAMES.get(called, "") if called.__hash__ else ""
    if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
        raise f.unknown(node, "is called with named arguments")
    if name in FLAT:
        return plain(node)
    if isinstance(called, FunctionType):
        return _helper(f, node, called)
    function = ast.unparse(node.func)
    if name in UNARY and len(node.args) == 1:
        a = named(f, node.args[0])
        return ruled(f, (UNARY[name], ""), f"{function}({a[0]})", a)
    if name in BINARY and len(node.args) >= 2:  # min and max of more: from left to right
        result, *others = [named(f, argument) for argument in node.args]
        for other in others:
            result = ruled(f, BINARY[name], f"{function}({result[0]}, {other[0]})", result, other)
        return result
    raise f.unknown(node, "has no rule")


def _helper(f: TangentFunction, node: ast.Call, called: FunctionType) -> Dual:
    text, returns = helper_call(f, node, called)
    value, tangent = f.lines.fresh()
    f.lines.emit(f"{value}, {tangent} = {text}" if returns else f"{value} = {text}")
    return value, tangent if returns else None


def helper_call(f: TangentFunction, node: ast.Call, called: FunctionType) -> tuple[str, bool]:
    """The call of a rewritten function, and whether it returns (value, tangent)."""
    values, tangents, kinds = [], [], []
    for argument in node.args:
        is_record = f.is_record(argument)
        value, tangent = (ast.unparse(argument), dot(argument)) if is_record else dual(f, argument)
        values.append(value)
        tangents += [tangent] if tangent is not None else []
        kinds.append(RECORD if is_record else PLAIN if tangent is None else ACTIVE)
    function, returns = f.rewrite(called, tuple(kinds))
    name = f"_{called.__name__}_{'_'.join(kinds)}"
    f.helpers[name] = function
    return f"{name}({', '.join([*values, *tangents])})", returns


EXPRESSIONS: dict[type[ast.expr], Callable[[TangentFunction, Any], Dual]] = {
    ast.Name: _variable,
    ast.Attribute: _variable,
    ast.Subscript: _variable,
    ast.Compare: _compare,
    ast.BoolOp: _boolop,
    ast.Tuple: _tuple,
    ast.UnaryOp: _unaryop,
    ast.BinOp: _binop,
    ast.IfExp: _ifexp,
    ast.Call: _call,
}
