"""A scenario becomes runs, and runs a report."""

from typing import TYPE_CHECKING

from twin import late
from twin.run.cases import Hardware, Outcome, analyzed, happen, prepare, run_case, signals, silent, simulation
from twin.run.work import run_scenario

if TYPE_CHECKING:
    from twin.run.coupled import profile, stability, structure_of
    from twin.run.recovery import recover, resume
    from twin.run.report import UNLIMITED, events, table
    from twin.run.way_back import way_back

__getattr__ = late.names(
    __name__,
    {
        "UNLIMITED": "report",
        "events": "report",
        "profile": "coupled",
        "stability": "coupled",
        "recover": "recovery",
        "resume": "recovery",
        "scenes": "",
        "structure_of": "coupled",
        "table": "report",
        "way_back": "way_back",
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
    "run_case",
    "run_scenario",
    "scenes",
    "signals",
    "silent",
    "simulation",
    "stability",
    "structure_of",
    "table",
    "way_back",
]
