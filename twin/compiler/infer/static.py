"""What needs no run: the value of an expression of constants, functions of them, lengths."""

from __future__ import annotations

import ast
import operator
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import builtins
from twin.compiler.infer.program import Program, TypedFunction
from twin.compiler.types import Array, Record, Scalar, StaticObject, Tuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.compiler.resolve import TranslationError

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.BitOr: operator.or_,
    ast.BitAnd: operator.and_,
    ast.BitXor: operator.xor,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}


class NotStaticError(Exception):
    """The value of an expression is not known while translating."""


class Static(ast.NodeVisitor):
    """Values that are known while translating."""

    def __init__(self, program: Program, function: TypedFunction) -> None:
        self.program, self.function, self.source = program, function, function.source

    def error(self, node: ast.AST, reason: str, remedy: str) -> TranslationError:
        """The message for a construct of this function."""
        return self.source.error(node, reason, remedy)

    def static(self, node: ast.expr) -> Any:
        """The value of an expression that needs no run; NotStaticError otherwise."""
        rule = STATIC.get(type(node))
        if rule is None:
            raise NotStaticError
        try:
            return rule(self, node)
        except NotStaticError:
            raise
        except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError):
            raise NotStaticError from None

    def static_name(self, node: ast.Name) -> Any:
        if node.id in self.source.locals:
            kind = self.function.locals.get(node.id)
            if isinstance(kind, StaticObject):
                return kind.value
            raise NotStaticError
        return self.source.value(node.id)

    def static_attribute(self, node: ast.Attribute) -> Any:
        kind = self.function.types.get(id(node.value))
        if isinstance(kind, Array):
            return getattr(np.empty(kind.shape), node.attr)
        if isinstance(kind, Record | Tuple | Scalar):
            raise NotStaticError
        return getattr(self.static(node.value), node.attr)

    def static_subscript(self, node: ast.Subscript) -> Any:
        base = self.static(node.value)
        index = node.slice
        return base[tuple(map(self.static, index.elts)) if isinstance(index, ast.Tuple) else self.static(index)]

    def static_unary(self, node: ast.UnaryOp) -> Any:
        value = self.static(node.operand)
        if isinstance(node.op, ast.Not):
            return not value
        return -value if isinstance(node.op, ast.USub) else ~value if isinstance(node.op, ast.Invert) else value

    def static_compare(self, node: ast.Compare) -> bool:
        if len(node.ops) > 1:
            raise NotStaticError
        left, right, op = self.static(node.left), self.static(node.comparators[0]), node.ops[0]
        if isinstance(op, ast.Is | ast.IsNot):
            return (left is right) == isinstance(op, ast.Is)
        raise NotStaticError  # numbers are compared where one reads it

    def static_call(self, node: ast.Call) -> Any:
        """A function of `math` of known numbers, with the very value that Python has; lengths."""
        called = self.static(node.func)
        if isinstance(called, FunctionType | type | ModuleType) or node.keywords:
            raise NotStaticError
        if called is len:
            kind = self.function.types.get(id(node.args[0]))
            if isinstance(kind, Array):
                return kind.shape[0]
            return len(self.static(node.args[0]))
        if called in builtins.PYTHON and getattr(called, "__module__", "") == "math":
            return called(*map(self.static, node.args))
        raise NotStaticError


STATIC: dict[type[ast.expr], Callable[[Static, Any], Any]] = {
    ast.Constant: lambda _, node: node.value,
    ast.Name: Static.static_name,
    ast.Attribute: Static.static_attribute,
    ast.Subscript: Static.static_subscript,
    ast.UnaryOp: Static.static_unary,
    ast.Compare: Static.static_compare,
    ast.Call: Static.static_call,
    ast.BinOp: lambda self, node: OPERATORS[type(node.op)](self.static(node.left), self.static(node.right)),
}
