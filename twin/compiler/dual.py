"""Values with tangents: how `tangent` rewrites the expressions of a function."""

from __future__ import annotations

import ast
import builtins
import inspect
import textwrap
from types import FunctionType, ModuleType
from typing import Any, Protocol

from twin.compiler import slopes

RECORD, ACTIVE, PLAIN = "record", "active", "plain"  # kinds of argument: has tangents, has a tangent, has none
ZERO = "0.0"

Dual = tuple[str, str | None]  # source text of a value and of its tangent; None: surely zero


class UnknownError(Exception):
    """Source that cannot be followed, and why."""


class Library(Protocol):
    """The rewritten functions of one component."""

    reals: frozenset[str]  # names of its variables that have a tangent

    def rewrite(self, function: FunctionType, kinds: tuple[str, ...]) -> tuple[Any, bool]:
        """A function with tangents for arguments of these kinds, and whether it returns (value, tangent)."""


class Expressions:
    """The expressions of one function; lines before an expression compute what it needs."""

    def __init__(self, library: Library, function: FunctionType, kinds: tuple[str, ...]) -> None:
        self.library, self.function = library, function
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        except (OSError, SyntaxError, IndexError):
            raise UnknownError(f"the source of `{function.__name__}` is not there") from None
        if not isinstance(tree, ast.FunctionDef):
            raise UnknownError(f"`{function.__name__}` is no plain function")
        if any(name.startswith(("dot_", "_v", "_d")) for name in function.__code__.co_varnames):
            raise UnknownError(f"`{function.__name__}` has local names that begin with dot_, _v or _d")
        self.body = tree.body
        self.parameters = [argument.arg for argument in tree.args.args]
        if len(self.parameters) != len(kinds):
            raise UnknownError(f"`{function.__name__}` is called with {len(kinds)} of {len(self.parameters)} arguments")
        self.kinds = dict(zip(self.parameters, kinds, strict=True))
        self.scope = {**vars(builtins), **function.__globals__, **inspect.getclosurevars(function).nonlocals}
        self.active = {name for name, kind in self.kinds.items() if kind == ACTIVE}
        self.returns = False
        self.helpers: dict[str, Any] = {}
        self.lines: list[str] = []
        self.depth, self.count = 1, 0

    def emit(self, line: str) -> None:
        """One line at the present depth."""
        self.lines.append("    " * self.depth + line)

    def temporary(self, value: str, tangent: str | None) -> Dual:
        """Give a value and its tangent names."""
        self.count += 1
        self.emit(f"_v{self.count} = {value}")
        if tangent is None:
            return f"_v{self.count}", None
        self.emit(f"_d{self.count} = {tangent}")
        return f"_v{self.count}", f"_d{self.count}"

    def unknown(self, node: ast.AST, why: str = "is not understood") -> UnknownError:
        """The reason, with its place."""
        line = self.function.__code__.co_firstlineno + getattr(node, "lineno", 1) - 1
        code = ast.unparse(node).partition("\n")[0]
        return UnknownError(f"`{code}` ({self.function.__name__}, line {line}) {why}")

    def touches(self, node: ast.AST) -> bool:
        """Whether an expression reads anything that has a tangent."""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and self.is_record(node.value):
            return node.attr in self.library.reals
        if isinstance(node, ast.Name):
            return node.id in self.active or self.is_record(node)
        return any(self.touches(child) for child in ast.iter_child_nodes(node))

    def is_record(self, node: ast.AST) -> bool:
        """Whether a name stands for the component."""
        return isinstance(node, ast.Name) and self.kinds.get(node.id) == RECORD

    def place(self, node: ast.AST) -> str | None:
        """Where the tangent of a variable or element is; None if it has none."""
        if isinstance(node, ast.Name):
            return dot(node.id) if node.id in self.active else None
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and self.is_record(node.value):
            if node.attr.startswith("_"):
                raise self.unknown(node, "is the engine's own")
            return f"{dot(node.value.id)}.{node.attr}" if node.attr in self.library.reals else None
        if isinstance(node, ast.Subscript):
            base = self.place(node.value)
            return None if base is None else f"{base}[{ast.unparse(node.slice)}]"
        return None

    def dual(self, node: ast.expr) -> Dual:
        """Value and tangent of an expression; lines before it compute what they need."""
        if not self.touches(node):
            if isinstance(node, ast.Name | ast.Constant | ast.Attribute):
                return ast.unparse(node), None
            return f"({ast.unparse(node)})", None
        known = getattr(self, f"_dual_{type(node).__name__.lower()}", None)
        if known is None:
            raise self.unknown(node)
        result: Dual = known(node)
        return result

    def _dual_name(self, node: ast.expr) -> Dual:
        return ast.unparse(node), self.place(node)

    _dual_attribute = _dual_subscript = _dual_name

    def _dual_compare(self, node: ast.expr) -> Dual:
        return f"({ast.unparse(node)})", None

    def _dual_boolop(self, node: ast.BoolOp) -> Dual:
        if any(self.dual(value)[1] is not None for value in node.values):
            raise self.unknown(node, "is a number made by `and` or `or`")
        return f"({ast.unparse(node)})", None

    def _dual_tuple(self, node: ast.Tuple) -> Dual:
        parts = [self.temporary(*self.dual(element)) for element in node.elts]
        if all(tangent is None for _, tangent in parts):
            return f"({', '.join(value for value, _ in parts)},)", None
        return f"({', '.join(v for v, _ in parts)},)", f"({', '.join(d or ZERO for _, d in parts)},)"

    def _dual_unaryop(self, node: ast.UnaryOp) -> Dual:
        value, tangent = self.dual(node.operand)
        if isinstance(node.op, ast.Not) or tangent is None:
            return f"({ast.unparse(node)})", None
        sign = "-" if isinstance(node.op, ast.USub) else "+"
        return self.temporary(f"{sign}{value}", f"{sign}{tangent}")

    def _dual_binop(self, node: ast.BinOp) -> Dual:
        a, b = (self.named(self.dual(operand), operand) for operand in (node.left, node.right))
        symbol = slopes.OPERATORS.get(type(node.op))
        if symbol is None:
            raise self.unknown(node)
        value = f"{a[0]} {symbol} {b[0]}"
        if a[1] is None and b[1] is None:
            return self.temporary(value, None)
        self.count += 1
        name = f"_v{self.count}"
        self.emit(f"{name} = {value}")
        return name, self.temporary_tangent(slopes.BINARY[symbol], name, a, b)

    def named(self, dual: Dual, node: ast.AST) -> Dual:
        """A value that may be written twice."""
        if isinstance(node, ast.Name | ast.Constant) or dual[0].startswith("_v"):
            return dual
        return self.temporary(dual[0], dual[1])

    def temporary_tangent(self, rules: tuple[str, str], value: str, a: Dual, b: Dual) -> str | None:
        """Sum of what both operands contribute."""
        terms = [
            rule.format(v=value, a=a[0], b=b[0], d=tangent)
            for rule, tangent in zip(rules, (a[1], b[1]), strict=True)
            if tangent is not None and rule
        ]
        if not terms:
            return None
        self.emit(f"_d{self.count} = {' + '.join(terms)}")
        return f"_d{self.count}"

    def _dual_ifexp(self, node: ast.IfExp) -> Dual:
        if not (self.touches(node.body) or self.touches(node.orelse)):
            return f"({ast.unparse(node)})", None
        self.count += 1
        number = self.count
        for head, arm in ((f"if {ast.unparse(node.test)}:", node.body), ("else:", node.orelse)):
            self.emit(head)
            self.depth += 1
            value, tangent = self.dual(arm)
            self.emit(f"_v{number} = {value}")
            self.emit(f"_d{number} = {tangent or ZERO}")
            self.depth -= 1
        return f"_v{number}", f"_d{number}"

    # ----------------------------------------------------------------------------------------------------- calls

    def _dual_call(self, node: ast.Call) -> Dual:
        called = self.called(node.func)
        name = slopes.NAMES.get(called) if called.__hash__ else None
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.unknown(node, "is called with named arguments")
        if name in slopes.FLAT:
            return f"({ast.unparse(node)})", None
        if isinstance(called, FunctionType):
            return self._helper(node, called)
        if name in slopes.UNARY and len(node.args) == 1:
            a = self.named(self.dual(node.args[0]), node.args[0])
            value, _ = self.temporary(f"{ast.unparse(node.func)}({a[0]})", None)
            return value, self.temporary_tangent((slopes.UNARY[name], ""), value, a, ("", None))
        if name in slopes.BINARY and len(node.args) >= 2:
            return self._fold(node, slopes.BINARY[name])
        raise self.unknown(node, "has no rule")

    def _fold(self, node: ast.Call, rules: tuple[str, str]) -> Dual:
        """A function of two, or min and max of more, from left to right."""
        function = ast.unparse(node.func)
        result, *others = [self.named(self.dual(argument), argument) for argument in node.args]
        for other in others:
            value, _ = self.temporary(f"{function}({result[0]}, {other[0]})", None)
            result = value, self.temporary_tangent(rules, value, result, other)
        return result

    def called(self, node: ast.expr) -> Any:
        """The function that a call reaches."""
        if isinstance(node, ast.Name):
            return self.scope.get(node.id)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = self.scope.get(node.value.id)
            if isinstance(module, ModuleType):
                return getattr(module, node.attr, None)
        return None

    def _helper(self, node: ast.Call, called: FunctionType) -> Dual:
        text, returns = self.helper_call(node, called)
        self.count += 1
        number = self.count
        result = f"_v{number}, _d{number}" if returns else f"_v{number}"
        self.emit(f"{result} = {text}")
        return f"_v{number}", f"_d{number}" if returns else None

    def helper_call(self, node: ast.Call, called: FunctionType) -> tuple[str, bool]:
        """The call of a rewritten function, and whether it returns (value, tangent)."""
        values, tangents, kinds = [], [], []
        for argument in node.args:
            is_record = self.is_record(argument)
            value, tangent = (ast.unparse(argument), dot(ast.unparse(argument))) if is_record else self.dual(argument)
            values.append(value)
            tangents += [tangent] if tangent is not None else []
            kinds.append(RECORD if is_record else PLAIN if tangent is None else ACTIVE)
        function, returns = self.library.rewrite(called, tuple(kinds))
        name = f"_{called.__name__}_{'_'.join(kinds)}"
        self.helpers[name] = function
        return f"{name}({', '.join([*values, *tangents])})", returns


def dot(name: str) -> str:
    """Name of a value's tangent."""
    return f"dot_{name}"
