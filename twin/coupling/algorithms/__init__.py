"""Co-simulation algorithms, one per file: options of the fixed-step loop or of the variable-step master."""

from twin.coupling.algorithms.algorithm import Algorithm
from twin.coupling.algorithms.ecco import Ecco
from twin.coupling.algorithms.energy import Energy
from twin.coupling.algorithms.gauss_seidel import GaussSeidel
from twin.coupling.algorithms.iterative import Iterative
from twin.coupling.algorithms.jacobi import Jacobi
from twin.coupling.algorithms.predictive import Predictive
from twin.coupling.algorithms.step_doubling import StepDoubling

__all__ = ["Algorithm", "Ecco", "Energy", "GaussSeidel", "Iterative", "Jacobi", "Predictive", "StepDoubling"]
