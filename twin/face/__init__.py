"""The Python interface: the functions of the command line as objects for programs and notebooks."""

from twin.face.finished_run import Run, open_run
from twin.face.fmus import export, simulate
from twin.face.functions import follow, live, run
from twin.face.scenario import Scenario, load
from twin.face.simulation import Simulation
from twin.face.system import System

__all__ = [
    "Run",
    "Scenario",
    "Simulation",
    "System",
    "export",
    "follow",
    "live",
    "load",
    "open_run",
    "run",
    "simulate",
]
