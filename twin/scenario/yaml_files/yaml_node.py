"""Tree of values with source locations, so that an error can give file and line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Location in a file. `line` counts from 1; 0 means the entire file, or an option."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


@dataclass(frozen=True, slots=True)
class Node:
    """A value and its location: a scalar, a list of nodes or a dict of nodes. The value of a key has the key's location."""

    value: Any
    location: SourceLocation

    @classmethod
    def of(cls, value: Any, location: SourceLocation) -> Node:
        """Create a tree of plain dicts, lists and values, all at one location."""
        if isinstance(value, dict):
            return cls({key: cls.of(item, location) for key, item in value.items()}, location)
        return cls([cls.of(item, location) for item in value] if isinstance(value, list) else value, location)

    @property
    def entries(self) -> dict[str, Node]:
        """Entries of the dict; empty if this is not a dict."""
        return self.value if isinstance(self.value, dict) else {}

    @property
    def items(self) -> list[Node]:
        """Items of the list; empty if this is not a list."""
        return self.value if isinstance(self.value, list) else []

    def get(self, key: str) -> Node:
        """Return the entry of a key; if there is none, a node without a value at this location."""
        return self.entries.get(key) or Node(None, self.location)

    def __or__(self, entries: Mapping[str, Node]) -> Node:
        """Return the dict with other entries added, or in place of its own."""
        return Node({**self.entries, **entries}, self.location)

    def only(self, keys: Collection[str]) -> Node:
        """Return the dict with only the entries of `keys`."""
        return Node({key: node for key, node in self.entries.items() if key in keys}, self.location)

    def without(self, *keys: str) -> Node:
        """Return the dict without the entries of `keys`."""
        return self.only(self.entries.keys() - set(keys))

    def under(self, *keys: str) -> Node:
        """Return a dict with this node at a path of keys, all at its location."""
        node = self
        for key in reversed(keys):
            node = Node({key: node}, self.location)
        return node

    def map(self, convert: Callable[[Node], Node | None]) -> Node:
        """Return the dict or list with each entry converted, without those that become None; a scalar is unchanged."""
        if isinstance(self.value, dict):
            pairs = [(key, convert(node)) for key, node in self.value.items()]
            return Node({key: node for key, node in pairs if node is not None}, self.location)
        if isinstance(self.value, list):
            return Node([node for item in self.value if (node := convert(item)) is not None], self.location)
        return self

    def plain(self) -> Any:
        """Return the value without locations."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def find(self, path: tuple[str | int, ...]) -> Node:
        """Return the node at a path, or its deepest existing ancestor."""
        node = self
        for step in path:
            if isinstance(step, int) and 0 <= step < len(node.items):
                node = node.items[step]
            elif isinstance(step, str) and step in node.entries:
                node = node.entries[step]
            else:
                break
        return node
