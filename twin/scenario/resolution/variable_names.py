"""Lookup of `member.variable`, `member.variable[1]` or a pattern with `*` in the members' variables."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from twin import errors
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.coupling import Catalog, MemberVariable

    Variables = Mapping[str, MemberVariable]  # of one member

ELEMENT = re.compile(r"(.+?)\[(\d+(?:\s*,\s*\d+)*)\]")


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return the hint of `errors.nearest` after a space; "" without candidates."""
    names = list(candidates)
    return f" {errors.nearest(name, names, '`')}" if names else ""


def inside(index: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    """Whether an index, counted from 1, is within a shape."""
    return len(index) == len(shape) and all(1 <= i <= n for i, n in zip(index, shape, strict=True))


def no_element(name: str, index: tuple[int, ...], variable: MemberVariable) -> str:
    """Return the message for an array element that does not exist."""
    index_text = f"[{','.join(map(str, index))}]"
    if not variable.shape:
        return f"{name} is a single value: it has no element {index_text}. Leave the brackets out."
    return f"{name} has no element {index_text}: its size is {' x '.join(map(str, variable.shape))}, counted from 1."


def find(reference: str, catalog: Catalog) -> tuple[MemberVariable, tuple[int, ...]]:
    """Find a variable or element: (variable, index from 1). An element has shape (); CouplingError if it does not exist."""
    member, _, name = reference.partition(".")
    if member not in catalog:
        raise CouplingError(f"there is no member `{member}` for {reference}.{nearest(member, catalog)}")
    variables = catalog[member]
    if name in variables:
        return variables[name], ()
    match = ELEMENT.fullmatch(name)
    if not match or match[1] not in variables:
        hint = nearest(match[1] if match else name, variables)
        raise CouplingError(f"{member} has no variable `{name}`.{hint}")
    variable, index = variables[match[1]], tuple(int(part) for part in match[2].split(","))
    if not inside(index, variable.shape):
        raise CouplingError(no_element(f"{member}.{match[1]}", index, variable))
    return replace(variable, shape=()), index


def matching(catalog: Catalog, *patterns: str) -> list[str]:
    """Return the recordable variables except parameters that match patterns with `*`."""
    if not patterns:
        return []
    expression = re.compile("|".join(".*".join(map(re.escape, pattern.split("*"))) for pattern in patterns))
    return [
        path
        for member, variables in catalog.items()
        for name, variable in variables.items()
        if expression.fullmatch(path := f"{member}.{name}")
        and variable.connectable
        and not variable.causality.endswith(("arameter", "independent"))
    ]
