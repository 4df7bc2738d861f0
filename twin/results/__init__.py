"""Results of a run: signals, expressions over them, metrics and verdicts, plots, analyses, calibration, files."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.results import plot_annotations
from twin.results.analysis import Analysis
from twin.results.evaluation import dimension, expression
from twin.results.evaluation.coverage import ends_before, list_names, quote_names
from twin.results.evaluation.expression import Expression
from twin.results.evaluation.hardware_termination import HardwareTermination
from twin.results.evaluation.metric_format import MetricFormat, common_format, metric_formats
from twin.results.evaluation.metrics import (
    Evaluation,
    Expectation,
    ExpectationResult,
    Metric,
    MetricResult,
    Plot,
    PlotCurve,
    compute_metric,
    evaluate,
)
from twin.results.evaluation.sentence import check_sentence, fill_sentence
from twin.results.evaluation.violations import Violation, consecutive_spans, find_violations
from twin.results.plot_annotations import EventLine, join_numbers
from twin.results.recording import rows, run_folder, signals, stream
from twin.results.recording.latest_run import (
    LATEST,
    find_results,
    finished_runs,
    is_finished_run,
    link_latest,
    resolve_latest,
)
from twin.results.recording.run_folder import RecordedVariable, count_verdicts, write_text
from twin.results.recording.signal_reader import list_recorded_variables, read_variables, readable_recording
from twin.results.recording.signals import Signals, Window, format_value, si_conversion, window_mask
from twin.results.recording.stream import Journal, RunRecording, column_from_dict, column_to_dict, find_unfinished_runs

if TYPE_CHECKING:
    from twin.results import calibration, calibration_report, figure_files, plotting
    from twin.results.comparison import Comparison, compare_runs
    from twin.results.exporters import export
    from twin.results.metric_table import MetricTable
    from twin.results.plotting import histogram

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["calibration", "calibration_report", "figure_files", "plotting"],
    submod_attrs={
        "comparison": ["Comparison", "compare_runs"],
        "exporters": ["export"],
        "metric_table": ["MetricTable"],
        "plotting": ["histogram"],
    },
)

__all__ = [
    "LATEST",
    "Analysis",
    "Comparison",
    "Evaluation",
    "EventLine",
    "Expectation",
    "ExpectationResult",
    "Expression",
    "HardwareTermination",
    "Journal",
    "Metric",
    "MetricFormat",
    "MetricResult",
    "MetricTable",
    "Plot",
    "PlotCurve",
    "RecordedVariable",
    "RunRecording",
    "Signals",
    "Violation",
    "Window",
    "calibration",
    "calibration_report",
    "check_sentence",
    "column_from_dict",
    "column_to_dict",
    "common_format",
    "compare_runs",
    "compute_metric",
    "consecutive_spans",
    "count_verdicts",
    "dimension",
    "ends_before",
    "evaluate",
    "export",
    "expression",
    "figure_files",
    "fill_sentence",
    "find_results",
    "find_unfinished_runs",
    "find_violations",
    "finished_runs",
    "format_value",
    "histogram",
    "is_finished_run",
    "join_numbers",
    "link_latest",
    "list_names",
    "list_recorded_variables",
    "metric_formats",
    "plot_annotations",
    "plotting",
    "quote_names",
    "read_variables",
    "readable_recording",
    "resolve_latest",
    "rows",
    "run_folder",
    "si_conversion",
    "signals",
    "stream",
    "window_mask",
    "write_text",
]
