"""The record of one function: what it writes, and what it reads for it."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

LOCAL, RESULT = "local:", "local:return"


@dataclass(slots=True)
class Flows:
    """`edges` from what is written to what is read for it; `mutated`, names written in place.

    Nodes are variables by name, and local names of the function as `local:name`.
    """

    edges: dict[str, set[str]] = field(default_factory=dict)
    mutated: set[str] = field(default_factory=set)
    aliases: list[tuple[str, str]] = field(default_factory=list)  # a name, and the array it stands for
    condition: frozenset[str] = frozenset()  # what it hangs on whether the present statement is reached
    escape: set[str] = field(default_factory=set)  # conditions under which the function is left early

    def write(self, name: str, sources: Collection[str]) -> None:
        """Something is computed from sources."""
        self.edges.setdefault(name, set()).update(sources, self.condition)

    @contextmanager
    def under(self, condition: set[str]) -> Iterator[None]:
        """Statements that hang on one more condition."""
        before, self.condition = self.condition, self.condition | condition
        yield
        self.condition = before

    def leave(self) -> None:
        """What follows may not be reached."""
        self.escape |= self.condition

    def settle(self) -> None:
        """All is known. A name that stands for an array, and is written in place, writes the array.

        All that a function writes hangs on what it is left early for.
        """
        for _ in range(len(self.aliases) + 1):
            for name, base in self.aliases:
                if name in self.mutated:
                    self.mutated.add(base)
                    self.edges.setdefault(base, set()).add(name)
        for sources in self.edges.values():
            sources.update(self.escape)

    def within(self, function: str) -> Iterator[tuple[str, set[str]]]:
        """The edges, with local names qualified by their function."""
        for target, sources in self.edges.items():
            yield own(target, function), {own(source, function) for source in sources}


def own(name: str, function: str) -> str:
    """A node of a function as others name it; variables are the same for all."""
    return name.replace(LOCAL, f"{LOCAL}{function}:", 1)
