"""Age of actual values: which SYNC the received process data answer.

Process data carry no sampling time. As long as each SYNC is answered before the next, they answer the last one. After
cycles without an answer either process data were lost, and the next arrive with the same delay as before; or all are delayed
from then on. A single loss is detected by that delay. After several losses in a row the delay is ambiguous: then SYNC is sent
at uneven intervals for some cycles, and the delays of the answers identify the SYNC that they answer.
"""

from __future__ import annotations

from collections import deque

LOOKS = 3  # answers in which the delay of before has to show again for a loss
ALIKE = 0.2  # of a cycle that the delay varies
PATTERN = (
    1,
    0,
    0,
    1,
    1,
    0,
    1,
    0,
    0,
    0,
    1,
    1,
)  # of SYNCs that are sent later while it is in doubt which one is answered
SHIFT = 0.12  # of a cycle that they are later
HISTORY_LENGTH = 64  # SYNCs whose times are stored
NEVER_SAMPLED = -(10**18)
IMPOSSIBLE = 10**18  # change of a delay, where a SYNC that would be meant has not been sent yet


class ValueAge:
    """SYNC association of one PDO of a node. Times in ns. `sampled_at`: the earliest possible SYNC of the last process data."""

    def __init__(self, cycle: int) -> None:
        self.cycle = cycle
        self.sampled_at, self.last = NEVER_SAMPLED, 0
        self.in_doubt = False  # whether SYNC has to be uneven
        self._times: deque[int] = deque(maxlen=HISTORY_LENGTH)  # of SYNCs, the last one at the end
        self._total = self._next = 0  # SYNCs sent, and the number of the one that the next answer is taken for
        self._answered_at, self._unanswered = 0, 0  # when the last answer came, and SYNCs since then
        self._delay = self._before = 0  # of the last answer, and of the one before a gap
        self._looks = 0  # answers that may still show a loss
        self._first, self._answers = 0, 0  # the first SYNC that may be meant, and the answers since
        self._delays: list[int] = []  # of the last answer, after each SYNC that may be meant
        self._changes: list[int] = []  # how much each of them has changed

    def synced(self, time: int) -> None:
        """A SYNC was sent."""
        self.last = time
        self._times.append(time)
        self._total += 1
        self._unanswered += 1
        self._next = max(self._next, self._total - HISTORY_LENGTH)

    def received(self, now: int) -> None:
        """Associate received process data with a SYNC. With none open they answer one that was assumed lost."""
        if self._next >= self._total:
            return
        cycles, missing = round((now - self._answered_at) / self.cycle), self._unanswered - 1
        self._answered_at, self._unanswered = now, 0
        if missing > 1 or (self.in_doubt and cycles != 1):  # one more is missing, or some came together
            self._begin_comparison()
        elif missing == 1:
            self._before, self._looks = self._delay, LOOKS
        if self._looks:
            self._look(now)
        if self.in_doubt:
            self._compare(now)
        self.sampled_at = self._time(self._next)
        self._delay = now - self.sampled_at
        self._next += 1

    def _time(self, number: int) -> int:
        return self._times[number - self._total]

    def _look(self, now: int) -> None:
        """Check whether the previous delay recurs after the latest SYNC."""
        self._looks -= 1
        if abs(now - self.last - self._before) <= ALIKE * self.cycle:
            self._looks, self._next = 0, self._total - 1

    def _begin_comparison(self) -> None:
        self.in_doubt, self._looks = True, 0
        self._first, self._answers = self._next, 0
        self._delays, self._changes = [], [0] * (self._total - self._next)

    def _compare(self, now: int) -> None:
        """Accumulate the change of the delay to each candidate SYNC: it is constant for the right one."""
        delays = []
        for candidate in range(len(self._changes)):
            number = self._first + candidate + self._answers
            delays.append(now - self._time(number) if number < self._total else IMPOSSIBLE)
        if self._delays:
            changes = zip(self._changes, delays, self._delays, strict=True)
            self._changes = [change + abs(delay - before) for change, delay, before in changes]
        self._delays = delays
        if self._answers > len(PATTERN) + len(delays):
            self.in_doubt = False
            self._next = min(self._first + self._changes.index(min(self._changes)) + self._answers, self._total - 1)
        self._answers += 1

    def forget(self) -> None:
        """Discard SYNCs sent before a run begins."""
        self._next = max(self._next, self._total - 1)
        self._looks, self.in_doubt = 0, False
