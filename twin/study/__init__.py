"""Studies: one scenario many times, with factors that vary: Monte Carlo, sensitivity, worst case, tuning."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.study.answers import Answers, headline, open_command, percent
    from twin.study.design import Study, load_study
    from twin.study.execution import (
        StudyOutcome,
        StudyProgress,
        TimeEstimate,
        estimate_time,
        latest,
        repeat,
        resolve_case,
        run_study,
        searched_cases,
        single,
        stored_case_folder,
        stored_cases,
        study_of_run,
    )

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "answers": ["Answers", "headline", "open_command", "percent"],
        "design": ["Study", "load_study"],
        "execution": [
            "StudyOutcome",
            "StudyProgress",
            "TimeEstimate",
            "estimate_time",
            "stored_case_folder",
            "stored_cases",
            "study_of_run",
            "latest",
            "resolve_case",
            "repeat",
            "run_study",
            "searched_cases",
            "single",
        ],
    },
)

__all__ = [
    "Answers",
    "Study",
    "StudyOutcome",
    "StudyProgress",
    "TimeEstimate",
    "estimate_time",
    "headline",
    "latest",
    "load_study",
    "open_command",
    "percent",
    "repeat",
    "resolve_case",
    "run_study",
    "searched_cases",
    "single",
    "stored_case_folder",
    "stored_cases",
    "study_of_run",
]
