"""How far a study is, how long it will take, and an estimate before it begins."""

from __future__ import annotations

import math
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
SEARCHES = {"worst": "worst-case search: ", "tune": "tuning: ", "unseen": "tuning, unseen samples: "}  # by their part


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is: cases done and in all, cases per second, seconds left, the report so far, the folder.

    `failed`: cases that did not finish, `missed`: others that miss a requirement. `rate` and `left` are NaN until enough cases are done.
    `phase`: what is done before the first or after the last case, such as `building heart (1 of 8)`; else empty.
    """

    part: str
    done: int
    count: int
    failed: int
    rate: float
    left: float
    report: Path | None = None
    missed: int = 0
    phase: str = ""
    folder: Path | None = None


class ProgressReporter:
    """Counts rows and reports progress."""

    def __init__(self, journal: StudyJournal, count: int, listen: Callable[[StudyProgress], object]) -> None:
        self.journal, self.count, self.listen = journal, count, listen
        self.part = SAMPLED
        self.report: Path | None = None
        self.folder: Path | None = None  # of the study
        self.failed = self.missed = 0
        self.rate = self.left = float("nan")
        for row in journal.rows.values():
            self._count(row)
        self._times: deque[float] = deque(maxlen=LATEST)
        self._first = float("inf")

    def take(self, row: Row) -> None:
        """One more row."""
        self._times.append(time.perf_counter())
        self._count(row)
        self._first = min(self._first, self._times[-1])
        done, span = len(self.journal.rows), self._times[-1] - self._times[0]
        # the first cases of all processes come at once: their rate says nothing before another one could be done
        is_steady = len(self._times) >= LEAST and span > 0.0 and self._times[-1] - self._first >= row.seconds
        self.rate = (len(self._times) - 1) / span if is_steady else float("nan")
        self.left = max(self.count - done, 0) / self.rate
        self.update()

    def update_build(self, text: str, _: float) -> None:
        """Report `building (1 of 8) heart` from `building heart (1 of 8)`: a narrow terminal cuts the name."""
        name, bracket, count = text.removeprefix("building ").partition(" (")
        self.update(f"building{bracket}{count} {name}")

    def update(self, phase: str = "") -> None:
        """Report how far the study is."""
        numbers = (len(self.journal.rows), self.count, self.failed, self.rate, self.left)
        try:
            self.listen(StudyProgress(self.part, *numbers, self.report, self.missed, phase, self.folder))
        except BrokenPipeError:
            raise
        except OSError:  # a terminal that is closed, or a full disk: the cases are what counts
            pass

    def _count(self, row: Row) -> None:
        is_lost = row.status != DONE
        self.failed += is_lost
        self.missed += not is_lost and False in row.holds


def progress_text(progress: StudyProgress) -> str:
    """Return `713 of 4000 cases, 6 min left; 14 fail a requirement, 2 did not finish`, with the name of a search before it."""
    if progress.phase:
        return f"{progress.done} of {progress.count} cases; {progress.phase}"
    text = f"{SEARCHES.get(progress.part.partition(' ')[0], '')}{progress.done} of {progress.count} cases"
    if progress.done < progress.count and math.isfinite(progress.left):
        text += f", {duration_text(progress.left)} left"
    text += f"; {progress.missed} fail{'s' * (progress.missed == 1)} a requirement"
    return text + f", {progress.failed} did not finish" * bool(progress.failed)


def duration_text(seconds: float) -> str:
    """Return `89 s`, `12 min` or `2.5 h`."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


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
