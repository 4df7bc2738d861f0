"""Identification: parameters of a model fitted to recorded data, with confidence intervals."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.identify.problem import Problem
from twin.identify.result import Estimate, Result, command_line, read_estimate

if TYPE_CHECKING:
    from twin.identify.intervals import METHODS
    from twin.identify.loading import load
    from twin.identify.page import html, script, style, templates
    from twin.identify.runner import identify

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "intervals": ["METHODS"],
        "loading": ["load"],
        "page": ["html", "script", "style", "templates"],
        "runner": ["identify"],
    },
)

__all__ = [
    "METHODS",
    "Estimate",
    "Problem",
    "Result",
    "command_line",
    "html",
    "identify",
    "load",
    "read_estimate",
    "script",
    "style",
    "templates",
]
