"""Who operates: the first who comes; others watch, until the operator hands over or leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class OperatorLock:
    """One operator at a time; clients have names that nobody else knows. A seat that is left is taken by who asks, or comes.

    `pages`: what each is called on the pages, in the order in which they came.
    """

    operator: str | None = None
    pages: dict[str, str] = field(default_factory=dict)
    changed: list[Callable[[], object]] = field(default_factory=list)
    _count: int = 0

    def enter(self, client: str) -> None:
        """A page is there. It operates if nobody does."""
        if client not in self.pages:
            self._count += 1
            self.pages[client] = f"page {self._count}"
        if self.operator is None:
            self.operator = client
        self._notify()

    def leave(self, client: str) -> None:
        """A page is gone."""
        self.pages.pop(client, None)
        if client == self.operator:
            self.operator = None
        self._notify()

    def is_operator(self, client: str) -> bool:
        """Whether a client operates."""
        return client == self.operator

    def hand_over(self, giver: str, taker: str) -> bool:
        """The operator hands over to a page that is there; whether that was done."""
        done = self.is_operator(giver) and taker in self.pages
        if done:
            self.operator = taker
            self._notify()
        return done

    def acquire(self, client: str) -> bool:
        """Operate where nobody does; whether that was done."""
        done = client in self.pages and self.operator is None
        if done:
            self.operator = client
            self._notify()
        return done

    def _notify(self) -> None:
        for callback in self.changed:
            callback()
