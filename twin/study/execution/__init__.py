"""Many cases: an engine that steps them in one process, processes and clusters that have it, and what is kept of them."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.study.execution.case_engine import DONE, FAILED, Engine, Job, Row

if TYPE_CHECKING:
    from twin.study.execution.repeat import Single, kept, place_of, repeat, single
    from twin.study.execution.study_runner import StudyOutcome, StudyProgress, latest, run_study

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "repeat": ["Single", "kept", "place_of", "repeat", "single"],
        "study_runner": ["StudyOutcome", "StudyProgress", "latest", "run_study"],
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
