"""Analysis of integers that are never negative: other indices count from the end and need an extra line of C."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from twin.compiler.infer import Inference, NotStaticError, Program, TypedFunction, is_range
from twin.compiler.syntax_tree import walk

if TYPE_CHECKING:
    from twin.compiler.resolve import FunctionSource


class NonnegativeAnalysis:
    """The local numbers of one function that are never negative, given what its callers pass."""

    def __init__(self, program: Program, function: TypedFunction) -> None:
        self.function: TypedFunction = function
        self.source: FunctionSource = function.source
        self.inference = Inference(program, function)
        self.nonnegative: set[str] = set()
        self.nonnegative = self._nonnegative_names()

    def _nonnegative_names(self) -> set[str]:
        """Local whole numbers that are never negative: all they are set to is not, given that the others are not."""
        values: dict[str, list[ast.expr | None]] = {}
        for node in walk(self.source.tree):
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    if isinstance(target, ast.Name):
                        values.setdefault(target.id, []).append(node.value)
                    elif isinstance(target, ast.Tuple):
                        inner = node.value.elts if isinstance(node.value, ast.Tuple) else [None] * len(target.elts)
                        for element, value in zip(target.elts, inner, strict=False):
                            if isinstance(element, ast.Name):
                                values.setdefault(element.id, []).append(value)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                values.setdefault(node.target.id, []).append(node.value)
            elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
                made = ast.copy_location(ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value), node)
                values.setdefault(node.target.id, []).append(made)
            elif isinstance(node, ast.For) and isinstance(node.target, ast.Name):
                values.setdefault(node.target.id, []).append(node.iter if is_range(node.iter, self.source) else None)
            elif isinstance(node, ast.For):
                values.update({name: [None] for name in names_of(node.target)})
        given = self.function.nonnegative
        names = {name for name in values if name not in self.source.parameters or name in given} | given
        while True:
            self.nonnegative = names
            remaining = {
                name for name in names if all(v is not None and self.is_nonnegative(v) for v in values.get(name, ()))
            }
            if remaining == names:
                return names
            names = remaining

    def propagate_to_callees(self) -> None:
        """Remove arguments that may be negative from the nonnegative sets of the functions called here."""
        for node in walk(self.source.tree):
            called = self.function.calls.get(id(node))
            if isinstance(called, TypedFunction):
                for name, argument in zip(called.source.parameters, self.function.bound[id(node)], strict=True):
                    sure = (
                        self.is_nonnegative(argument)
                        if isinstance(argument, ast.expr)
                        else isinstance(argument, int) and argument >= 0
                    )
                    if not sure:
                        called.nonnegative.discard(name)

    def is_nonnegative(self, node: ast.expr) -> bool:
        """Return whether an integer is provably not negative."""
        try:
            return bool(self.inference.static(node) >= 0)
        except (NotStaticError, TypeError):
            pass
        if isinstance(node, ast.Name):
            return node.id in self.nonnegative
        if isinstance(node, ast.BinOp):
            both = self.is_nonnegative(node.left) and self.is_nonnegative(node.right)
            if isinstance(node.op, ast.Mod):
                return self.is_nonnegative(node.right)
            if isinstance(node.op, ast.BitAnd):
                return self.is_nonnegative(node.left) or self.is_nonnegative(node.right)
            return both and isinstance(node.op, ast.Add | ast.Mult | ast.FloorDiv | ast.RShift)
        if isinstance(node, ast.IfExp):
            return self.is_nonnegative(node.body) and self.is_nonnegative(node.orelse)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            inner = [self.is_nonnegative(argument) for argument in node.args]
            if node.func.id == "range":
                low = inner[0] if len(inner) > 1 else True
                return low and (len(inner) < 3 or self._stops_at_zero(node))
            return any(inner) if node.func.id == "max" else all(inner) if node.func.id in ("min", "abs") else False
        return False

    def _stops_at_zero(self, node: ast.Call) -> bool:
        """Whether a range with a step stays at or above 0, even if the step is negative."""
        try:
            return bool(self.inference.static(node.args[1]) >= -1)
        except NotStaticError:
            return False


def names_of(node: ast.AST) -> set[str]:
    """All names in a target."""
    return {n.id for n in walk(node) if isinstance(n, ast.Name)}
