"""What came out: signals, expressions over them, metrics and verdicts, plots, analyses, calibration, files."""

from twin.results import calibration, expression, plotting, recording, signals
from twin.results.analysis import Analysis
from twin.results.expression import Expression
from twin.results.metrics import Curve, Ending, Evaluation, Expectation, Figure, Metric, Outcome, Plot, evaluate
from twin.results.plotting import histogram
from twin.results.recording import write_text
from twin.results.signals import Signals, Window, coherent, shown

__all__ = [
    "Analysis",
    "Curve",
    "Ending",
    "Evaluation",
    "Expectation",
    "Expression",
    "Figure",
    "Metric",
    "Outcome",
    "Plot",
    "Signals",
    "Window",
    "calibration",
    "coherent",
    "evaluate",
    "expression",
    "histogram",
    "plotting",
    "recording",
    "shown",
    "signals",
    "write_text",
]
