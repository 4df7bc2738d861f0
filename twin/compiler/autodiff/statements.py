"""Statements with tangents, a function per construct."""

from __future__ import annotations

import ast
from types import FunctionType
from typing import TYPE_CHECKING, Any

from twin.compiler.autodiff.expressions import dual, helper_call
from twin.compiler.autodiff.function import ZERO, Dual, TangentFunction

if TYPE_CHECKING:
    from collections.abc import Callable


def block(f: TangentFunction, statements: list[ast.stmt]) -> None:
    """Statements at the present depth."""
    for statement in statements:
        rule = STATEMENTS.get(type(statement))
        if rule is None:
            raise f.unknown(statement)
        rule(f, statement)


def inner(f: TangentFunction, head: str, statements: list[ast.stmt]) -> None:
    """A head and its block."""
    with f.lines.inside(head):
        block(f, statements)
        f.lines.emit("pass")


def store(f: TangentFunction, target: ast.expr, value: Dual) -> None:
    """Emit the assignment of a value, and of its tangent if the target has one."""
    text, tangent = value
    if isinstance(target, ast.Name) and tangent is not None:
        f.active.add(target.id)
    f.lines.emit(f"{ast.unparse(target)} = {text}")
    tangent_target = f.tangent_of(target)
    if tangent_target is not None:
        f.lines.emit(f"{tangent_target} = {tangent or ZERO}")
    elif tangent is not None:
        raise f.unknown(target, "takes a value that has a tangent, but is not Float64")


def _assign(f: TangentFunction, node: ast.Assign) -> None:
    target, value = node.targets[0], node.value
    if len(node.targets) > 1:
        raise f.unknown(node, "assigns twice")
    if not isinstance(target, ast.Tuple):
        store(f, target, dual(f, value))
        return
    if isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
        parts = [f.lines.temporary(*dual(f, element)) for element in value.elts]
    else:
        results, tangent = f.lines.temporary(*dual(f, value))
        indices = range(len(target.elts))
        parts = [(f"{results}[{i}]", None if tangent is None else f"{tangent}[{i}]") for i in indices]
    for item, part in zip(target.elts, parts, strict=True):
        store(f, item, part)


def _annassign(f: TangentFunction, node: ast.AnnAssign) -> None:
    if node.value is not None:
        store(f, node.target, dual(f, node.value))


def _augassign(f: TangentFunction, node: ast.AugAssign) -> None:
    store(f, node.target, dual(f, ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)))


def _expr(f: TangentFunction, node: ast.Expr) -> None:
    call = node.value
    called = f.source.reached(call.func) if isinstance(call, ast.Call) else None
    if f.touches(node) and isinstance(call, ast.Call) and isinstance(called, FunctionType):
        f.lines.emit(helper_call(f, call, called)[0])
    elif f.touches(node):
        dual(f, call)
    elif isinstance(call, ast.Call):
        f.lines.emit(ast.unparse(node))


def _if(f: TangentFunction, node: ast.If) -> None:
    inner(f, f"if {ast.unparse(node.test)}:", node.body)
    if node.orelse:
        inner(f, "else:", node.orelse)


def _for(f: TangentFunction, node: ast.For) -> None:
    if node.orelse or f.touches(node.iter) or f.touches(node.target):
        raise f.unknown(node, "is not a loop over whole numbers or constants")
    inner(f, f"for {ast.unparse(node.target)} in {ast.unparse(node.iter)}:", node.body)


def _while(f: TangentFunction, node: ast.While) -> None:
    if node.orelse:
        raise f.unknown(node)
    inner(f, f"while {ast.unparse(node.test)}:", node.body)


def _return(f: TangentFunction, node: ast.Return) -> None:
    if node.value is None:
        f.lines.emit("return")
        return
    value, tangent = dual(f, node.value)
    f.returns = f.returns or tangent is not None
    f.lines.emit(f"return {value}, {tangent or ZERO}" if f.returns else f"return {value}")


def _same(f: TangentFunction, node: ast.stmt) -> None:
    f.lines.emit(ast.unparse(node))


STATEMENTS: dict[type[ast.stmt], Callable[[TangentFunction, Any], None]] = {
    ast.Assign: _assign,
    ast.AnnAssign: _annassign,
    ast.AugAssign: _augassign,
    ast.Expr: _expr,
    ast.If: _if,
    ast.For: _for,
    ast.While: _while,
    ast.Return: _return,
    ast.Pass: _same,
    ast.Break: _same,
    ast.Continue: _same,
}
