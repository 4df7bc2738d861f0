"""Many cases: an engine that steps them in one process, processes and clusters that have it, and what is kept of them."""

from typing import TYPE_CHECKING

from twin import late
from twin.study.many.engine import DONE, FAILED, Engine, Job, Row

if TYPE_CHECKING:
    from twin.study.many.repeat import Single, kept, place_of, repeat, single
    from twin.study.many.work import StudyOutcome, StudyProgress, latest, run_study

__getattr__ = late.names(
    __name__,
    {
        "StudyOutcome": "work",
        "StudyProgress": "work",
        "Single": "repeat",
        "kept": "repeat",
        "latest": "work",
        "place_of": "repeat",
        "repeat": "repeat",
        "run_study": "work",
        "single": "repeat",
    },
)

__all__ = [
    "DONE",
    "FAILED",
    "Engine",
    "Job",
    "Row",
    "Single",
    "StudyOutcome",
    "StudyProgress",
    "kept",
    "latest",
    "place_of",
    "repeat",
    "run_study",
    "single",
]
