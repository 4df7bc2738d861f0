"""Values with tangents: how expressions are rewritten, a function per construct.

Lines before an expression compute what it needs.
"""

from __future__ import annotations

import ast
from types import FunctionType

from twin.compiler.autodiff.derivative_rules import BINARY, FLAT, NAMES, OPERATORS, UNARY
from twin.compiler.autodiff.function import ACTIVE, PLAIN, RECORD, ZERO, Dual, TangentFunction, dot

CONSTANT: Dual = "", None


def plain(node: ast.expr) -> Dual:
    """An expression without a tangent."""
    text = ast.unparse(node)
    return text if isinstance(node, ast.Name | ast.Constant | ast.Attribute) else f"({text})", None


class ExpressionTangents(TangentFunction):
    """Expressions of one function."""

    def dual(self, node: ast.expr) -> Dual:
        """Value and tangent of an expression."""
        if not self.touches(node):
            return plain(node)
        value: Dual = self.visit(node)
        return value

    def named(self, node: ast.expr) -> Dual:
        """An expression whose value may be written twice."""
        value, tangent = self.dual(node)
        if isinstance(node, ast.Name | ast.Constant) or value.startswith("_v"):
            return value, tangent
        return self.lines.temporary(value, tangent)

    def ruled(self, rules: tuple[str, str], text: str, a: Dual, b: Dual = CONSTANT) -> Dual:
        """A value made of two operands; its tangent is the sum of what both contribute."""
        value, tangent = self.lines.fresh()
        self.lines.emit(f"{value} = {text}")
        terms = [
            rule.format(v=value, a=a[0], b=b[0], d=derivative)
            for rule, derivative in zip(rules, (a[1], b[1]), strict=True)
            if derivative is not None and rule
        ]
        if not terms:
            return value, None
        self.lines.emit(f"{tangent} = {' + '.join(terms)}")
        return value, tangent

    def visit_Name(self, node: ast.expr) -> Dual:
        return ast.unparse(node), self.tangent_of(node)

    visit_Attribute = visit_Subscript = visit_Name

    def visit_Compare(self, node: ast.Compare) -> Dual:
        return plain(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> Dual:
        if any(self.dual(value)[1] is not None for value in node.values):
            raise self.unknown(node, "is a number made by `and` or `or`")
        return plain(node)

    def visit_Tuple(self, node: ast.Tuple) -> Dual:
        parts = [self.lines.temporary(*self.dual(element)) for element in node.elts]
        values = f"({', '.join(value for value, _ in parts)},)"
        if all(tangent is None for _, tangent in parts):
            return values, None
        return values, f"({', '.join(tangent or ZERO for _, tangent in parts)},)"

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Dual:
        value, tangent = self.dual(node.operand)
        if isinstance(node.op, ast.Not) or tangent is None:
            return plain(node)
        sign = "-" if isinstance(node.op, ast.USub) else "+"
        return self.lines.temporary(f"{sign}{value}", f"{sign}{tangent}")

    def visit_BinOp(self, node: ast.BinOp) -> Dual:
        a, b = self.named(node.left), self.named(node.right)
        symbol = OPERATORS.get(type(node.op))
        if symbol is None:
            raise self.unknown(node)
        return self.ruled(BINARY[symbol], f"{a[0]} {symbol} {b[0]}", a, b)

    def visit_IfExp(self, node: ast.IfExp) -> Dual:
        if not (self.touches(node.body) or self.touches(node.orelse)):
            return plain(node)
        v, d = self.lines.fresh()
        for head, arm in ((f"if {ast.unparse(node.test)}:", node.body), ("else:", node.orelse)):
            with self.lines.inside(head):
                value, tangent = self.dual(arm)
                self.lines.emit(f"{v} = {value}")
                self.lines.emit(f"{d} = {tangent or ZERO}")
        return v, d

    # calls

    def visit_Call(self, node: ast.Call) -> Dual:
        called = self.source.reached(node.func)
        name = NAMES.get(called, "") if called.__hash__ else ""
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.unknown(node, "is called with named arguments")
        if name in FLAT:
            return plain(node)
        if isinstance(called, FunctionType):
            return self._helper(node, called)
        function = ast.unparse(node.func)
        if name in UNARY and len(node.args) == 1:
            a = self.named(node.args[0])
            return self.ruled((UNARY[name], ""), f"{function}({a[0]})", a)
        if name in BINARY and len(node.args) >= 2:  # min and max of more: from left to right
            result, *others = [self.named(argument) for argument in node.args]
            for other in others:
                result = self.ruled(BINARY[name], f"{function}({result[0]}, {other[0]})", result, other)
            return result
        raise self.unknown(node, "has no rule")

    def _helper(self, node: ast.Call, called: FunctionType) -> Dual:
        text, returns = self.helper_call(node, called)
        value, tangent = self.lines.fresh()
        self.lines.emit(f"{value}, {tangent} = {text}" if returns else f"{value} = {text}")
        return value, tangent if returns else None

    def helper_call(self, node: ast.Call, called: FunctionType) -> tuple[str, bool]:
        """The call of a rewritten function, and whether it returns (value, tangent)."""
        values, tangents, kinds = [], [], []
        for argument in node.args:
            is_record = self.is_record(argument)
            value, tangent = (ast.unparse(argument), dot(argument)) if is_record else self.dual(argument)
            values.append(value)
            tangents += [tangent] if tangent is not None else []
            kinds.append(RECORD if is_record else PLAIN if tangent is None else ACTIVE)
        function, returns = self.rewrite(called, tuple(kinds))
        name = f"_{called.__name__}_{'_'.join(kinds)}"
        self.helpers[name] = function
        return f"{name}({', '.join([*values, *tangents])})", returns
