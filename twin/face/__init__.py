"""The Python interface: the functions of the command line as objects for programs and notebooks."""

from twin.face.fmus import export, simulate
from twin.face.run import Run, open_run
from twin.face.scenario import Scenario, load
from twin.face.simulation import Simulation
from twin.face.system import System

__all__ = ["Run", "Scenario", "Simulation", "System", "export", "load", "open_run", "simulate"]
