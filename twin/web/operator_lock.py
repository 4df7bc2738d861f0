"""Who operates: the first who comes; others watch, until the operator hands over or leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class OperatorLock:
    """One operator at a time; clients have names that nobody else knows. A seat that is left is taken by who asks, or comes.

    `present`: what each is called on the pages, in the order in which they came.
    """

    operator: str | None = None
    present: dict[str, str] = field(default_factory=dict)
    changed: list[Callable[[], object]] = field(default_factory=list)
    _count: int = 0

    def enter(self, client: str) -> None:
        """A page is there. It operates if nobody does."""
        if client not in self.present:
            self._count += 1
            self.present[client] = f"page {self._count}"
        if self.operator is None:
            self.operator = client
        self._tell()

    def leave(self, client: str) -> None:
        """A page is gone."""
        self.present.pop(client, None)
        if client == self.operator:
            self.operator = None
        self._tell()

    def is_operator(self, client: str) -> bool:
        """Whether a client operates."""
        return client == self.operator

    def give(self, giver: str, taker: str) -> bool:
        """The operator hands over to a page that is there; whether that was done."""
        done = self.is_operator(giver) and taker in self.present
        if done:
            self.operator = taker
            self._tell()
        return done

    def take(self, client: str) -> bool:
        """Operate where nobody does; whether that was done."""
        done = client in self.present and self.operator is None
        if done:
            self.operator = client
            self._tell()
        return done

    def _tell(self) -> None:
        for one in self.changed:
            one()
