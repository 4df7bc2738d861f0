"""The Python interface: the functions of the command line as objects for programs and notebooks."""

from twin.face.finished_run import Run, open_run
from twin.face.finished_study import StudyResult, open_study
from twin.face.fmus import export, simulate
from twin.face.scenario import Scenario, follow, live, load, run
from twin.face.simulation import Simulation
from twin.face.system import System

__all__ = [
    "Run",
    "Scenario",
    "Simulation",
    "StudyResult",
    "System",
    "export",
    "follow",
    "live",
    "load",
    "open_run",
    "open_study",
    "run",
    "simulate",
]
