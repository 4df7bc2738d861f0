"""Pacing of the loop: start and length of the next block."""

from __future__ import annotations

from collections import deque
from math import inf
from typing import Any

from twin.live.recording_reader import RefusedError
from twin.scenario import short

BLOCK = 1.0 / 30.0  # wall-clock length of a block [s]: a frame of the page
SLOWEST, FASTEST = 0.1, 10.0  # times real time
MAX_CATCH_UP = 0.25  # longest delay that is caught up [s]; beyond it the schedule is shifted
SECOND = 1.0  # window of the achieved rate [s]
DELAY_COUNT = 300  # blocks whose delay is stored: ten seconds
GROWTH = 4  # factor between consecutive blocks before their computing time is known


def checked_rate(rate: Any, name: str = "pace") -> float:
    """Return a valid rate; raise RefusedError otherwise. `name`: of the command or argument."""
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not (SLOWEST <= rate <= FASTEST or rate == inf):
        raise RefusedError(
            f"{name}: {short(str(rate))} is not a rate. Use {SLOWEST:g} to {FASTEST:g}, or inf: as fast as possible."
        )
    return float(rate)


class Pace:
    """Schedule of the blocks on a monotonic clock [s]; `rate`: simulated over wall-clock time, inf: as fast as possible."""

    def __init__(self, rate: float, step: float) -> None:
        self.rate, self.step = rate, step
        self._cost = 0.0  # wall-clock time of a communication step [s]
        self._count = 1  # communication steps of the last block
        self._origin = (0.0, 0.0)  # wall clock, simulated [s]
        self._passed: deque[tuple[float, float]] = deque()
        self.delays: deque[float] = deque(maxlen=DELAY_COUNT)
        self.lag = 0.0

    def begin(self, now: float, time: float) -> None:
        """Restart the schedule at a simulated time: the loop starts, or its rate changes."""
        self._origin = now, time
        self._passed.clear()
        self.delays.clear()
        self.lag = 0.0

    def due(self, time: float) -> float:
        """Return the wall-clock time at which the block from a simulated time [s] starts."""
        return self._origin[0] + (time - self._origin[1]) / self.rate

    def count(self) -> int:
        """Return the communication steps of the next block: one frame, or fewer if their computation takes longer."""
        wanted = max(1, round(self.rate * BLOCK / self.step)) if self.rate < inf else GROWTH * self._count
        possible = max(1, int(BLOCK / self._cost)) if self._cost else GROWTH * self._count
        return min(wanted, possible)

    def record_block(self, begin: float, now: float, before: float, time: float, count: int) -> None:
        """Record a block: wall-clock begin and end, simulated begin and end, communication steps."""
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
        """99th percentile of the block starts' absolute errors [s]."""
        delays = sorted(abs(delay) for delay in self.delays)
        return delays[min(len(delays) - 1, int(0.99 * len(delays)))] if delays else 0.0
