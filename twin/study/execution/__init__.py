"""Many cases: an engine that steps them in one process, processes and clusters that have it, and what is kept of them."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.study.execution.case_engine import Engine, Job

if TYPE_CHECKING:
    from twin.study.execution.progress import StudyProgress, TimeEstimate
    from twin.study.execution.stored_case import (
        repeat,
        resolve_case,
        single,
        stored_case_folder,
        stored_cases,
        study_of_run,
    )
    from twin.study.execution.study_runner import StudyOutcome, estimate_time, latest, run_study, searched_cases

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "stored_case": [
            "stored_case_folder",
            "stored_cases",
            "study_of_run",
            "resolve_case",
            "repeat",
            "single",
        ],
        "progress": ["StudyProgress", "TimeEstimate"],
        "study_runner": ["StudyOutcome", "estimate_time", "latest", "run_study", "searched_cases"],
    },
)

__all__ = [
    "Engine",
    "Job",
    "StudyOutcome",
    "StudyProgress",
    "TimeEstimate",
    "estimate_time",
    "latest",
    "repeat",
    "resolve_case",
    "run_study",
    "searched_cases",
    "single",
    "stored_case_folder",
    "stored_cases",
    "study_of_run",
]
