"""Operator of a session: the first page; the others watch until the operator hands over or leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

NOT_OPERATOR = "This page only watches: another page operates."
NO_OPERATOR = "No page operates. Press “operate here” at the top."


@dataclass
class OperatorLock:
    """One operator at a time; clients are identified by secret names. A free lock is given to the next page, or on request.

    `pages`: label of each client on the pages, in order of arrival.
    """

    operator: str | None = None
    pages: dict[str, str] = field(default_factory=dict)
    changed: list[Callable[[], object]] = field(default_factory=list)
    _count: int = 0

    def enter(self, client: str) -> None:
        """Add a page; it becomes operator if there is none."""
        if client not in self.pages:
            self._count += 1
            self.pages[client] = f"page {self._count}"
        if self.operator is None:
            self.operator = client
        self._notify()

    def leave(self, client: str) -> None:
        """Remove a page."""
        self.pages.pop(client, None)
        if client == self.operator:
            self.operator = None
        self._notify()

    def is_operator(self, client: str) -> bool:
        """Return whether a client is the operator."""
        return client == self.operator

    @property
    def watching(self) -> str:
        """Why a page that is not the operator's moves nothing, and what to do."""
        return NO_OPERATOR if self.operator is None else NOT_OPERATOR

    def hand_over(self, giver: str, taker: str) -> bool:
        """Make another page operator; return whether that was done."""
        done = self.is_operator(giver) and taker in self.pages
        if done:
            self.operator = taker
            self._notify()
        return done

    def acquire(self, client: str) -> bool:
        """Make a client operator if there is none; return whether that was done."""
        done = client in self.pages and self.operator is None
        if done:
            self.operator = client
            self._notify()
        return done

    def _notify(self) -> None:
        for callback in self.changed:
            callback()
