"""How far a study is, how long it will take, and an estimate before it begins."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin.study.design import SAMPLED
from twin.study.execution.case_engine import DONE, Row

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from twin.study.design import Study
    from twin.study.execution.journal import StudyJournal

LATEST = 50  # cases by which the rate is measured: earlier ones include the start of processes, or are of another part
LEAST = 3  # cases before a rate is given
REPEAT_TIME, PLOT_TIME = 3.0, 0.1  # of a case that is kept, besides its simulation, and of a plot, about [s]
SEARCHES = {"worst": "worst-case search: ", "tune": "tuning: ", "unseen": "tuning, unseen samples: "}  # by their part


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is: cases done and in all, cases per second, seconds left to its end, the folder.

    `failed`: cases that did not finish, `missed`: others that miss a requirement. `rate` and `left` are NaN until enough cases are done.
    `phase`: what is done before the first or after the last case, such as `building heart (1 of 8)`; else empty.
    `fraction`: completed part of the time of the whole study: building, cases, those that are kept, plots.
    """

    part: str
    done: int
    count: int
    failed: int
    rate: float
    left: float
    missed: int = 0
    phase: str = ""
    folder: Path | None = None
    fraction: float = 0.0


class ProgressReporter:
    """Counts rows and reports progress. `finishing`: time after the last case [s], by cases that fail and the time of one."""

    def __init__(self, journal: StudyJournal, count: int, listen: Callable[[StudyProgress], object]) -> None:
        self.journal, self.count, self.listen = journal, count, listen
        self.finishing: Callable[[int, float], float] = lambda *_: 0.0
        self.part = SAMPLED
        self.begin, self.fraction = time.monotonic(), 0.0  # `end`: when the study ends, as estimated
        self.folder: Path | None = None  # of the study
        self.failed = self.missed = 0
        self.rate = self.end = float("nan")
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
        left = max(self.count - done, 0) / self.rate if done < self.count else 0.0
        self.end = time.monotonic() + left + self.finishing(self.failed + self.missed, row.seconds)
        self.update()

    def update_build(self, text: str, fraction: float) -> None:
        """Report `building (1 of 8) heart` from `building heart (1 of 8)`: a narrow terminal cuts the name."""
        self.fraction = 0.1 * fraction  # of the bar
        name, bracket, count = text.removeprefix("building ").partition(" (")
        self.update(f"building{bracket}{count} {name}")

    def update(self, phase: str = "") -> None:
        """Report how far the study is."""
        now = time.monotonic()
        left = float(np.maximum(self.end - now, 0.0))
        self.fraction = float(np.fmax(self.fraction, (now - self.begin) / (now - self.begin + left + 1e-9)))
        numbers = (len(self.journal.rows), self.count, self.failed, self.rate, left)
        try:
            self.listen(StudyProgress(self.part, *numbers, self.missed, phase, self.folder, self.fraction))
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
    left = f", {duration_text(progress.left)} left" * (math.isfinite(progress.left) and progress.left >= 0.5)
    if progress.phase:
        return f"{progress.done} of {progress.count} cases{left}; {progress.phase}"
    text = f"{SEARCHES.get(progress.part.partition(' ')[0], '')}{progress.done} of {progress.count} cases{left}"
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
    def cases(self) -> float:
        """Time of all cases [s]."""
        return sum(count * self.seconds[variant] for variant, count in self.counts.items()) / self.workers


def finishing_time(study: Study, failing: int, seconds: float) -> float:
    """Return about how long kept cases and plots take [s], after the last case. `failing`: cases, `seconds`: of a case."""
    keep, variants, metrics = study.keys.keep, len(study.variants), len(study.metrics)
    kept = min(failing, keep.failed) + keep.worst * metrics * variants
    return kept * (REPEAT_TIME + seconds) + PLOT_TIME * variants * (len(study.bands) + 2 * metrics + 8)
