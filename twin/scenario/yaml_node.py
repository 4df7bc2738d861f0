"""A tree of values that know where they stand, so that an error can give file and line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Where something stands; `line` counts from 1, and 0 means the whole of `file` (an option, say)."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


@dataclass(frozen=True, slots=True)
class Node:
    """A value and its place: a scalar, a list of nodes or a dict of nodes. For a dict's value, the place of its key."""

    value: Any
    place: SourceLocation

    @classmethod
    def of(cls, value: Any, location: SourceLocation) -> Node:
        """The tree of plain dicts, lists and values that all stand in one place."""
        if isinstance(value, dict):
            return cls({key: cls.of(item, location) for key, item in value.items()}, location)
        return cls([cls.of(item, location) for item in value] if isinstance(value, list) else value, location)

    @property
    def entries(self) -> dict[str, Node]:
        """The dict's entries; none if this is not a dict."""
        return self.value if isinstance(self.value, dict) else {}

    @property
    def items(self) -> list[Node]:
        """The list's items; none if this is not a list."""
        return self.value if isinstance(self.value, list) else []

    def plain(self) -> Any:
        """The value without places."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def find(self, path: tuple[str | int, ...]) -> Node:
        """The node at a path, or the deepest one on the way to it."""
        node = self
        for step in path:
            if isinstance(step, int) and 0 <= step < len(node.items):
                node = node.items[step]
            elif isinstance(step, str) and step in node.entries:
                node = node.entries[step]
            else:
                break
        return node
