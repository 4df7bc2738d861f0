"""Cached walk over syntax trees, which do not change once they are parsed."""

from __future__ import annotations

import ast


def walk(node: ast.AST) -> tuple[ast.AST, ...]:
    """Return the nodes of `ast.walk`, in its order, as a cached tuple: the translator visits the same statements dozens of times."""
    walked: tuple[ast.AST, ...] | None = node.__dict__.get("_walked")
    if walked is None:
        nodes = [node]
        for parent in nodes:  # grows
            for name in parent._fields:
                child = getattr(parent, name, None)
                if isinstance(child, ast.AST):
                    nodes.append(child)
                elif isinstance(child, list):
                    nodes += [item for item in child if isinstance(item, ast.AST)]
        walked = node._walked = tuple(nodes)  # type: ignore[attr-defined]
    return walked
