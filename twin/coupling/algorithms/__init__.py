"""Co-simulation algorithms, one per file: options of the fixed-step loop or of the variable-step master."""

from twin.coupling.algorithms.algorithm import Algorithm as Algorithm
from twin.coupling.algorithms.ecco import Ecco as Ecco
from twin.coupling.algorithms.energy import Energy as Energy
from twin.coupling.algorithms.gauss_seidel import GaussSeidel as GaussSeidel
from twin.coupling.algorithms.iterative import Iterative as Iterative
from twin.coupling.algorithms.jacobi import Jacobi as Jacobi
from twin.coupling.algorithms.predictive import Predictive as Predictive
from twin.coupling.algorithms.step_doubling import StepDoubling as StepDoubling
