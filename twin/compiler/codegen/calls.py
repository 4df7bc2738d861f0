"""Calls as C: functions of a person, words, and what Python has built in."""

from __future__ import annotations

import ast
from typing import Any

from twin.compiler.builtins import NAMED, ROUNDING, Word
from twin.compiler.codegen.code import UNARY, ExpressionCode, number
from twin.compiler.codegen.expressions import ExpressionWriter
from twin.compiler.infer import NotStaticError, TypedFunction
from twin.compiler.types import BOOLEAN, INTEGER, REAL, Scalar, StaticObject, Type, of_constant

EXTREMES: dict[Any, dict[Scalar, str]] = {
    min: {REAL: "real_min", INTEGER: "int_min"},
    max: {REAL: "real_max", INTEGER: "int_max"},
}


class CallWriter(ExpressionWriter):
    """Calls of one function."""

    def visit_Call(self, node: ast.Call) -> ExpressionCode:
        """A call, without keeping its result."""
        called = self.function.calls.get(id(node))
        if isinstance(called, TypedFunction):
            return self.user(node, called)
        if isinstance(called, Word):
            folded = self._folded_call(node)
            if folded is not None:
                return folded
            kinds = zip(node.args, called.arguments, strict=True)
            parts = [
                self.convert(self.expression(argument), self.type(argument), wanted).text for argument, wanted in kinds
            ]
            return ExpressionCode(f"{self.needs.word(called)}({', '.join(parts)})")
        return self.special(node)

    def _folded_call(self, node: ast.Call) -> ExpressionCode | None:
        """A function of known numbers: Python's value, since compilers have a mathematical library of their own."""
        if self.type(node) != REAL:
            return None
        try:
            return number(float(self.inference.static(node)))
        except NotStaticError:
            return None

    def user(self, node: ast.Call, called: TypedFunction) -> ExpressionCode:
        parts = []
        for argument, kind in zip(self.function.bound[id(node)], called.arguments, strict=True):
            if isinstance(kind, StaticObject):
                continue
            if not isinstance(argument, ast.expr):
                parts.append(self._default(argument, kind, called))
            elif isinstance(kind, Scalar):
                parts.append(self.convert(self.expression(argument), self.type(argument), kind).text)
            else:
                code = self.expression(argument)
                parts.append(code.text[1:-1] if code.text.startswith("(&") else code.text)
        return ExpressionCode(f"{called.name}({', '.join(parts)})")

    def _default(self, value: Any, kind: Type, called: TypedFunction) -> str:
        if isinstance(kind, Scalar):
            return self.convert(number(value), of_constant(value), kind).text
        return self.needs.constant(called.source, f"{called.name}_default", value)

    def special(self, node: ast.Call) -> ExpressionCode:
        called = self.inference.static(node.func)
        kind = self.type(node)
        if called in EXTREMES:
            return self._extreme(node, called)
        if called is pow:
            made = ast.copy_location(ast.BinOp(node.args[0], ast.Pow(), node.args[1]), node)
            self.made.append(made)
            return self.expression(made)
        if called is len:
            return number(self.inference.static(node))
        (argument,) = node.args
        code, own = self.expression(argument), self.type(argument)
        if called in ROUNDING and own == INTEGER and self.is_narrow(argument):
            return ExpressionCode(f"(int64_t){code.at(UNARY)}", UNARY)
        if called in ROUNDING:
            return self._rounded(code, own, ROUNDING[called])
        if kind == BOOLEAN:
            return self.condition(argument)
        if called is float or getattr(called, "__name__", "") == "float64":
            return self.convert(code, own, REAL)
        if kind == REAL:
            return ExpressionCode(f"{self.needs.libm('fabs')}({code.text})")
        return ExpressionCode(f"{self.needs.word(NAMED['int_abs'])}({self.convert(code, own, INTEGER).text})")

    def _rounded(self, code: ExpressionCode, own: Type, function: str) -> ExpressionCode:
        if own != REAL:
            return self.convert(code, own, INTEGER)
        if not function:
            return ExpressionCode(f"(int64_t){code.at(UNARY)}", UNARY)
        if function in NAMED:
            return ExpressionCode(f"{self.needs.word(NAMED[function])}({code.text})")
        return ExpressionCode(f"(int64_t){self.needs.libm(function)}({code.text})", UNARY)

    def _extreme(self, node: ast.Call, called: Any) -> ExpressionCode:
        """`min`, `max` from left to right."""
        kind = self.type(node)
        assert isinstance(kind, Scalar)
        kind = REAL if kind == REAL else INTEGER
        name = self.needs.word(NAMED[EXTREMES[called][kind]])
        result = self.convert(self.expression(node.args[0]), self.type(node.args[0]), kind)
        for argument in node.args[1:]:
            result = ExpressionCode(
                f"{name}({result.text}, {self.convert(self.expression(argument), self.type(argument), kind).text})"
            )
        return self.convert(result, kind, self.type(node))
