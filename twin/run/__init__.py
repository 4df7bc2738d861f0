"""A scenario becomes runs, and runs a report."""

from twin import late
from twin.run.cases import Hardware, Outcome, analyzed, happen, prepare, run_case, signals, silent, simulation
from twin.run.report import UNLIMITED, table
from twin.run.work import recover, resume, run_scenario

__getattr__ = late.names(__name__, {"scenes": ""})

__all__ = [
    "UNLIMITED",
    "Hardware",
    "Outcome",
    "analyzed",
    "happen",
    "prepare",
    "recover",
    "resume",
    "run_case",
    "run_scenario",
    "scenes",
    "signals",
    "silent",
    "simulation",
    "table",
]
