"""Types of expressions, a function per construct."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np

from twin.compiler.infer.static import NotStaticError, Static
from twin.compiler.syntax_tree import walk
from twin.compiler.types import (
    BOOLEAN,
    COMPUTED,
    INTEGER,
    REAL,
    UNKNOWN,
    Array,
    MixedError,
    Record,
    Scalar,
    StaticObject,
    Tuple,
    Type,
    UnknownType,
    describe,
    join,
    of_constant,
)
from twin.component import source

BITS = (ast.BitOr, ast.BitAnd, ast.BitXor)
SHIFTS = (ast.LShift, ast.RShift)


class ExpressionInference(Static):
    """Expressions of one function."""

    def expression(self, node: ast.expr) -> Type:
        """The type of an expression, noted at its node."""
        kind: Type = self.visit(node)
        self.function.types[id(node)] = kind
        return kind

    def generic_visit(self, node: ast.AST) -> None:
        """Refuse a construct without a method."""
        raise self.error(node, "has no form in C", FORBIDDEN.get(type(node), "Write it otherwise"))

    def number(self, node: ast.expr) -> Type:
        """The type of an expression that must be a number."""
        kind = self.expression(node)
        if not isinstance(kind, Scalar | UnknownType):
            remedy = "Loop over its elements" if isinstance(kind, Array) else "Use a number"
            raise self.error(node, f"is {describe(kind)}, not a number", remedy)
        return kind

    def require_integer(self, node: ast.expr, kind: Type) -> None:
        """Raise an error if the type is not an integer."""
        if not isinstance(kind, UnknownType) and kind not in (INTEGER, BOOLEAN):
            raise self.error(node, f"is {describe(kind)}, not a whole one", "Use int(...)")

    def root(self, node: ast.expr) -> str | None:
        """The argument in whose memory an expression lies; None for constants."""
        while isinstance(node, ast.Attribute | ast.Subscript):
            node = node.value
        if isinstance(node, ast.IfExp):
            return self.root(node.body) or self.root(node.orelse)
        return self.function.roots.get(node.id) if isinstance(node, ast.Name) else None

    def visit_Constant(self, node: ast.Constant) -> Type:
        if isinstance(node.value, complex | bytes):
            raise self.error(node, "is no number of C", "Use real numbers")
        return self.of_object(node, node.value)

    def of_object(self, node: ast.AST, value: Any) -> Type:
        """The type of an object of the module; whole numbers of more than 64 bits are refused."""
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise self.error(node, "has more than 64 bits", "Use a smaller number, or a real one")
        return of_constant(value)

    def visit_Name(self, node: ast.Name) -> Type:
        if node.id in self.source.locals:
            return self.function.locals.get(node.id, UNKNOWN)
        return self.of_object(node, self.free(node))

    def free(self, node: ast.Name) -> Any:
        """What a free name stands for."""
        try:
            return self.source.value(node.id)
        except KeyError:
            records = {name: kind for name, kind in self.function.locals.items() if isinstance(kind, Record)}
            owners = [name for name, record in records.items() if node.id in record.struct.fields]
            remedy = f"Write `{owners[0]}.{node.id}`" if owners else "Import or define it in the module"
            raise self.error(node, "is not defined", remedy) from None

    def visit_Attribute(self, node: ast.Attribute) -> Type:
        base = self.expression(node.value)
        if isinstance(base, Record):
            return self.field(node, base)
        if isinstance(base, Array) and node.attr in ("shape", "size", "ndim"):
            return of_constant(getattr(np.empty(base.shape), node.attr))
        if isinstance(base, StaticObject):
            try:
                return self.of_object(node, getattr(base.value, node.attr))
            except AttributeError:
                raise self.error(node, "does not exist", "Correct the name") from None
        raise self.error(node, f"asks {describe(base)} for `{node.attr}`", "Write a loop over the elements")

    def field(self, node: ast.Attribute, base: Record) -> Type:
        struct = base.struct
        own = struct.fields.get(node.attr) or struct.overlays.get(node.attr)
        if own is None:
            raise self.error(node, "is not declared", "Declare it as a variable of the component")
        if own.struct is not None:
            return Record(own.struct)
        return Array(own.storage, own.shape) if own.shape else COMPUTED[own.storage]

    def visit_Subscript(self, node: ast.Subscript) -> Type:
        base = self.expression(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if any(isinstance(index, ast.Slice) for index in indices):
            raise self.error(node, "is a slice", "Loop over the elements")
        if isinstance(base, Tuple):
            return self.item(node, base, indices)
        if isinstance(base, StaticObject) and isinstance(base.value, tuple | dict):
            try:
                return of_constant(self.static(node))
            except NotStaticError:
                raise self.error(
                    node, "is found in no table of numbers", "Use a tuple of numbers of one length"
                ) from None
        if isinstance(base, UnknownType):
            return UNKNOWN
        if not isinstance(base, Array):
            raise self.error(node, f"indexes {describe(base)}", "Index arrays and tuples only")
        if len(indices) > len(base.shape):
            raise self.error(node, f"has more indices than {describe(base)}", "Drop some")
        for index, size in zip(indices, base.shape, strict=False):
            self.require_integer(index, self.expression(index))
            self.within(node, index, size)
        return element(base, len(indices))

    def within(self, node: ast.Subscript, index: ast.expr, size: int) -> None:
        """A known index must be inside; C would read or write beside the array."""
        try:
            value = self.static(index)
        except NotStaticError:
            return
        if not -size <= value < size:
            raise self.error(node, f"is outside of its array, whose indices end at {size - 1}", "Correct it")

    def item(self, node: ast.Subscript, base: Tuple, indices: list[ast.expr]) -> Type:
        """One of several values, by a known index, or by any if all are numbers."""
        try:
            self.static(indices[0])
        except NotStaticError:
            kind: Type = UNKNOWN
            self.require_integer(indices[0], self.expression(indices[0]))
            for item in base.items:
                if not isinstance(item, Scalar | UnknownType) or len(indices) > 1:
                    raise self.error(node, "picks one of several values", "Unpack them") from None
                kind = join(kind, item)
            return kind
        return base.items[self.position(node, indices, len(base.items))]

    def position(self, node: ast.Subscript, indices: list[ast.expr], size: int) -> int:
        """A known index into several values."""
        value = self.static(indices[0])
        if not isinstance(value, int) or not -size <= value < size or len(indices) > 1:
            raise self.error(node, f"picks none of {size} values", "Correct the index")
        return value % size

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Type:
        if isinstance(node.op, ast.Not):
            self.condition(node.operand)
            return BOOLEAN
        kind = self.number(node.operand)
        if isinstance(node.op, ast.Invert):
            self.require_integer(node.operand, kind)
        return INTEGER if kind == BOOLEAN else kind

    def visit_BinOp(self, node: ast.BinOp) -> Type:
        return self.binary_type(node, self.number(node.left), node.op, node.right)

    def binary_type(self, node: ast.BinOp | ast.AugAssign, left: Type, op: ast.operator, right_node: ast.expr) -> Type:
        right = self.number(right_node)
        if isinstance(left, UnknownType) or isinstance(right, UnknownType):
            return REAL if isinstance(op, ast.Div) else join(left, right)
        if not isinstance(left, Scalar):
            raise self.error(node, f"computes with {describe(left)}", "Loop over its elements")
        both = join(left, right)
        if isinstance(op, ast.Div):
            return REAL
        if isinstance(op, ast.MatMult):
            raise self.error(node, "multiplies matrices", "Write the loops")
        if isinstance(op, BITS + SHIFTS):
            if both == REAL:
                raise self.error(node, "works on the bits of a real number", "Use whole numbers")
            return BOOLEAN if both == BOOLEAN and isinstance(op, BITS) else INTEGER
        if isinstance(op, ast.Pow):
            return self.power(node, both, right_node)
        return INTEGER if both == BOOLEAN else both

    def power(self, node: ast.AST, both: Type, exponent: ast.expr) -> Type:
        if both == REAL:
            return REAL
        try:
            value = self.static(exponent)
        except NotStaticError:
            value = -1
        if value < 0:
            remedy = "Write the exponent as a number that is not negative, or make one of them real: float(...)"
            raise self.error(node, "is whole or real, depending on the exponent", remedy)
        return INTEGER

    def condition(self, node: ast.expr) -> None:
        """Infer an expression that is used as a condition."""
        if isinstance(node, ast.BoolOp):
            for value in node.values:
                self.condition(value)
            self.function.types[id(node)] = BOOLEAN
            return
        kind = self.expression(node)
        if not isinstance(kind, Scalar | UnknownType):
            raise self.error(node, f"is {describe(kind)} and neither true nor false", "Compare numbers")

    def visit_BoolOp(self, node: ast.BoolOp) -> Type:
        """`and`, `or`: one of the values, as Python has it; a Boolean if all are."""
        kind: Type = UNKNOWN
        for value in node.values:
            kind = join(kind, self.number(value))
        return kind

    def visit_Compare(self, node: ast.Compare) -> Type:
        for op in node.ops:
            if isinstance(op, ast.Is | ast.IsNot):
                try:
                    return of_constant(self.static(node))
                except NotStaticError:
                    raise self.error(node, "asks for the same object", "Compare with == or !=") from None
        left = node.left
        self.number(left)
        for op, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.In | ast.NotIn):
                self.membership(node, right)
            else:
                self.number(right)
            left = right
        if len(node.ops) > 1 and any(self.has_effect(comparator) for comparator in node.comparators[:-1]):
            raise self.error(node, "compares the result of a function twice", "Give it a name first")
        return BOOLEAN

    def membership(self, node: ast.Compare, right: ast.expr) -> None:
        if len(node.ops) > 1:
            raise self.error(node, "chains `in`", "Write two comparisons")
        if isinstance(right, ast.Tuple):
            for item in right.elts:
                self.number(item)
            return
        kind = self.expression(right)
        if not isinstance(kind, Array) or len(kind.shape) != 1:
            raise self.error(right, f"is {describe(kind)}, where one looks for a value", "Use a tuple of numbers")

    def has_effect(self, node: ast.AST) -> bool:
        """Whether an expression calls a function that does more than compute."""
        for inner in walk(node):
            called = self.function.calls.get(id(inner))
            if called is not None and called.acts:
                return True
        return False

    def visit_IfExp(self, node: ast.IfExp) -> Type:
        self.condition(node.test)
        a, b = self.expression(node.body), self.expression(node.orelse)
        try:
            return join(a, b)
        except MixedError:
            raise self.error(node, f"is {describe(a)} or {describe(b)}", "Use one kind") from None

    def visit_Tuple(self, node: ast.Tuple) -> Type:
        items = tuple(self.expression(element) for element in node.elts)
        if any(not isinstance(item, Scalar | Tuple | UnknownType) for item in items):
            raise self.error(node, "holds more than numbers", "Use numbers")
        return Tuple(items)


def element(array: Array, indices: int) -> Type:
    """What is left of an array after so many indices."""
    rest = array.shape[indices:]
    return Array(array.storage, rest, array.constant) if rest else COMPUTED[array.storage]


# construct: what to write instead; those that the linter knows, and those that only matter here
FORBIDDEN: dict[type[ast.AST], str] = {
    **{kind: remedy for kind, (_, remedy) in source.FORBIDDEN.items()},
    ast.FunctionDef: "Write the function in the module",
    ast.Match: "Use if and elif",
    ast.Delete: "Drop it",
    ast.NamedExpr: "Assign it in a line of its own",
    ast.Starred: "Give each by itself",
}
