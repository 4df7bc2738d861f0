"""Simulated time beside the wall clock: when the next block is due, and how long it may be."""

from __future__ import annotations

from collections import deque
from math import inf

BLOCK = 1.0 / 30.0  # wall-clock length of a block [s]: a frame of the page
SLOWEST, FASTEST = 0.1, 10.0  # times real time
MAX_CATCH_UP = 0.25  # how late the loop may be and still catch up [s]; what is more is not made good
SECOND = 1.0  # over which the achieved rate is told [s]
DELAY_COUNT = 300  # blocks whose lateness is kept: ten seconds
GROWTH = 4  # of a block beside the one before, where nothing else is known


class Pace:
    """Times are those of a clock that only rises [s]; `rate`: simulated over wall-clock time, inf: as fast as possible."""

    def __init__(self, rate: float, step: float) -> None:
        self.rate, self.step = rate, step
        self._cost = 0.0  # wall-clock time of a communication step [s]
        self._count = 1  # communication steps of the last block
        self._origin = (0.0, 0.0)  # wall clock, simulated [s]
        self._passed: deque[tuple[float, float]] = deque()
        self.delays: deque[float] = deque(maxlen=DELAY_COUNT)
        self.lag = 0.0

    def begin(self, now: float, time: float) -> None:
        """From here on: the loop starts to go, or its rate changes."""
        self._origin = now, time
        self._passed.clear()
        self.delays.clear()
        self.lag = 0.0

    def due(self, time: float) -> float:
        """When the block from a simulated time [s] is due."""
        return self._origin[0] + (time - self._origin[1]) / self.rate

    def count(self) -> int:
        """Communication steps of the next block: a frame's worth, as far as they can be computed in one."""
        wanted = max(1, round(self.rate * BLOCK / self.step)) if self.rate < inf else GROWTH * self._count
        possible = max(1, int(BLOCK / self._cost)) if self._cost else GROWTH * self._count
        return min(wanted, possible)

    def record_block(self, begin: float, now: float, before: float, time: float, count: int) -> None:
        """A block went from one simulated time to another, in this wall-clock time."""
        self._count = max(1, count)
        self._cost = (now - begin) / self._count
        if self.rate < inf:
            delay = begin - self.due(before)
            self.delays.append(delay)
            self.lag = max(delay, 0.0)
            if delay > MAX_CATCH_UP:
                self._origin = self._origin[0] + delay, self._origin[1]
        self._passed.append((now, time))
        while len(self._passed) > 2 and now - self._passed[0][0] > SECOND:
            self._passed.popleft()

    @property
    def achieved(self) -> float:
        """Simulated over wall-clock time, over the last second."""
        if len(self._passed) < 2:
            return 0.0
        (begin, before), (end, time) = self._passed[0], self._passed[-1]
        return (time - before) / (end - begin) if end > begin else 0.0

    @property
    def jitter(self) -> float:
        """How far 99 of 100 blocks began from their time at most [s]."""
        delays = sorted(abs(one) for one in self.delays)
        return delays[min(len(delays) - 1, int(0.99 * len(delays)))] if delays else 0.0
