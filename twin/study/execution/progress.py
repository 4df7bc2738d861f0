"""How far a study is, how long it will take, and an estimate before it begins."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.study.design import SAMPLED
from twin.study.execution.case_engine import DONE, Row

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from twin.study.execution.journal import StudyJournal

LATEST = 50  # cases by which the rate is measured: earlier ones include the start of processes, or are of another part
LEAST = 3  # cases before a rate is given


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is: cases done and in all, those that failed, cases per second, seconds left, the report so far.

    `rate` and `left` are NaN until enough cases are done.
    """

    part: str
    done: int
    count: int
    failed: int
    rate: float
    left: float
    report: Path | None = None


class ProgressReporter:
    """Counts rows and reports progress."""

    def __init__(self, journal: StudyJournal, count: int, listen: Callable[[StudyProgress], object]) -> None:
        self.journal, self.count, self.listen = journal, count, listen
        self.part = SAMPLED
        self.report: Path | None = None
        self.failed = sum(row.status != DONE for row in journal.rows.values())
        self._times: deque[float] = deque(maxlen=LATEST)
        self._first = float("inf")

    def take(self, row: Row) -> None:
        """One more row."""
        self._times.append(time.perf_counter())
        self.failed += row.status != DONE
        self._first = min(self._first, self._times[-1])
        done, span = len(self.journal.rows), self._times[-1] - self._times[0]
        # the first cases of all processes come at once: their rate says nothing before another one could be done
        is_steady = len(self._times) >= LEAST and span > 0.0 and self._times[-1] - self._first >= row.seconds
        rate = (len(self._times) - 1) / span if is_steady else float("nan")
        left = max(self.count - done, 0) / rate
        try:
            self.listen(StudyProgress(self.part, done, self.count, self.failed, rate, left, self.report))
        except BrokenPipeError:
            raise
        except OSError:  # a terminal that is closed, or a full disk: the cases are what counts
            pass


@dataclass(frozen=True)
class TimeEstimate:
    """Cases of each variant, time of a case and of the preparation [s], processes; why cases that were run did not finish."""

    counts: dict[str, int]
    seconds: dict[str, float]
    preparation: float
    workers: int
    failures: tuple[str, ...] = ()

    @property
    def total(self) -> float:
        """Time of the study [s] without its report."""
        busy = sum(count * self.seconds[variant] for variant, count in self.counts.items())
        return self.preparation + busy / self.workers
