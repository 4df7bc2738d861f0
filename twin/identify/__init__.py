"""Identification: parameters of a model fitted to recorded data, with confidence intervals."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.identify.problem import Output, Problem, RecordedExperiment, Unknown
from twin.identify.recordings.schema import (
    ColumnsKeys,
    FileKeys,
    IdentifyKeys,
    InputKeys,
    RangeKeys,
    TableKeys,
    probability,
)
from twin.identify.result import Estimate, Result, command_line, read_estimate

if TYPE_CHECKING:
    from twin.identify.intervals import METHODS, ParameterUncertainty, estimate_uncertainty
    from twin.identify.page import html
    from twin.identify.recordings import replay
    from twin.identify.recordings.loading import load
    from twin.identify.recordings.recorded_files import Column, RecordedFile
    from twin.identify.recordings.recording import Loader
    from twin.identify.runner import identify
    from twin.identify.search import Fit, Residuals, multistart_search

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "intervals": ["METHODS", "ParameterUncertainty", "estimate_uncertainty"],
        "recordings.loading": ["load"],
        "page": ["html"],
        "recordings": ["replay"],
        "recordings.recorded_files": ["Column", "RecordedFile"],
        "recordings.recording": ["Loader"],
        "runner": ["identify"],
        "search": ["Fit", "Residuals", "multistart_search"],
    },
)

__all__ = [
    "METHODS",
    "Column",
    "ColumnsKeys",
    "Estimate",
    "FileKeys",
    "Fit",
    "IdentifyKeys",
    "InputKeys",
    "Loader",
    "Output",
    "ParameterUncertainty",
    "Problem",
    "RangeKeys",
    "RecordedExperiment",
    "RecordedFile",
    "Residuals",
    "Result",
    "TableKeys",
    "Unknown",
    "command_line",
    "estimate_uncertainty",
    "html",
    "identify",
    "load",
    "multistart_search",
    "probability",
    "read_estimate",
    "replay",
]
