"""Cached walk over syntax trees, which do not change once they are parsed."""

from __future__ import annotations

import ast


def walk(node: ast.AST) -> tuple[ast.AST, ...]:
    """Return the nodes of `ast.walk` as a cached tuple: the translator visits the same statements dozens of times."""
    nodes: tuple[ast.AST, ...] | None = node.__dict__.get("_walked")
    if nodes is None:
        nodes = node._walked = tuple(ast.walk(node))  # type: ignore[attr-defined]
    return nodes
