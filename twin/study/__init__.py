"""Many simulations for one answer: models fitted to recordings, scenarios with what varies."""

from typing import TYPE_CHECKING

from twin import late
from twin.study.problem import Problem
from twin.study.result import Estimate, Result, command_line, read_estimate

if TYPE_CHECKING:
    from twin.study.answers import Answers, percent
    from twin.study.design import Study, load_study
    from twin.study.intervals import METHODS
    from twin.study.loading import load
    from twin.study.many import StudyOutcome, StudyProgress, kept, latest, place_of, repeat, run_study, single
    from twin.study.page import html
    from twin.study.work import identify

__getattr__ = late.names(
    __name__,
    {
        "Answers": "answers",
        "METHODS": "intervals",
        "Study": "design",
        "StudyOutcome": "many",
        "StudyProgress": "many",
        "html": "page",
        "identify": "work",
        "kept": "many",
        "latest": "many",
        "load": "loading",
        "load_study": "design",
        "percent": "answers",
        "place_of": "many",
        "repeat": "many",
        "run_study": "many",
        "single": "many",
    },
)

__all__ = [
    "METHODS",
    "Answers",
    "Estimate",
    "Problem",
    "Result",
    "Study",
    "StudyOutcome",
    "StudyProgress",
    "command_line",
    "html",
    "identify",
    "kept",
    "latest",
    "load",
    "load_study",
    "percent",
    "place_of",
    "read_estimate",
    "repeat",
    "run_study",
    "single",
]
