"""Types of variables, and what statements do with them, a function per construct."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from twin.compiler.infer.calls import LOOP, CallInference
from twin.compiler.infer.expressions import element
from twin.compiler.infer.program import Program, TypedFunction
from twin.compiler.infer.static import NotStaticError
from twin.compiler.resolve import TranslationError
from twin.compiler.syntax_tree import walk
from twin.compiler.types import (
    INTEGER,
    NOTHING,
    UNKNOWN,
    Array,
    MixedError,
    Nothing,
    Record,
    Scalar,
    StaticObject,
    Tuple,
    Type,
    UnknownType,
    describe,
    join,
)

if TYPE_CHECKING:
    from twin.compiler.resolve import FunctionSource

ROUNDS = 12  # passes after which types must have settled; each can only grow twice


class Inference(CallInference):
    """One function's types."""

    def __init__(self, program: Program, function: TypedFunction) -> None:
        super().__init__(program, function)
        taken = self.source.tree.args
        if taken.vararg or taken.kwarg or taken.kwonlyargs or taken.posonlyargs:
            raise self.error(self.source.tree, "takes arguments in a way that C lacks", "Use plain arguments")
        for name, kind in zip(self.source.parameters, function.arguments, strict=True):
            function.locals[name] = kind
            if isinstance(kind, Array | Record):
                function.roots[name] = name

    def run(self) -> None:
        """Go over the text until nothing changes."""
        function = self.function
        for _ in range(ROUNDS):
            before = (dict(function.locals), function.result, set(function.mutable), dict(function.roots))
            function.types.clear()
            self.block(self.source.tree.body)
            if before == (function.locals, function.result, function.mutable, function.roots):
                break
        if self.program.problems:
            return  # what is not known follows from them
        if isinstance(function.result, UnknownType):
            function.result = NOTHING
        for node in walk(self.source.tree):
            if isinstance(function.types.get(id(node)), UnknownType):
                raise self.error(node, "is used before it has a value", "Set it first")
        end = self.source.tree.body
        if not isinstance(function.result, Nothing) and not returns(end):
            raise self.error(self.source.tree, "may end without a result", "End it with `return`")

    def block(self, statements: list[ast.stmt]) -> None:
        """Statements in their order; one that has no form in C keeps no other from being looked at."""
        for statement in statements:
            try:
                self.visit(statement)
            except TranslationError as error:
                self.program.problems[str(error)] = None
                for node in walk(statement):
                    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                        self.function.locals.setdefault(node.id, UNKNOWN)

    def visit_Assign(self, node: ast.Assign) -> None:
        if len(node.targets) > 1:
            kind = self.expression(node.value)
            for target in node.targets:
                self.store(target, kind, node.value)
            return
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            if len(target.elts) != len(node.value.elts):
                raise self.error(node, "has not as many values as names", "Give each name one value")
            kinds = [self.expression(element) for element in node.value.elts]
            for item_target, kind, value in zip(target.elts, kinds, node.value.elts, strict=True):
                self.store(item_target, kind, value)
            return
        self.store(target, self.expression(node.value), node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.store(node.target, self.expression(node.value), node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        value = self.binary_type(node, self.expression(node.target), node.op, node.value)
        if self.has_effect(node.target):
            raise self.error(node, "calls a function for the place it changes", "Give the index a name first")
        self.store(node.target, value, None)

    def store(self, target: ast.expr, kind: Type, value: ast.expr | None) -> None:
        """Store a value to a name, a variable or an element, or several values to a tuple of targets."""
        if isinstance(target, ast.Name):
            self.store_name(target, kind, value)
        elif isinstance(target, ast.Tuple):
            items = self.parts(target, kind)
            for item_target, item in zip(target.elts, items, strict=True):
                self.store(item_target, item, None)
        elif isinstance(target, ast.Attribute | ast.Subscript):
            own = self.expression(target)
            if isinstance(kind, UnknownType):
                return
            if not isinstance(own, Scalar):
                raise self.error(target, f"is {describe(own)} and takes no whole", "Loop over its elements")
            if not isinstance(kind, Scalar):
                raise self.error(target, f"is a number, but gets {describe(kind)}", "Give it a number")
            self.changes(target)
        elif isinstance(target, ast.Starred):
            raise self.error(target, "takes what is left over", "Give each value a name")
        else:
            raise self.error(target, "takes no value in C", "Use plain names")

    def store_name(self, target: ast.Name, kind: Type, value: ast.expr | None) -> None:
        name = target.id
        if isinstance(kind, Nothing):
            raise self.error(value or target, "returns nothing", "Call it as a statement")
        if isinstance(kind, StaticObject) and kind.value is None:
            raise self.error(target, "gets None", "Use a number that cannot occur")
        if isinstance(kind, StaticObject):
            raise self.error(target, "gets no number", "Call functions by their own names")
        if name in self.source.parameters and isinstance(self.function.locals[name], Array | Record):
            raise self.error(target, "is an argument that holds an array", "Use another name")
        if isinstance(kind, Array) and value is not None:
            root = self.root(value)
            if root:
                self.function.roots[name] = root
        try:
            self.function.locals[name] = join(self.function.locals.get(name, UNKNOWN), kind)
        except MixedError as error:
            a, b = map(describe, error.types)
            raise self.error(target, f"is {a} here and {b} there", "Use two names") from None
        self.function.types[id(target)] = self.function.locals[name]

    def parts(self, target: ast.Tuple, kind: Type) -> tuple[Type, ...]:
        """Types of the items that are unpacked."""
        if isinstance(kind, UnknownType):
            return tuple(UNKNOWN for _ in target.elts)
        if isinstance(kind, Tuple):
            items = kind.items
        elif isinstance(kind, Array):
            items = tuple(element(kind, 1) for _ in range(kind.shape[0]))
        else:
            raise self.error(target, f"unpacks {describe(kind)}", "Return a tuple of numbers")
        if len(items) != len(target.elts):
            raise self.error(target, f"unpacks {len(items)} values", "Give each a name")
        return items

    def visit_If(self, node: ast.If) -> None:
        chosen = self.chosen(node)
        if chosen is not None:
            self.block(chosen)
            return
        self.condition(node.test)
        self.block(node.body)
        self.block(node.orelse)

    def chosen(self, node: ast.If) -> list[ast.stmt] | None:
        """The branch that is taken, if the condition is about objects that are known, such as `x is None`."""
        try:
            value = self.static(node.test)
        except NotStaticError:
            return None
        if isinstance(node.test, ast.Constant):
            return None  # `if True:` is written as it stands
        return node.body if value else node.orelse

    def visit_While(self, node: ast.While) -> None:
        if node.orelse:
            raise self.error(node, "has an `else`", "Use a variable for it")
        self.condition(node.test)
        self.block(node.body)

    def visit_For(self, node: ast.For) -> None:
        if node.orelse:
            raise self.error(node, "has an `else`", "Use a variable for it")
        if is_range(node.iter, self.source):
            assert isinstance(node.iter, ast.Call)
            self.check_range(node.iter)
            if not isinstance(node.target, ast.Name):
                raise self.error(node.target, "counts nothing", "Give the loop one name")
            self.store_name(node.target, INTEGER, None)
        else:
            kind = self.expression(node.iter)
            if not isinstance(kind, Array):
                raise self.error(node.iter, "cannot be looped over", LOOP)
            self.store(node.target, element(kind, 1), node.iter)
        self.block(node.body)

    def check_range(self, call: ast.Call) -> None:
        """Whole bounds, and a step that is known."""
        if call.keywords or not 1 <= len(call.args) <= 3:
            raise self.error(call, "has no bounds that C has", "Give one to three numbers")
        for bound in call.args:
            self.require_integer(bound, self.expression(bound))
        if len(call.args) == 3:
            try:
                step = self.static(call.args[2])
            except NotStaticError:
                raise self.error(call.args[2], "is a step that is not known beforehand", "Use a constant") from None
            if step == 0:
                raise self.error(call.args[2], "is no step", "Use a number that is not 0")

    def visit_Return(self, node: ast.Return) -> None:
        kind: Type = NOTHING if node.value is None else self.expression(node.value)
        if isinstance(kind, StaticObject) and kind.value is None:
            kind = NOTHING
        if isinstance(kind, Array | Record | StaticObject):
            raise self.error(node, f"returns {describe(kind)}", "Return numbers")
        try:
            self.function.result = join(self.function.result, kind)
        except MixedError:
            raise self.error(node, "returns another kind than before", "Return the same everywhere") from None

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        if not isinstance(node.value, ast.Call):
            raise self.error(node, "computes what nobody takes", "Assign it, or drop it")
        self.expression(node.value)

    def visit_Pass(self, node: ast.stmt) -> None:
        """`pass`, `break`, `continue`."""

    visit_Break = visit_Continue = visit_Pass


def returns(statements: list[ast.stmt]) -> bool:
    """Whether a block never falls through its end."""
    ends = [statement for statement in statements if not isinstance(statement, ast.Pass)]
    if not ends:
        return False
    last = ends[-1]
    if isinstance(last, ast.If):
        return returns(last.body) and returns(last.orelse)
    if isinstance(last, ast.While):
        leaves = any(isinstance(node, ast.Break) for node in walk(last))
        return isinstance(last.test, ast.Constant) and bool(last.test.value) and not leaves
    return isinstance(last, ast.Return)


def is_range(node: ast.expr, source: FunctionSource) -> bool:
    """Whether an expression is `range(...)`."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in source.locals):
        return False
    return source.value(node.func.id) is range if node.func.id == "range" else False


def program() -> Program:
    """An empty program, whose functions are inferred here."""
    return Program(lambda program, function: Inference(program, function).run())
