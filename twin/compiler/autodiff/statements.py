"""Statements with tangents, a function per construct."""

from __future__ import annotations

import ast
from types import FunctionType

from twin.compiler.autodiff.expressions import ExpressionTangents
from twin.compiler.autodiff.function import ZERO, Dual


class FunctionTangents(ExpressionTangents):
    """Statements of one function."""

    def block(self, statements: list[ast.stmt]) -> None:
        """Statements at the present depth."""
        for statement in statements:
            self.visit(statement)

    def inner(self, head: str, statements: list[ast.stmt]) -> None:
        """A head and its block."""
        with self.lines.inside(head):
            self.block(statements)
            self.lines.emit("pass")

    def store(self, target: ast.expr, value: Dual) -> None:
        """Emit the assignment of a value, and of its tangent if the target has one."""
        text, tangent = value
        if isinstance(target, ast.Name) and tangent is not None:
            self.active.add(target.id)
        self.lines.emit(f"{ast.unparse(target)} = {text}")
        tangent_target = self.tangent_of(target)
        if tangent_target is not None:
            self.lines.emit(f"{tangent_target} = {tangent or ZERO}")
        elif tangent is not None:
            raise self.unknown(target, "takes a value that has a tangent, but is not Float64")

    def visit_Assign(self, node: ast.Assign) -> None:
        target, value = node.targets[0], node.value
        if len(node.targets) > 1:
            raise self.unknown(node, "assigns twice")
        if not isinstance(target, ast.Tuple):
            self.store(target, self.dual(value))
            return
        if isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
            parts = [self.lines.temporary(*self.dual(element)) for element in value.elts]
        else:
            results, tangent = self.lines.temporary(*self.dual(value))
            indices = range(len(target.elts))
            parts = [(f"{results}[{i}]", None if tangent is None else f"{tangent}[{i}]") for i in indices]
        for item, part in zip(target.elts, parts, strict=True):
            self.store(item, part)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.store(node.target, self.dual(node.value))

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.store(node.target, self.dual(ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)))

    def visit_Expr(self, node: ast.Expr) -> None:
        call = node.value
        called = self.source.reached(call.func) if isinstance(call, ast.Call) else None
        if self.touches(node) and isinstance(call, ast.Call) and isinstance(called, FunctionType):
            self.lines.emit(self.helper_call(call, called)[0])
        elif self.touches(node):
            self.dual(call)
        elif isinstance(call, ast.Call):
            self.lines.emit(ast.unparse(node))

    def visit_If(self, node: ast.If) -> None:
        self.inner(f"if {ast.unparse(node.test)}:", node.body)
        if node.orelse:
            self.inner("else:", node.orelse)

    def visit_For(self, node: ast.For) -> None:
        if node.orelse or self.touches(node.iter) or self.touches(node.target):
            raise self.unknown(node, "is not a loop over whole numbers or constants")
        self.inner(f"for {ast.unparse(node.target)} in {ast.unparse(node.iter)}:", node.body)

    def visit_While(self, node: ast.While) -> None:
        if node.orelse:
            raise self.unknown(node)
        self.inner(f"while {ast.unparse(node.test)}:", node.body)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is None:
            self.lines.emit("return")
            return
        value, tangent = self.dual(node.value)
        self.returns = self.returns or tangent is not None
        self.lines.emit(f"return {value}, {tangent or ZERO}" if self.returns else f"return {value}")

    def visit_Pass(self, node: ast.stmt) -> None:
        self.lines.emit(ast.unparse(node))

    visit_Break = visit_Continue = visit_Pass
