"""What came out: signals, expressions over them, metrics and verdicts, plots, analyses, calibration, files."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.results import arrow_arrays, dimension, expression, plot_annotations, rows, run_folder, signals
from twin.results.analysis import Analysis
from twin.results.expression import Expression
from twin.results.metrics import Curve, Ending, Evaluation, Expectation, Figure, Metric, Outcome, Plot, evaluate, figure
from twin.results.plot_annotations import Event
from twin.results.run_folder import write_text
from twin.results.signal_reader import Recorded, read_variables, recorded
from twin.results.signals import Signals, Window, coherent, shown, within
from twin.results.stream import Journal, Stream, column_of, plain_column, unfinished
from twin.results.violations import Failure, failures

if TYPE_CHECKING:
    from twin.results import calibration, figure_files, plotting
    from twin.results.comparison import compared
    from twin.results.exporters import export
    from twin.results.plotting import histogram

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["calibration", "figure_files", "plotting"],
    submod_attrs={"comparison": ["compared"], "exporters": ["export"], "plotting": ["histogram"]},
)

__all__ = [
    "Analysis",
    "Curve",
    "Ending",
    "Evaluation",
    "Event",
    "Expectation",
    "Expression",
    "Failure",
    "Figure",
    "Journal",
    "Metric",
    "Outcome",
    "Plot",
    "Recorded",
    "Signals",
    "Stream",
    "Window",
    "arrow_arrays",
    "calibration",
    "coherent",
    "column_of",
    "compared",
    "dimension",
    "evaluate",
    "export",
    "expression",
    "failures",
    "figure",
    "figure_files",
    "histogram",
    "plain_column",
    "plot_annotations",
    "plotting",
    "read_variables",
    "recorded",
    "rows",
    "run_folder",
    "shown",
    "signals",
    "stream",
    "unfinished",
    "within",
    "write_text",
]
