"""What came out: signals, expressions over them, metrics and verdicts, plots, analyses, calibration, files."""

from typing import TYPE_CHECKING

from twin import late
from twin.results import arrow, dimension, expression, marks, recording, rows, signals
from twin.results.analysis import Analysis
from twin.results.expression import Expression
from twin.results.failing import Failure, failures
from twin.results.marks import Event
from twin.results.metrics import Curve, Ending, Evaluation, Expectation, Figure, Metric, Outcome, Plot, evaluate, figure
from twin.results.reading import Recorded, read_variables, recorded
from twin.results.recording import write_text
from twin.results.signals import Signals, Window, coherent, shown, within
from twin.results.stream import Journal, Stream, column_of, plain_column, unfinished

if TYPE_CHECKING:
    from twin.results import calibration, figures, plotting
    from twin.results.comparison import compared
    from twin.results.exported import export
    from twin.results.plotting import histogram

__getattr__ = late.names(
    __name__,
    {
        "calibration": "",
        "compared": "comparison",
        "export": "exported",
        "figures": "",
        "histogram": "plotting",
        "plotting": "",
    },
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
    "arrow",
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
    "figures",
    "histogram",
    "marks",
    "plain_column",
    "plotting",
    "read_variables",
    "recorded",
    "recording",
    "rows",
    "shown",
    "signals",
    "stream",
    "unfinished",
    "within",
    "write_text",
]
