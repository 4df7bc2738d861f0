"""State of a function being differentiated: the names and targets that carry a tangent, and the new lines."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

from twin.compiler.resolve import FunctionSource

RECORD, ACTIVE, PLAIN = "record", "active", "plain"  # kinds of argument: has tangents, has a tangent, has none
ZERO = "0.0"

Dual = tuple[str, str | None]  # source text of a value and of its tangent; None: surely zero

# a function with tangents for arguments of these kinds, and whether it returns (value, tangent)
Rewrite = Callable[[FunctionType, tuple[str, ...]], tuple[Any, bool]]


class UnknownError(Exception):
    """Source that cannot be followed, and why."""


@dataclass(slots=True)
class GeneratedLines:
    """New lines, with names that are used once."""

    text: list[str] = field(default_factory=list)
    depth: int = 1
    count: int = 0

    def emit(self, line: str) -> None:
        """One line at the present depth."""
        self.text.append("    " * self.depth + line)

    @contextmanager
    def inside(self, head: str) -> Iterator[None]:
        """Lines below a head."""
        self.emit(head)
        self.depth += 1
        yield
        self.depth -= 1

    def fresh(self) -> tuple[str, str]:
        """Names for a value and its tangent."""
        self.count += 1
        return f"_v{self.count}", f"_d{self.count}"

    def temporary(self, value: str, tangent: str | None) -> Dual:
        """Give a value and its tangent names."""
        v, d = self.fresh()
        self.emit(f"{v} = {value}")
        if tangent is None:
            return v, None
        self.emit(f"{d} = {tangent}")
        return v, d


@dataclass(slots=True)
class TangentFunction(ast.NodeVisitor):
    """One function; `active`, `returns` and `helpers` grow while its lines are written."""

    source: FunctionSource
    kinds: dict[str, str]  # of its arguments
    reals: frozenset[str]  # the component's variables that have a tangent
    rewrite: Rewrite  # of functions it calls
    active: set[str]  # local names that have a tangent
    returns: bool = False  # whether it returns a tangent
    helpers: dict[str, Any] = field(default_factory=dict)  # rewritten functions by the names they are called by
    lines: GeneratedLines = field(default_factory=GeneratedLines)

    def is_record(self, node: ast.AST) -> bool:
        """Whether a name stands for the component."""
        return isinstance(node, ast.Name) and self.kinds.get(node.id) == RECORD

    def touches(self, node: ast.AST) -> bool:
        """Whether an expression reads anything that has a tangent."""
        if isinstance(node, ast.Attribute) and self.is_record(node.value):
            return node.attr in self.reals
        if isinstance(node, ast.Name):
            return node.id in self.active or self.is_record(node)
        return any(self.touches(child) for child in ast.iter_child_nodes(node))

    def tangent_of(self, node: ast.AST) -> str | None:
        """Return the expression of the tangent of a variable or element; None if it has none."""
        if isinstance(node, ast.Name):
            return dot(node) if node.id in self.active else None
        if isinstance(node, ast.Attribute) and self.is_record(node.value):
            if node.attr.startswith("_"):
                raise self.unknown(node, "is the engine's own")
            return f"{dot(node.value)}.{node.attr}" if node.attr in self.reals else None
        if isinstance(node, ast.Subscript):
            base = self.tangent_of(node.value)
            return None if base is None else f"{base}[{ast.unparse(node.slice)}]"
        return None

    def generic_visit(self, node: ast.AST) -> None:
        """Refuse a construct without a method."""
        raise self.unknown(node)

    def unknown(self, node: ast.AST, why: str = "is not understood") -> UnknownError:
        """Return an error with the reason and its location."""
        code = ast.unparse(node).partition("\n")[0]
        line = getattr(node, "lineno", self.source.tree.lineno)
        return UnknownError(f"`{code}` ({self.source.function.__name__}, line {line}) {why}")


def dot(name: ast.expr | str) -> str:
    """Name of a value's tangent."""
    return f"dot_{name if isinstance(name, str) else ast.unparse(name)}"
