"""What is due when: integer nanoseconds, in the order of time and then of making, so that every run is the same."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

NEVER = 2**63 - 1  # a time [ns] that does not come
MILLISECOND = 1_000_000  # [ns]


class Agenda:
    """A queue of actions by time [ns]."""

    def __init__(self) -> None:
        self.now = 0
        self._count = 0
        self._queue: list[tuple[int, int, Callable[[], None]]] = []

    def at(self, time: int, action: Callable[[], None]) -> None:
        """Do `action` at this time, or as soon as possible if it has passed."""
        self._count += 1
        heapq.heappush(self._queue, (max(self.now, time), self._count, action))

    def next_time(self) -> int:
        """When the next action is due [ns]."""
        return self._queue[0][0] if self._queue else NEVER

    def advance(self, time: int) -> None:
        """Do everything that is due until `time`, including it."""
        queue = self._queue
        while queue and queue[0][0] <= time:
            self.now, _, action = heapq.heappop(queue)
            action()
        self.now = max(self.now, time)


class Timer:
    """One action that can be started, restarted and stopped."""

    def __init__(self, agenda: Agenda, action: Callable[[], None]) -> None:
        self._agenda = agenda
        self._action = action
        self._run = 0
        self.running = False

    def start(self, delay: int) -> None:
        """Do the action `delay` [ns] from now; an earlier start is forgotten."""
        self.stop()
        self.running = True
        run = self._run
        self._agenda.at(self._agenda.now + delay, lambda: self._fire(run))

    def stop(self) -> None:
        """Forget what was started."""
        self._run += 1
        self.running = False

    def _fire(self, run: int) -> None:
        if run == self._run:
            self.running = False
            self._action()
