"""Execution of scenarios and reports of runs."""

import sys
from typing import TYPE_CHECKING

import lazy_loader

from twin import CallablePackage
from twin.run.cases import (
    Hardware,
    Progress,
    RunResult,
    apply_analyses,
    apply_event,
    build_simulation,
    load_hardware,
    noop,
    recorded_signals,
    refuse_faults,
    resolve_catalogs,
    run_case,
)
from twin.run.executor import run_scenario
from twin.run.options import RunCallbacks, RunOptions

if TYPE_CHECKING:
    from twin.run.continuation import continue_run
    from twin.run.coupling_report import case_structure, check_stability, measure_profile
    from twin.run.event_table import event_rows
    from twin.run.recovery import recover, resume
    from twin.run.report import MetricTable, results_table
    from twin.run.rollback import rollback_check

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["scenes"],
    submod_attrs={
        "continuation": ["continue_run"],
        "coupling_report": ["measure_profile", "check_stability", "case_structure"],
        "recovery": ["recover", "resume"],
        "event_table": ["event_rows"],
        "report": ["MetricTable", "results_table"],
        "rollback": ["rollback_check"],
    },
)

__all__ = [
    "Hardware",
    "MetricTable",
    "Progress",
    "RunCallbacks",
    "RunOptions",
    "RunResult",
    "apply_analyses",
    "apply_event",
    "build_simulation",
    "case_structure",
    "check_stability",
    "continue_run",
    "event_rows",
    "load_hardware",
    "measure_profile",
    "noop",
    "recorded_signals",
    "recover",
    "refuse_faults",
    "resolve_catalogs",
    "results_table",
    "resume",
    "rollback_check",
    "run_case",
    "run_scenario",
    "scenes",
]

sys.modules[__name__].__class__ = CallablePackage
