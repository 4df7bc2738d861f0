"""Directional derivatives exact to rounding: a component's functions rewritten so that every value carries its tangent.

Forward mode by source: `self.y = sin(self.u)` becomes `v = sin(self.u)`, `d = dot.u * cos(self.u)`, `self.y = v`,
`dot.y = d`, with `dot` a second record of the same layout. Values are computed as before, to the bit, and decide which
branch is taken. At a kink the slope is that of the branch; where a square root starts, its infinite slope counts as 0,
so that sqrt(x) * x keeps its finite one. What is not understood is a reason, not a guess.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FunctionType
from typing import TYPE_CHECKING, Any

from twin.compiler import slopes
from twin.compiler.dual import ACTIVE, PLAIN, RECORD, ZERO, Dual, Expressions, UnknownError, dot
from twin.component import Float64, define

if TYPE_CHECKING:
    from twin.component import Component


@dataclass(frozen=True, slots=True)
class Tangents:
    """`(self, dot, t, dot_t)`: tangents of the derivatives and outputs `at` a point, and of `first`, initialization."""

    at: Callable[..., Any]
    first: Callable[..., Any]


@dataclass(slots=True)
class _Library:
    """The rewritten functions of one component."""

    reals: frozenset[str]  # names of its variables that have a tangent
    made: dict[tuple[FunctionType, tuple[str, ...]], tuple[Any, bool] | None] = field(default_factory=dict)

    def rewrite(self, function: FunctionType, kinds: tuple[str, ...]) -> tuple[Any, bool]:
        """A function with tangents for arguments of these kinds, and whether it returns (value, tangent)."""
        key = function, kinds
        if key in self.made:
            known = self.made[key]
            if known is None:
                raise UnknownError(f"`{function.__name__}` calls itself")
            return known
        self.made[key] = None
        rewriter = _Rewriter(self, function, kinds)
        self.made[key] = result = rewriter.build(), rewriter.returns
        return result


class _Rewriter(Expressions):
    """One function; its text is written again until it is known which names carry a tangent."""

    def build(self) -> Any:
        """The rewritten function."""
        before = None
        while before != (len(self.active), self.returns):
            before = len(self.active), self.returns
            self.lines, self.count = [], 0
            self.block(self.body)
        tangents = [dot(name) for name, kind in self.kinds.items() if kind != PLAIN]
        name = f"{self.function.__name__.strip('_')}_tangent"
        head = f"def {name}({', '.join([*self.parameters, *tangents])}):"
        scope = {**self.function.__globals__, **inspect.getclosurevars(self.function).nonlocals, **self.helpers}
        scope.update(slopes.CALLED)
        text = "\n".join([head, *self.lines, "    pass", ""])
        return define(name, text, scope, f"tangent of {self.function.__qualname__}")

    # --------------------------------------------------------------------------------------------------- writing

    def block(self, statements: list[ast.stmt]) -> None:
        """Statements one level deeper than their head; those of the function at its own."""
        for statement in statements:
            known = getattr(self, f"_write_{type(statement).__name__.lower()}", None)
            if known is None:
                raise self.unknown(statement)
            known(statement)

    def inner(self, head: str, statements: list[ast.stmt]) -> None:
        """A head and its block."""
        self.emit(head)
        self.depth += 1
        self.block(statements)
        self.emit("pass")
        self.depth -= 1

    # ------------------------------------------------------------------------------------------------ statements

    def _write_assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if len(node.targets) > 1:
            raise self.unknown(node, "assigns twice")
        if isinstance(target, ast.Tuple):
            self._unpack(target, node.value)
        else:
            self.assign(target, self.dual(node.value))

    def _unpack(self, target: ast.Tuple, value: ast.expr) -> None:
        if isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
            parts = [self.temporary(*self.dual(element)) for element in value.elts]
        else:
            whole, tangent = self.temporary(*self.dual(value))
            places = range(len(target.elts))
            parts = [(f"{whole}[{i}]", None if tangent is None else f"{tangent}[{i}]") for i in places]
        for place, part in zip(target.elts, parts, strict=True):
            self.assign(place, part)

    def _write_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.dual(node.value))

    def _write_augassign(self, node: ast.AugAssign) -> None:
        old = ast.parse(ast.unparse(node.target), mode="eval").body
        self.assign(node.target, self.dual(ast.copy_location(ast.BinOp(old, node.op, node.value), node)))

    def assign(self, target: ast.expr, dual: Dual) -> None:
        """Store a value and, where the place has one, its tangent."""
        value, tangent = dual
        if isinstance(target, ast.Name) and tangent is not None:
            self.active.add(target.id)
        self.emit(f"{ast.unparse(target)} = {value}")
        place = self.place(target)
        if place is not None:
            self.emit(f"{place} = {tangent or ZERO}")
        elif tangent is not None:
            raise self.unknown(target, "takes a value that has a tangent, but is not Float64")

    def _write_expr(self, node: ast.Expr) -> None:
        called = self.called(node.value.func) if isinstance(node.value, ast.Call) else None
        if self.touches(node) and isinstance(called, FunctionType) and isinstance(node.value, ast.Call):
            self.emit(self.helper_call(node.value, called)[0])
        elif self.touches(node):
            self.dual(node.value)
        elif isinstance(node.value, ast.Call):
            self.emit(ast.unparse(node))

    def _write_if(self, node: ast.If) -> None:
        self.inner(f"if {ast.unparse(node.test)}:", node.body)
        if node.orelse:
            self.inner("else:", node.orelse)

    def _write_for(self, node: ast.For) -> None:
        if node.orelse or self.touches(node.iter) or self.touches(node.target):
            raise self.unknown(node, "is not a loop over whole numbers or constants")
        self.inner(f"for {ast.unparse(node.target)} in {ast.unparse(node.iter)}:", node.body)

    def _write_while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.unknown(node)
        self.inner(f"while {ast.unparse(node.test)}:", node.body)

    def _write_return(self, node: ast.Return) -> None:
        if node.value is None:
            self.emit("return")
            return
        value, tangent = self.dual(node.value)
        self.returns = self.returns or tangent is not None
        self.emit(f"return {value}, {tangent or ZERO}" if self.returns else f"return {value}")

    def _write_pass(self, node: ast.stmt) -> None:
        self.emit(ast.unparse(node))

    _write_break = _write_continue = _write_pass


def tangents(cls: type[Component]) -> Tangents | str:
    """Tangents of a continuous component, or the reason why there are none."""
    cached: Tangents | str | None = cls.__dict__.get("_tangents")
    if cached is None:
        cached = build(cls)
        cls._tangents = cached  # type: ignore[attr-defined]
    return cached


def build(cls: type[Component]) -> Tangents | str:
    """Rewrite `derivatives` and `initialize`."""
    derivatives, initialize = getattr(cls, "derivatives", None), getattr(cls, "initialize", None)
    if not isinstance(derivatives, FunctionType):
        return "the component is not continuous"
    library = _Library(frozenset(variable.name for variable in cls.variables if variable.type is Float64))
    try:
        at, _ = library.rewrite(derivatives, (RECORD, ACTIVE))
        start = library.rewrite(initialize, (RECORD,))[0] if isinstance(initialize, FunctionType) else None
    except UnknownError as reason:
        return str(reason)
    return Tangents(*composed(at, start))


def composed(at: Callable[..., Any], start: Callable[..., Any] | None) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """What native code calls: both return a status; initialization is `initialize`, then `derivatives`."""

    def nothing(self: Any, dot: Any) -> None:
        pass

    begin = start or nothing

    def tangent_at(self: Any, dot: Any, t: float, dot_t: float) -> int:
        at(self, t, dot, dot_t)
        return 0

    def tangent_first(self: Any, dot: Any, t: float, dot_t: float) -> int:
        begin(self, dot)
        at(self, t, dot, dot_t)
        return 0

    return tangent_at, tangent_first
