"""A scenario becomes runs, and runs a report."""

from twin.run.cases import Hardware, Outcome, analyzed, prepare, run_case, run_scenario, signals, silent, simulation
from twin.run.report import UNLIMITED, table

__all__ = [
    "UNLIMITED",
    "Hardware",
    "Outcome",
    "analyzed",
    "prepare",
    "run_case",
    "run_scenario",
    "signals",
    "silent",
    "simulation",
    "table",
]
