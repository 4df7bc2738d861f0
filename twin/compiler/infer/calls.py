"""Types of calls: functions of a person, words of C, and what Python has built in."""

from __future__ import annotations

import ast
import inspect
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import builtins
from twin.compiler.builtins import Word
from twin.compiler.infer.expressions import ExpressionInference
from twin.compiler.types import (
    BOOLEAN,
    INTEGER,
    REAL,
    UNKNOWN,
    Array,
    StaticObject,
    Tuple,
    Type,
    UnknownType,
    join,
    of_constant,
)

if TYPE_CHECKING:
    from collections.abc import Callable

LOOP = "Write `for i in range(n)` and index with i"


class CallInference(ExpressionInference):
    """Calls of one function."""

    def visit_Call(self, node: ast.Call) -> Type:
        kind = self.expression(node.func) if isinstance(node.func, ast.Name | ast.Attribute) else UNKNOWN
        if not isinstance(kind, StaticObject):
            raise self.error(node, "calls what is no function", "Call functions by their names")
        called = kind.value
        if isinstance(called, FunctionType):
            if called in builtins.MACHINE:
                return self.word(node, builtins.MACHINE[called])
            return self.user(node, called)
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.error(node, "gives arguments by name or by *", "Give them in their order")
        special = SPECIAL.get(called) if hashable(called) else None
        if special is not None:
            return special(self, node)
        if hashable(called) and called in builtins.PYTHON:
            return self.word(node, builtins.PYTHON[called])
        raise self.error(node, "cannot be called from C", self.instead(called))

    def instead(self, called: Any) -> str:
        """What to write instead of a call."""
        if called is np.tanh:
            return "Use tanh of `math`, which rounds as C's"
        module = getattr(called, "__module__", None) or ""
        name = getattr(called, "__name__", "")
        same = getattr(__import__("math"), name, None)
        if module.startswith("numpy") and same in builtins.PYTHON:
            return f"Use {name} of `math`"
        if called in (sum, enumerate, zip, reversed, map, all, any):
            return LOOP
        return "Use functions of `math`, or of a module in plain Python; a PythonComponent may call all"

    def word(self, node: ast.Call, word: Word) -> Type:
        if len(node.args) != len(word.arguments) or node.keywords:
            raise self.error(node, f"needs {len(word.arguments)} arguments", "Give them in their order")
        for argument, wanted in zip(node.args, word.arguments, strict=True):
            kind = self.number(argument)
            if wanted == INTEGER:
                self.require_integer(argument, kind)
        self.function.calls[id(node)] = word
        self.function.acts = self.function.acts or word.acts
        return word.result

    def user(self, node: ast.Call, called: FunctionType) -> Type:
        arguments = self.bind(node, called)
        kinds: list[Type] = []
        for argument in arguments:
            kind = self.expression(argument) if isinstance(argument, ast.expr) else of_constant(argument)
            if isinstance(kind, UnknownType):
                return UNKNOWN
            # a table of one dimension is passed as any other array: what is read only is const in C
            if isinstance(kind, Array) and len(kind.shape) == 1:
                kind = Array(kind.storage, kind.shape)
            kinds.append(kind)
        callee = self.program.infer(called, tuple(kinds))
        self.function.calls[id(node)] = callee
        self.function.bound[id(node)] = arguments
        self.function.acts = self.function.acts or callee.acts
        for name, argument, kind in zip(callee.source.parameters, arguments, kinds, strict=True):
            if name in callee.writes:
                if not isinstance(argument, ast.expr):
                    raise self.error(node, "changes a constant", "Use a local() of the component")
                self.changes(argument)
            root = self.root(argument) if isinstance(argument, ast.expr) else None
            if root and (name in callee.mutable or is_rigid(kind)):
                self.function.mutable.add(root)
        return callee.result

    def bind(self, node: ast.Call, called: FunctionType) -> list[ast.expr | Any]:
        """Arguments in the order of parameters: expressions, or default values."""
        if any(isinstance(argument, ast.Starred) for argument in node.args) or any(
            keyword.arg is None for keyword in node.keywords
        ):
            raise self.error(node, "gives arguments by *", "Give each by itself")
        try:
            bound = inspect.signature(called).bind(
                *node.args, **{str(keyword.arg): keyword.value for keyword in node.keywords}
            )
        except TypeError as error:
            raise self.error(node, f"does not fit `{called.__name__}`: {error}", "Correct the arguments") from None
        bound.apply_defaults()
        return list(bound.arguments.values())

    def changes(self, target: ast.expr) -> None:
        """Note whose memory a statement writes to."""
        root = self.root(target)
        if root is None:
            raise self.error(target, "is a constant and cannot be changed", "Use a local() of the component")
        self.function.writes.add(root)
        self.function.mutable.add(root)
        self.function.acts = True

    def extreme(self, node: ast.Call) -> Type:
        """`min`, `max`."""
        if len(node.args) < 2:
            raise self.error(node, "looks through an array", LOOP)
        kind: Type = UNKNOWN
        for argument in node.args:
            kind = join(kind, self.number(argument))
        return kind

    def powered(self, node: ast.Call) -> Type:
        """`pow` with two arguments, as `**`."""
        if len(node.args) != 2:
            raise self.error(node, "needs two arguments", "Write a**b")
        return self.power(node, join(self.number(node.args[0]), self.number(node.args[1])), node.args[1])

    def absolute(self, node: ast.Call) -> Type:
        kind = self.only_argument(node)
        return INTEGER if kind == BOOLEAN else kind

    def only_argument(self, node: ast.Call) -> Type:
        """The type of the only argument."""
        if len(node.args) != 1:
            raise self.error(node, "needs one argument", "Give one number")
        return self.number(node.args[0])

    def rounded(self, node: ast.Call) -> Type:
        self.only_argument(node)
        return INTEGER

    def real(self, node: ast.Call) -> Type:
        self.only_argument(node)
        return REAL

    def truth(self, node: ast.Call) -> Type:
        self.only_argument(node)
        return BOOLEAN

    def length(self, node: ast.Call) -> Type:
        kind = self.expression(node.args[0]) if len(node.args) == 1 else UNKNOWN
        if not isinstance(kind, Array | Tuple):
            raise self.error(node, "measures what has no length", "Give an array")
        return INTEGER

    def counting(self, node: ast.Call) -> Type:
        raise self.error(node, "stands outside of a `for`", "Write `for i in range(n):`")


def is_rigid(kind: Type) -> bool:
    """Whether an argument has rows: C11 does not let a pointer to rows become one to const rows."""
    return isinstance(kind, Array) and len(kind.shape) > 1 and not kind.constant


def hashable(value: Any) -> bool:
    """Whether an object can be looked up in a table."""
    return getattr(value, "__hash__", None) is not None


SPECIAL: dict[Any, Callable[[CallInference, ast.Call], Type]] = {
    min: CallInference.extreme,
    max: CallInference.extreme,
    pow: CallInference.powered,
    abs: CallInference.absolute,
    np.absolute: CallInference.absolute,
    float: CallInference.real,
    np.float64: CallInference.real,
    bool: CallInference.truth,
    np.bool_: CallInference.truth,
    len: CallInference.length,
    range: CallInference.counting,
    **dict.fromkeys(builtins.ROUNDING, CallInference.rounded),
}
