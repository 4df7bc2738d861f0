"""Source text of a group: access paths of members' variables, and copies of connections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from twin.component import Component, Variable, functions
from twin.coupling.system import ResolvedConnection, is_real

Key = tuple[str, str]


@dataclass(frozen=True)
class GroupMember:
    """Member of a group: its component, start values that differ from the declaration, and its period [ns]."""

    component: type[Component]
    values: Mapping[str, Any]
    period: int


@dataclass(frozen=True, slots=True)
class Copy:
    """Statement of a group's source that copies a scalar, or each element of an array at its indices `i0`, `i1`, ..."""

    target: str
    value: str
    shape: tuple[int, ...] = ()

    @property
    def lines(self) -> list[str]:
        """The statement in its loops."""
        return self.loops(f"{self.target} = {self.value}")

    @property
    def tangent(self) -> list[str]:
        """The same for tangents, which have the record `dot`."""
        return [line.replace("self.", "dot.") for line in self.lines]

    def loops(self, *body: str) -> list[str]:
        """Statements for each element, in a function."""
        lines = [f"{'    ' * (i + 1)}for i{i} in range({size}):" for i, size in enumerate(self.shape)]
        return lines + [f"{'    ' * (len(lines) + 1)}{line}" for line in body]


class GroupWriter:
    """Generator of a group's source; collects the functions and hidden fields that it needs."""

    def __init__(self, parts: dict[str, GroupMember], links: list[ResolvedConnection], step: int) -> None:
        self.parts, self.links, self.step = parts, links, step
        self.shadows: dict[Key, str] = {}
        self.scope: dict[str, Any] = {}
        for name, part in parts.items():
            start, advance = functions(part.component)
            self.scope[f"initialize_{name}"], self.scope[f"advance_{name}"] = start, advance

    def divider(self, name: str) -> int:
        """Return the communication points per step of a member."""
        return self.parts[name].period // self.step

    def location(self, key: Key) -> str:
        """Return the access path of a variable in its member's record. A nested group has its own inputs in separate fields."""
        fields = getattr(self.parts[key[0]].component, "fields", {})
        is_single = key[1] in fields and not self.variable(key).shape
        return f"self.{key[0]}.{fields.get(key[1], key[1])}{'[0]' if is_single else ''}"

    def published(self, key: Key) -> str:
        """Return the path at which others read a variable: in the member's record, or a copy made when it is due."""
        if self.divider(key[0]) == 1:
            return self.location(key)
        shadow = f"self.{self.shadows.setdefault(key, f'_published{len(self.shadows)}')}"
        return shadow if self.variable(key).shape else f"{shadow}[0]"

    def variable(self, key: Key) -> Variable:
        """Return the variable of a member."""
        return next(v for v in self.parts[key[0]].component.variables if v.name == key[1])

    def copy(self, link: ResolvedConnection) -> list[Copy]:
        """Generate the statements that copy the values of a connection."""
        source, target = self.published(link.source.key), self.location(link.target.key)
        conversion = ""
        if (link.factor, link.offset) != (1.0, 0.0):
            conversion = f" * {link.factor!r} + {link.offset!r}"
        elif is_real(link.target.variable) and not is_real(link.source.variable):
            conversion = " * 1.0"
        shapes = link.source.variable.shape, link.target.variable.shape
        if shapes[0] == shapes[1] and link.source.element is None:
            return [Copy(each(target, shapes[1]), f"{each(source, shapes[0])}{conversion}", shapes[1])]
        return [
            Copy(
                subscript(target, shapes[1], link.target.first + i),
                f"{subscript(source, shapes[0], link.source.first + i)}{conversion}",
            )
            for i in range(link.source.size)
        ]


def each(location: str, shape: tuple[int, ...]) -> str:
    """Return the path of each scalar of a variable, in the loops of `Copy`."""
    return f"{location}[{', '.join(f'i{i}' for i in range(len(shape)))}]" if shape else location


def subscript(location: str, shape: tuple[int, ...], flat: int) -> str:
    """Return the path of one scalar of a variable."""
    index: list[str] = []
    for size in reversed(shape):
        flat, i = divmod(flat, size)
        index.insert(0, str(i))
    return f"{location}[{', '.join(index)}]" if index else location
