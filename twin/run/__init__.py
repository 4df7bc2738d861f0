"""A scenario becomes runs, and runs a report."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.run.cases import Hardware, Outcome, analyzed, happen, prepare, run_case, signals, silent, simulation
from twin.run.executor import run_scenario

if TYPE_CHECKING:
    from twin.run.coupling_report import profile, stability, structure_of
    from twin.run.recovery import recover, resume
    from twin.run.report import UNLIMITED, events, table
    from twin.run.rollback_check import rollback_check

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["scenes"],
    submod_attrs={
        "coupling_report": ["profile", "stability", "structure_of"],
        "recovery": ["recover", "resume"],
        "report": ["UNLIMITED", "events", "table"],
        "rollback_check": ["rollback_check"],
    },
)

__all__ = [
    "UNLIMITED",
    "Hardware",
    "Outcome",
    "analyzed",
    "events",
    "happen",
    "prepare",
    "profile",
    "recover",
    "resume",
    "rollback_check",
    "run_case",
    "run_scenario",
    "scenes",
    "signals",
    "silent",
    "simulation",
    "stability",
    "structure_of",
    "table",
]
