"""What an expression reads."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from types import FunctionType

from twin.compiler.dependencies.flows import LOCAL, RESULT, own
from twin.compiler.resolve import FunctionSource
from twin.compiler.syntax_tree import walk


class UnsureError(Exception):
    """The source cannot be followed."""


@dataclass(frozen=True, slots=True)
class DependencyReader:
    """Expressions of one function."""

    source: FunctionSource
    me: str | None  # the argument that is the component
    arrays: Mapping[str, bool]  # whether a variable is an array

    def name(self, node: ast.AST) -> str | None:
        """The variable or local name at the bottom of `a`, `self.a`, `a[i][j]`."""
        while isinstance(node, ast.Subscript | ast.Starred):
            node = node.value
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == self.me:
            return node.attr
        if isinstance(node, ast.Name):
            if node.id == self.me:
                raise UnsureError
            return f"{LOCAL}{node.id}"
        return None

    def array(self, node: ast.AST) -> str | None:
        """The same, if it may be an array."""
        name = self.name(node)
        return name if name and (name.startswith(LOCAL) or self.arrays.get(name, True)) else None

    def reads(self, node: ast.AST) -> set[str]:
        """All variables and local names in an expression, and results of helpers that get the component."""
        names: set[str | None] = set()
        owners: set[int] = set()
        for part in walk(node):  # what contains a name comes before it
            if isinstance(part, ast.Call) and (index := self.component_index(part)) is not None:
                owners.add(id(part.args[index]))
                names.add(own(RESULT, self.helper(part).__name__))
            elif isinstance(part, ast.Attribute):
                owners.add(id(part.value))
                names.add(self.name(part))
            elif isinstance(part, ast.Name) and id(part) not in owners:
                names.add(self.name(part))
        return {name for name in names if name}

    def component_index(self, call: ast.Call) -> int | None:
        """Return the index of the argument that is the component itself, as in `publish(self)`; None if there is none."""
        indices = [
            i for i, argument in enumerate(call.args) if isinstance(argument, ast.Name) and argument.id == self.me
        ]
        return indices[0] if indices else None

    def helper(self, call: ast.Call) -> FunctionType:
        """The function of the component's module that is called by its name."""
        scope = self.source.function.__globals__
        helper = scope.get(call.func.id) if isinstance(call.func, ast.Name) else None
        if not isinstance(helper, FunctionType) or call.keywords:
            raise UnsureError
        return helper
