"""Many simulations for one answer: models fitted to recordings."""

from typing import TYPE_CHECKING

from twin import late
from twin.study.problem import Problem
from twin.study.result import Estimate, Result, command_line, read_estimate

if TYPE_CHECKING:
    from twin.study.intervals import METHODS
    from twin.study.loading import load
    from twin.study.page import html
    from twin.study.work import identify

__getattr__ = late.names(__name__, {"METHODS": "intervals", "html": "page", "identify": "work", "load": "loading"})

__all__ = ["METHODS", "Estimate", "Problem", "Result", "command_line", "html", "identify", "load", "read_estimate"]
