"""Second stage: the type of every expression and variable of a function, as it is called with given types.

A function is inferred once for each combination of argument types, as templates are. Types only grow (Boolean, whole,
real), so the text is gone over until nothing changes. On the way it is found what a function writes to, and whether
calling it has any other effect than its result.
"""

from __future__ import annotations

import ast
import inspect
import operator
from dataclasses import dataclass, field
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import words
from twin.compiler.resolve import Source, TranslationError, source_of
from twin.compiler.types import (
    BOOLEAN,
    COMPUTED,
    INTEGER,
    NOTHING,
    REAL,
    UNKNOWN,
    Array,
    Known,
    Kind,
    MixedError,
    Nothing,
    Record,
    Scalar,
    Tuple,
    Type,
    Unknown,
    as_table,
    describe,
    join,
    of_constant,
)
from twin.compiler.words import Word

if TYPE_CHECKING:
    from collections.abc import Callable

ROUNDS = 12  # passes after which types must have settled; each can only grow twice

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow, ast.BitOr: operator.or_,
    ast.BitAnd: operator.and_, ast.BitXor: operator.xor, ast.LShift: operator.lshift, ast.RShift: operator.rshift,
}  # fmt: skip
BITS = (ast.BitOr, ast.BitAnd, ast.BitXor)
SHIFTS = (ast.LShift, ast.RShift)
LOOP = "Write `for i in range(n)` and index with i"


@dataclass(eq=False, slots=True)
class Function:
    """A function with the types it is called with; what inference found, and later its name in C."""

    source: Source
    arguments: tuple[Type, ...]
    types: dict[int, Type] = field(default_factory=dict)  # of expressions, by identity of their nodes
    locals: dict[str, Type] = field(default_factory=dict)
    calls: dict[int, Function | Word] = field(default_factory=dict)
    bound: dict[int, list[ast.expr | Any]] = field(default_factory=dict)  # arguments in the order of parameters
    roots: dict[str, str] = field(default_factory=dict)  # local name of an array -> argument it lies in
    writes: set[str] = field(default_factory=set)  # arguments whose memory it changes
    mutable: set[str] = field(default_factory=set)  # those, and arguments that C cannot show as const
    nonnegative: set[str] = field(default_factory=set)  # arguments that no caller gives a negative number
    result: Type = UNKNOWN
    acts: bool = False  # whether it does more than compute a result
    name: str = ""

    @property
    def where(self) -> str:
        """File and line."""
        return f"{self.source.file.name}:{self.source.tree.lineno}"


class NotStaticError(Exception):
    """The value of an expression is not known while translating."""


class Program:
    """The functions that an entry reaches, each before those that call it."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.order: list[Function] = []
        self._open: list[FunctionType] = []

    def infer(self, function: FunctionType, arguments: tuple[Type, ...]) -> Function:
        """The function for these argument types."""
        key = (function, arguments)
        if key not in self.functions:
            source = source_of(function)
            if function in self._open:
                remedy = "Write a loop with known bounds"
                raise source.error(source.tree, f"calls itself, through {self._open[-1].__name__}", remedy)
            self._open.append(function)
            made = Function(source, arguments)
            Inference(self, made).run()
            self._open.pop()
            made.nonnegative = {n for n, kind in zip(source.parameters, arguments, strict=True) if kind == INTEGER}
            self.functions[key] = made
            self.order.append(made)
        return self.functions[key]


class Inference:
    """One function's types."""

    def __init__(self, program: Program, function: Function) -> None:
        self.program, self.function, self.source = program, function, function.source
        taken = self.source.tree.args
        if taken.vararg or taken.kwarg or taken.kwonlyargs or taken.posonlyargs:
            raise self.error(self.source.tree, "takes arguments in a way that C lacks", "Use plain arguments")
        for name, kind in zip(self.source.parameters, function.arguments, strict=True):
            function.locals[name] = kind
            if isinstance(kind, Array | Record):
                function.roots[name] = name

    def error(self, node: ast.AST, reason: str, remedy: str) -> TranslationError:
        """The message for a construct of this function."""
        return self.source.error(node, reason, remedy)

    def run(self) -> None:
        """Go over the text until nothing changes."""
        function = self.function
        for _ in range(ROUNDS):
            before = (dict(function.locals), function.result, set(function.mutable), dict(function.roots))
            function.types.clear()
            self.block(self.source.tree.body)
            if before == (function.locals, function.result, function.mutable, function.roots):
                break
        if isinstance(function.result, Unknown):
            function.result = NOTHING
        for node in ast.walk(self.source.tree):
            if isinstance(function.types.get(id(node)), Unknown):
                raise self.error(node, "is used before it has a value", "Set it first")
        end = self.source.tree.body
        if not isinstance(function.result, Nothing) and not returns(end):
            raise self.error(self.source.tree, "may end without a result", "End it with `return`")

    # -------------------------------------------------------------------------------------------------- statements

    def block(self, statements: list[ast.stmt]) -> None:
        """Statements in their order."""
        for statement in statements:
            known = STATEMENTS.get(type(statement))
            if known is None:
                raise self.error(statement, "has no form in C", FORBIDDEN.get(type(statement), "Write it otherwise"))
            known(self, statement)

    def assign(self, node: ast.Assign) -> None:
        if len(node.targets) > 1:
            kind = self.expression(node.value)
            for target in node.targets:
                self.store(target, kind, node.value)
            return
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            if len(target.elts) != len(node.value.elts):
                raise self.error(node, "has not as many values as names", "Give each name one value")
            kinds = [self.expression(one) for one in node.value.elts]
            for place, kind, value in zip(target.elts, kinds, node.value.elts, strict=True):
                self.store(place, kind, value)
            return
        self.store(target, self.expression(node.value), node.value)

    def annotated(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.store(node.target, self.expression(node.value), node.value)

    def augmented(self, node: ast.AugAssign) -> None:
        value = self.binary_type(node, self.read(node.target), node.op, node.value)
        self.store(node.target, value, None)

    def read(self, target: ast.expr) -> Type:
        """The type of a target as a value."""
        return self.expression(target)

    def store(self, target: ast.expr, kind: Type, value: ast.expr | None) -> None:
        """A value goes to a name, a variable, an element, or several values to several."""
        if isinstance(target, ast.Name):
            self.store_name(target, kind, value)
        elif isinstance(target, ast.Tuple):
            items = self.parts(target, kind)
            for place, item in zip(target.elts, items, strict=True):
                self.store(place, item, None)
        elif isinstance(target, ast.Attribute | ast.Subscript):
            place = self.expression(target)
            if isinstance(kind, Unknown):
                return
            if not isinstance(place, Scalar):
                raise self.error(target, f"is {describe(place)} and takes no whole", "Loop over its elements")
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
        if isinstance(kind, Known) and kind.value is None:
            raise self.error(target, "gets None", "Use a number that cannot occur")
        if isinstance(kind, Known):
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
        if isinstance(kind, Unknown):
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

    def changes(self, target: ast.expr) -> None:
        """Note whose memory a statement writes to."""
        root = self.root(target)
        if root is None:
            raise self.error(target, "is a constant and cannot be changed", "Use a local() of the component")
        self.function.writes.add(root)
        self.function.mutable.add(root)
        self.function.acts = True

    def root(self, node: ast.expr) -> str | None:
        """The argument in whose memory an expression lies; None for constants."""
        while isinstance(node, ast.Attribute | ast.Subscript):
            node = node.value
        if isinstance(node, ast.IfExp):
            return self.root(node.body) or self.root(node.orelse)
        return self.function.roots.get(node.id) if isinstance(node, ast.Name) else None

    def condition(self, node: ast.expr) -> None:
        """An expression of which only the truth is asked."""
        if isinstance(node, ast.BoolOp):
            for value in node.values:
                self.condition(value)
            self.function.types[id(node)] = BOOLEAN
            return
        kind = self.expression(node)
        if not isinstance(kind, Scalar | Unknown):
            raise self.error(node, f"is {describe(kind)} and neither true nor false", "Compare numbers")

    def branch(self, node: ast.If) -> None:
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

    def loop_while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.error(node, "has an `else`", "Use a variable for it")
        self.condition(node.test)
        self.block(node.body)

    def loop_for(self, node: ast.For) -> None:
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
            self.whole(bound, self.expression(bound))
        if len(call.args) == 3:
            try:
                step = self.static(call.args[2])
            except NotStaticError:
                raise self.error(call.args[2], "is a step that is not known beforehand", "Use a constant") from None
            if step == 0:
                raise self.error(call.args[2], "is no step", "Use a number that is not 0")

    def whole(self, node: ast.expr, kind: Type) -> None:
        """Refuse what is no whole number."""
        if not isinstance(kind, Unknown) and kind not in (INTEGER, BOOLEAN):
            raise self.error(node, f"is {describe(kind)}, not a whole one", "Use int(...)")

    def give(self, node: ast.Return) -> None:
        kind: Type = NOTHING if node.value is None else self.expression(node.value)
        if isinstance(kind, Known) and kind.value is None:
            kind = NOTHING
        if isinstance(kind, Array | Record | Known):
            raise self.error(node, f"returns {describe(kind)}", "Return numbers")
        try:
            self.function.result = join(self.function.result, kind)
        except MixedError:
            raise self.error(node, "returns another kind than before", "Return the same everywhere") from None

    def statement(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        if not isinstance(node.value, ast.Call):
            raise self.error(node, "computes what nobody takes", "Assign it, or drop it")
        self.expression(node.value)

    def nothing(self, node: ast.stmt) -> None:
        """`pass`, `break`, `continue`."""

    # ------------------------------------------------------------------------------------------------- expressions

    def expression(self, node: ast.expr) -> Type:
        """The type of an expression, noted at its node."""
        known = EXPRESSIONS.get(type(node))
        if known is None:
            raise self.error(node, "has no form in C", FORBIDDEN.get(type(node), "Write it otherwise"))
        kind = known(self, node)
        self.function.types[id(node)] = kind
        return kind

    def number(self, node: ast.expr) -> Type:
        """The type of an expression that must be a number."""
        kind = self.expression(node)
        if not isinstance(kind, Scalar | Unknown):
            remedy = "Loop over its elements" if isinstance(kind, Array) else "Use a number"
            raise self.error(node, f"is {describe(kind)}, not a number", remedy)
        return kind

    def constant(self, node: ast.Constant) -> Type:
        if isinstance(node.value, complex | bytes):
            raise self.error(node, "is no number of C", "Use real numbers")
        return of_constant(node.value)

    def name(self, node: ast.Name) -> Type:
        if node.id in self.source.locals:
            return self.function.locals.get(node.id, UNKNOWN)
        return of_constant(self.free(node))

    def free(self, node: ast.Name) -> Any:
        """What a free name stands for."""
        try:
            return self.source.value(node.id)
        except KeyError:
            raise self.error(node, "is not defined", "Import or define it in the module") from None

    def attribute(self, node: ast.Attribute) -> Type:
        base = self.expression(node.value)
        if isinstance(base, Record):
            return self.field(node, base)
        if isinstance(base, Array) and node.attr in ("shape", "size", "ndim"):
            return of_constant(getattr(np.empty(base.shape), node.attr))
        if isinstance(base, Known):
            try:
                return of_constant(getattr(base.value, node.attr))
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

    def subscript(self, node: ast.Subscript) -> Type:
        base = self.expression(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if any(isinstance(one, ast.Slice) for one in indices):
            raise self.error(node, "is a slice", "Loop over the elements")
        if isinstance(base, Tuple):
            return self.item(node, base, indices)
        if isinstance(base, Known) and isinstance(base.value, tuple | dict):
            try:
                return of_constant(self.static(node))
            except NotStaticError:
                raise self.error(node, "is found in no table of numbers", "Use a tuple of numbers of one length") from None
        if isinstance(base, Unknown):
            return UNKNOWN
        if not isinstance(base, Array):
            raise self.error(node, f"indexes {describe(base)}", "Index arrays and tuples only")
        if len(indices) > len(base.shape):
            raise self.error(node, f"has more indices than {describe(base)}", "Drop some")
        for index, size in zip(indices, base.shape, strict=False):
            self.whole(index, self.expression(index))
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
            self.whole(indices[0], self.expression(indices[0]))
            for one in base.items:
                if not isinstance(one, Scalar | Unknown) or len(indices) > 1:
                    raise self.error(node, "picks one of several values", "Unpack them") from None
                kind = join(kind, one)
            return kind
        return base.items[self.position(node, indices, len(base.items))]

    def position(self, node: ast.Subscript, indices: list[ast.expr], size: int) -> int:
        """A known index into several values."""
        value = self.static(indices[0])
        if not isinstance(value, int) or not -size <= value < size or len(indices) > 1:
            raise self.error(node, f"picks none of {size} values", "Correct the index")
        return value % size

    def unary(self, node: ast.UnaryOp) -> Type:
        if isinstance(node.op, ast.Not):
            self.condition(node.operand)
            return BOOLEAN
        kind = self.number(node.operand)
        if isinstance(node.op, ast.Invert):
            self.whole(node.operand, kind)
        return INTEGER if kind == BOOLEAN else kind

    def binary(self, node: ast.BinOp) -> Type:
        return self.binary_type(node, self.number(node.left), node.op, node.right)

    def binary_type(self, node: ast.BinOp | ast.AugAssign, left: Type, op: ast.operator, right_node: ast.expr) -> Type:
        right = self.number(right_node)
        if isinstance(left, Unknown) or isinstance(right, Unknown):
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

    def logic(self, node: ast.BoolOp) -> Type:
        """`and`, `or`: one of the values, as Python has it; a Boolean if all are."""
        kind: Type = UNKNOWN
        for value in node.values:
            kind = join(kind, self.number(value))
        return kind

    def compare(self, node: ast.Compare) -> Type:
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
        if len(node.ops) > 1 and any(self.has_effect(one) for one in node.comparators[:-1]):
            raise self.error(node, "compares the result of a function twice", "Give it a name first")
        return BOOLEAN

    def membership(self, node: ast.Compare, right: ast.expr) -> None:
        if len(node.ops) > 1:
            raise self.error(node, "chains `in`", "Write two comparisons")
        if isinstance(right, ast.Tuple):
            for one in right.elts:
                self.number(one)
            return
        kind = self.expression(right)
        if not isinstance(kind, Array) or len(kind.shape) != 1:
            raise self.error(right, f"is {describe(kind)}, where one looks for a value", "Use a tuple of numbers")

    def has_effect(self, node: ast.AST) -> bool:
        """Whether an expression calls a function that does more than compute."""
        for one in ast.walk(node):
            called = self.function.calls.get(id(one))
            if called is not None and called.acts:
                return True
        return False

    def choice(self, node: ast.IfExp) -> Type:
        self.condition(node.test)
        a, b = self.expression(node.body), self.expression(node.orelse)
        try:
            return join(a, b)
        except MixedError:
            raise self.error(node, f"is {describe(a)} or {describe(b)}", "Use one kind") from None

    def several(self, node: ast.Tuple) -> Type:
        items = tuple(self.expression(one) for one in node.elts)
        if any(not isinstance(item, Scalar | Tuple | Unknown) for item in items):
            raise self.error(node, "holds more than numbers", "Use numbers")
        return Tuple(items)

    # ------------------------------------------------------------------------------------------------------- calls

    def call(self, node: ast.Call) -> Type:
        kind = self.expression(node.func) if isinstance(node.func, ast.Name | ast.Attribute) else UNKNOWN
        if not isinstance(kind, Known):
            raise self.error(node, "calls what is no function", "Call functions by their names")
        called = kind.value
        if isinstance(called, FunctionType):
            if called in words.MACHINE:
                return self.word(node, words.MACHINE[called])
            return self.user(node, called)
        if node.keywords or any(isinstance(one, ast.Starred) for one in node.args):
            raise self.error(node, "gives arguments by name or by *", "Give them in their order")
        special = SPECIAL.get(called) if hashable(called) else None
        if special is not None:
            return special(self, node)
        if hashable(called) and called in words.PYTHON:
            return self.word(node, words.PYTHON[called])
        raise self.error(node, "cannot be called from C", self.instead(called))

    def instead(self, called: Any) -> str:
        """What to write instead of a call."""
        if called is np.tanh:
            return "Use tanh of `math`, which rounds as C's"
        module = getattr(called, "__module__", None) or ""
        name = getattr(called, "__name__", "")
        same = getattr(__import__("math"), name, None)
        if module.startswith("numpy") and same in words.PYTHON:
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
                self.whole(argument, kind)
        self.function.calls[id(node)] = word
        self.function.acts = self.function.acts or word.acts
        return word.result

    def user(self, node: ast.Call, called: FunctionType) -> Type:
        arguments = self.bind(node, called)
        kinds: list[Type] = []
        for one in arguments:
            kind = self.expression(one) if isinstance(one, ast.expr) else of_constant(one)
            if isinstance(kind, Unknown):
                return UNKNOWN
            # a table of one dimension is passed as any other array: what is read only is const in C
            if isinstance(kind, Array) and len(kind.shape) == 1:
                kind = Array(kind.storage, kind.shape)
            kinds.append(kind)
        callee = self.program.infer(called, tuple(kinds))
        self.function.calls[id(node)] = callee
        self.function.bound[id(node)] = arguments
        self.function.acts = self.function.acts or callee.acts
        for name, one, kind in zip(callee.source.parameters, arguments, kinds, strict=True):
            if name in callee.writes:
                if not isinstance(one, ast.expr):
                    raise self.error(node, "changes a constant", "Use a local() of the component")
                self.changes(one)
            root = self.root(one) if isinstance(one, ast.expr) else None
            if root and (name in callee.mutable or is_rigid(kind)):
                self.function.mutable.add(root)
        return callee.result

    def bind(self, node: ast.Call, called: FunctionType) -> list[ast.expr | Any]:
        """Arguments in the order of parameters: expressions, or default values."""
        if any(isinstance(one, ast.Starred) for one in node.args) or any(one.arg is None for one in node.keywords):
            raise self.error(node, "gives arguments by *", "Give each by itself")
        try:
            bound = inspect.signature(called).bind(*node.args, **{str(one.arg): one.value for one in node.keywords})
        except TypeError as error:
            raise self.error(node, f"does not fit `{called.__name__}`: {error}", "Correct the arguments") from None
        bound.apply_defaults()
        return list(bound.arguments.values())

    def extreme(self, node: ast.Call) -> Type:
        """`min`, `max`."""
        if len(node.args) < 2:
            raise self.error(node, "looks through an array", LOOP)
        kind: Type = UNKNOWN
        for one in node.args:
            kind = join(kind, self.number(one))
        return kind

    def powered(self, node: ast.Call) -> Type:
        """`pow` with two arguments, as `**`."""
        if len(node.args) != 2:
            raise self.error(node, "needs two arguments", "Write a**b")
        return self.power(node, join(self.number(node.args[0]), self.number(node.args[1])), node.args[1])

    def absolute(self, node: ast.Call) -> Type:
        kind = self.one(node)
        return INTEGER if kind == BOOLEAN else kind

    def one(self, node: ast.Call) -> Type:
        """The type of the only argument."""
        if len(node.args) != 1:
            raise self.error(node, "needs one argument", "Give one number")
        return self.number(node.args[0])

    def rounded(self, node: ast.Call) -> Type:
        self.one(node)
        return INTEGER

    def real(self, node: ast.Call) -> Type:
        self.one(node)
        return REAL

    def truth(self, node: ast.Call) -> Type:
        self.one(node)
        return BOOLEAN

    def length(self, node: ast.Call) -> Type:
        kind = self.expression(node.args[0]) if len(node.args) == 1 else UNKNOWN
        if not isinstance(kind, Array | Tuple):
            raise self.error(node, "measures what has no length", "Give an array")
        return INTEGER

    def counting(self, node: ast.Call) -> Type:
        raise self.error(node, "stands outside of a `for`", "Write `for i in range(n):`")

    # ------------------------------------------------------------------------------------------------ known values

    def static(self, node: ast.expr) -> Any:
        """The value of an expression that needs no run; NotStaticError otherwise."""
        known = STATIC.get(type(node))
        if known is None:
            raise NotStaticError
        try:
            return known(self, node)
        except NotStaticError:
            raise
        except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError):
            raise NotStaticError from None

    def static_name(self, node: ast.Name) -> Any:
        if node.id in self.source.locals:
            kind = self.function.locals.get(node.id)
            if isinstance(kind, Known):
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
        if called in words.PYTHON and getattr(called, "__module__", "") == "math":
            return called(*map(self.static, node.args))
        raise NotStaticError


def returns(statements: list[ast.stmt]) -> bool:
    """Whether a block never falls through its end."""
    ends = [one for one in statements if not isinstance(one, ast.Pass)]
    if not ends:
        return False
    last = ends[-1]
    if isinstance(last, ast.If):
        return returns(last.body) and returns(last.orelse)
    if isinstance(last, ast.While):
        leaves = any(isinstance(one, ast.Break) for one in ast.walk(last))
        return isinstance(last.test, ast.Constant) and bool(last.test.value) and not leaves
    return isinstance(last, ast.Return)


def element(array: Array, indices: int) -> Type:
    """What is left of an array after so many indices."""
    rest = array.shape[indices:]
    return Array(array.storage, rest, array.constant) if rest else COMPUTED[array.storage]


def is_rigid(kind: Type) -> bool:
    """Whether an argument has rows: C11 does not let a pointer to rows become one to const rows."""
    return isinstance(kind, Array) and len(kind.shape) > 1 and not kind.constant


def is_range(node: ast.expr, source: Source) -> bool:
    """Whether an expression is `range(...)`."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in source.locals):
        return False
    return source.value(node.func.id) is range if node.func.id == "range" else False


def hashable(value: Any) -> bool:
    """Whether an object can be looked up in a table."""
    return getattr(value, "__hash__", None) is not None


STATEMENTS: dict[type[ast.stmt], Callable[[Inference, Any], None]] = {
    ast.Assign: Inference.assign, ast.AnnAssign: Inference.annotated, ast.AugAssign: Inference.augmented,
    ast.If: Inference.branch, ast.While: Inference.loop_while, ast.For: Inference.loop_for,
    ast.Return: Inference.give, ast.Expr: Inference.statement, ast.Pass: Inference.nothing,
    ast.Break: Inference.nothing, ast.Continue: Inference.nothing,
}  # fmt: skip

EXPRESSIONS: dict[type[ast.expr], Callable[[Inference, Any], Type]] = {
    ast.Constant: Inference.constant, ast.Name: Inference.name, ast.Attribute: Inference.attribute,
    ast.Subscript: Inference.subscript, ast.UnaryOp: Inference.unary, ast.BinOp: Inference.binary,
    ast.BoolOp: Inference.logic, ast.Compare: Inference.compare, ast.IfExp: Inference.choice,
    ast.Tuple: Inference.several, ast.Call: Inference.call,
}  # fmt: skip

STATIC: dict[type[ast.expr], Callable[[Inference, Any], Any]] = {
    ast.Constant: lambda _, node: node.value, ast.Name: Inference.static_name,
    ast.Attribute: Inference.static_attribute, ast.Subscript: Inference.static_subscript,
    ast.UnaryOp: Inference.static_unary, ast.Compare: Inference.static_compare, ast.Call: Inference.static_call,
    ast.BinOp: lambda self, node: OPERATORS[type(node.op)](self.static(node.left), self.static(node.right)),
}  # fmt: skip

SPECIAL: dict[Any, Callable[[Inference, ast.Call], Type]] = {
    min: Inference.extreme, max: Inference.extreme, pow: Inference.powered, abs: Inference.absolute, np.absolute: Inference.absolute,
    float: Inference.real, np.float64: Inference.real, bool: Inference.truth, np.bool_: Inference.truth,
    len: Inference.length, range: Inference.counting, **dict.fromkeys(words.WHOLE, Inference.rounded),
}  # fmt: skip

FORBIDDEN: dict[type[ast.AST], str] = {
    ast.Raise: "Return a status (`-> int`, ERROR of twin.solver) instead",
    ast.Try: "Test for the case before it happens",
    ast.With: "Components do no I/O; use a PythonComponent",
    ast.Assert: "Return a status instead",
    ast.Import: "Import at the top of the module",
    ast.ImportFrom: "Import at the top of the module",
    ast.Global: "Declare a local() variable",
    ast.FunctionDef: "Write the function in the module",
    ast.Lambda: "Write a function in the module",
    ast.ListComp: "Declare an array with shape=... and loop over its elements",
    ast.List: "Declare an array with shape=..., or use a tuple of the module",
    ast.Dict: "Declare variables instead",
    ast.Set: "Declare variables instead",
    ast.GeneratorExp: "Write the loop",
    ast.JoinedStr: "Publish a number instead",
    ast.Match: "Use if and elif",
    ast.Delete: "Drop it",
    ast.NamedExpr: "Assign it in a line of its own",
    ast.Starred: "Give each by itself",
}

__all__ = ["Function", "Inference", "Kind", "Program", "as_table", "element", "is_range"]
