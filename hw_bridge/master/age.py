"""Age of actual values: which SYNC the process data that came answer.

Process data do not say when they were sampled. As long as each SYNC is answered before the next, it is the last one. After
cycles without an answer either process data were lost, and the next come as long after their SYNC as before; or all come
later from then on. What comes later by whole cycles all at once cannot be told from a loss of one or two.
"""

from __future__ import annotations

from collections import deque

SURE = 3  # so many cycles without an answer are lateness until what is missing comes: three losses in a row are rare
LOOKS = 3  # answers in which the delay of before has to show again for a loss
ALIKE = 0.2  # of a cycle that the delay varies
KEPT = 256  # SYNCs that may be unanswered
NEVER_SAMPLED = -(10**18)


class ValueAge:
    """One PDO of a node. Times in ns. `sampled_at`: the SYNC of the last process data."""

    def __init__(self, cycle: int) -> None:
        self.alike = round(ALIKE * cycle)
        self.open: deque[int] = deque(maxlen=KEPT)  # SYNCs without an answer, the oldest first
        self.sampled_at, self.last = NEVER_SAMPLED, 0
        self._delay = self._before = 0  # of the last answer, and of the one before a gap
        self._behind = 0  # SYNCs that were open after the last answer
        self._looks = 0  # answers that may still show a loss

    def synced(self, time: int) -> None:
        """A SYNC was sent."""
        self.last = time
        self.open.append(time)

    def received(self, now: int) -> None:
        """Process data came. With nothing open they are those of a SYNC that was taken for lost."""
        unanswered = self.open
        if not unanswered:
            return
        if missing := len(unanswered) - 1 - self._behind:
            self._before, self._looks = self._delay, LOOKS if 0 < missing < SURE else 0
        if self._looks:
            self._looks -= 1
            if abs(now - unanswered[-1] - self._before) <= self.alike:
                self._looks = 0
                while len(unanswered) > 1:
                    unanswered.popleft()
        self.sampled_at = unanswered.popleft()
        self._delay, self._behind = now - self.sampled_at, len(unanswered)

    def forget(self) -> None:
        """A run begins: SYNCs of before are not waited for."""
        while len(self.open) > 1:
            self.open.popleft()
        self._behind = 0
