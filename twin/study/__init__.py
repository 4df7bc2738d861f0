"""Studies: one scenario many times, with factors that vary: Monte Carlo, sensitivity, worst case, tuning."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.study.answers import Answers, percent
    from twin.study.design import Study, load_study
    from twin.study.execution import StudyOutcome, StudyProgress, kept, latest, place_of, repeat, run_study, single

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "answers": ["Answers", "percent"],
        "design": ["Study", "load_study"],
        "execution": ["StudyOutcome", "StudyProgress", "kept", "latest", "place_of", "repeat", "run_study", "single"],
    },
)

__all__ = [
    "Answers",
    "Study",
    "StudyOutcome",
    "StudyProgress",
    "kept",
    "latest",
    "load_study",
    "percent",
    "place_of",
    "repeat",
    "run_study",
    "single",
]
