"""Event queue of simulated time: integer nanoseconds, ordered by time and then by insertion, so that every run is the same."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

NEVER = 2**63 - 1  # a time [ns] that does not come
MILLISECOND = 1_000_000  # [ns]


class EventQueue:
    """Queue of actions by time [ns]."""

    def __init__(self) -> None:
        self.now = 0
        self._count = 0
        self._queue: list[tuple[int, int, Callable[[], None]]] = []

    def at(self, time: int, action: Callable[[], None]) -> None:
        """Schedule `action` at this time, or as soon as possible if it has passed."""
        self._count += 1
        heapq.heappush(self._queue, (max(self.now, time), self._count, action))

    def next_time(self) -> int:
        """Time of the next action [ns]."""
        return self._queue[0][0] if self._queue else NEVER

    def advance(self, time: int) -> None:
        """Execute everything that is due until `time`, including it."""
        queue = self._queue
        while queue and queue[0][0] <= time:
            self.now, _, action = heapq.heappop(queue)
            action()
        self.now = max(self.now, time)


class Timer:
    """One action that can be started, restarted and stopped."""

    def __init__(self, event_queue: EventQueue, action: Callable[[], None]) -> None:
        self._event_queue = event_queue
        self._action = action
        self._run = 0
        self.running = False

    def start(self, delay: int) -> None:
        """Execute the action `delay` [ns] from now; an earlier start is canceled."""
        self.stop()
        self.running = True
        run = self._run
        self._event_queue.at(self._event_queue.now + delay, lambda: self._fire(run))

    def stop(self) -> None:
        """Cancel the action."""
        self._run += 1
        self.running = False

    def _fire(self, run: int) -> None:
        if run == self._run:
            self.running = False
            self._action()
