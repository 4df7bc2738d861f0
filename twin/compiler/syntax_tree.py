"""Syntax trees of functions, which do not change once they are parsed."""

from __future__ import annotations

import ast


def walk(node: ast.AST) -> tuple[ast.AST, ...]:
    """As `ast.walk`, looked for once: the translator goes over the same statements dozens of times."""
    nodes: tuple[ast.AST, ...] | None = node.__dict__.get("_walked")
    if nodes is None:
        nodes = node._walked = tuple(ast.walk(node))  # type: ignore[attr-defined]
    return nodes
