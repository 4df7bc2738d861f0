"""Solvers of ordinary differential equations by name, stepped one internal step at a time.

SciPy's are always there. CVODE (Hindmarsh et al., ACM TOMS 31(3), 2005) and ARKODE (Reynolds et al., ACM TOMS 49(2), 2023)
come with the extra `solvers`.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from twin.errors import FMUError, SimulationError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable

Vector = np.ndarray[Any, Any]

DEFAULT = "Radau"  # one-step and L-stable: suits stiff systems and frequent restarts at events
TOLERANCE = 1e-6  # relative, if neither the user nor the FMU sets one
SCIPY = ("Radau", "BDF", "RK23", "RK45", "DOP853")
CVODE = {"CVODE": "BDF", "CVODE_Adams": "Adams"}
ARKODE = {"ARKODE": "ESDIRK437L2SA_7_3_4", "ARKODE_ERK": "VERNER_8_5_6"}  # order 4, implicit; order 6, explicit
NAMES = (*SCIPY, *CVODE, *ARKODE)


class Discarded(Exception):  # noqa: N818 - no error: the solver takes a smaller step
    """The equations cannot be evaluated at this point."""


@dataclass(frozen=True, slots=True)
class Equations:
    """The initial value problem der(y) = f(t, y), its Jacobian if available, and the tolerances."""

    derivatives: Callable[[float, Vector], Vector]
    jacobian: Callable[[float, Vector], Vector] | None
    relative: float
    absolute: Vector


class Solver(ABC):
    """Interface of a solver: `begin`, internal steps, and `at` for interpolation within the last step."""

    @abstractmethod
    def begin(self, t: float, y: Vector, first: float) -> None:
        """Start anew, with a first step of `first` [s], or one of the solver's choice if that is 0."""

    @abstractmethod
    def step(self, bound: float) -> tuple[float, Vector]:
        """Take one internal step, not beyond `bound`; return its end and the states there."""

    @abstractmethod
    def at(self, t: float) -> Vector:
        """Interpolate the states within the last step."""


class Stateless(Solver):
    """Solver of a system without states: only time advances."""

    def begin(self, _t: float, _y: Vector, _first: float) -> None:
        """No-op."""

    def step(self, bound: float) -> tuple[float, Vector]:
        """Advance to `bound`."""
        return bound, np.zeros(0)

    def at(self, _t: float) -> Vector:
        """No states."""
        return np.zeros(0)


class SciPy(Solver):
    """One of `scipy.integrate`'s classes; its bound is moved instead of making a new one at every step."""

    def __init__(self, name: str, equations: Equations) -> None:
        import scipy.integrate

        self.name, self.equations = name, equations
        self.method: Any = getattr(scipy.integrate, name)

    def begin(self, t: float, y: Vector, first: float) -> None:
        """Make the solver; an implicit one takes the Jacobian."""
        equations = self.equations
        options: dict[str, Any] = {"rtol": equations.relative, "atol": equations.absolute}
        if equations.jacobian is not None and self.name in ("Radau", "BDF"):
            options["jac"] = equations.jacobian
        if first:
            options["first_step"] = first
        self.made = self.method(equations.derivatives, t, y, np.inf, **options)
        self.dense: Any = None

    def step(self, bound: float) -> tuple[float, Vector]:
        """One step; SciPy would begin one of length zero at its bound."""
        made = self.made
        made.t_bound, made.status = bound, "running"
        failure = made.step()
        if made.status == "failed":
            raise SimulationError(str(failure))
        self.dense = None
        return made.t, made.y

    def at(self, t: float) -> Vector:
        """By the solver's own interpolation."""
        if self.dense is None:
            self.dense = self.made.dense_output()
        state: Vector = self.dense(t)
        return state


class Sundials(Solver):
    """Base of SUNDIALS' solvers. Exceptions in callbacks cannot pass native frames; they are stored and raised afterward."""

    package: ClassVar[str]
    module_name: ClassVar[str]

    def __init__(self, name: str, equations: Equations) -> None:
        try:
            self.module: Any = importlib.import_module(self.module_name)
        except ImportError:
            raise FMUError(
                f"solver {name} needs {self.package}, which is not installed. Use `pip install 'catheter-twin[solvers]'`, "
                f"or one of SciPy's: {', '.join(SCIPY)}."
            ) from None
        self.name, self.equations = name, equations
        self.failure: BaseException | None = None

    def evaluate_guarded(self, call: Callable[[float, Vector], Vector], t: float, y: Vector) -> Vector:
        """Evaluate the equations at a point; NaN after an exception, which is stored and raised later."""
        try:
            return call(t, y)
        except BaseException as error:
            self.failure = error
            return np.full(len(y), np.nan)

    def called(self, call: Callable[[], Any]) -> Any:
        """Call native code, then raise the stored exception of a callback."""
        try:
            result = call()
        except (RuntimeError, SystemError) as error:
            self.raised()
            raise SimulationError(str(error)) from None
        self.raised()
        return result

    def raised(self) -> None:
        """Raise the stored exception, if any."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure


class Cvode(Sundials):
    """CVODE by scikit-sundae."""

    package, module_name = "scikit-sundae", "sksundae.cvode"

    def begin(self, t: float, y: Vector, first: float) -> None:
        """Make the solver; BDF takes the Jacobian."""
        equations = self.equations

        def derivatives(t: float, y: Vector, output: Vector) -> None:
            output[:] = self.evaluate_guarded(equations.derivatives, t, y)

        def jacobian(t: float, y: Vector, _: Vector, output: Vector) -> None:
            assert equations.jacobian is not None
            output[:] = self.evaluate_guarded(equations.jacobian, t, y)

        options = {"jacfn": jacobian} if equations.jacobian is not None and self.name == "CVODE" else {}
        self.solver = self.module.CVODE(
            derivatives,
            method=CVODE[self.name],
            rtol=equations.relative,
            atol=equations.absolute,
            first_step=first,
            **options,
        )
        self.called(lambda: self.solver.init_step(t, y))
        self.t = t

    def step(self, bound: float) -> tuple[float, Vector]:
        """Take one step; after an interpolation CVODE first returns its present point again."""
        for _ in range(2):
            result = self.called(lambda: self.solver.step(bound, method="onestep", tstop=bound))
            if not result.success:
                raise SimulationError(result.message)
            if float(result.t) > self.t:
                break
        self.t = float(result.t)
        return self.t, np.array(result.y, np.float64).reshape(-1)

    def at(self, t: float) -> Vector:
        """By CVODE's own interpolation."""
        result = self.called(lambda: self.solver.step(t, method="normal"))
        return np.array(result.y, np.float64).reshape(-1)


class Arkode(Sundials):
    """ARKODE by SundialsPy, which cannot stop at a time: a step goes on beyond it, and is looked at inside."""

    package, module_name = "SundialsPy", "SundialsPy"

    def begin(self, t: float, y: Vector, _first: float) -> None:
        """Make the solver; it chooses its first step. Given a Jacobian, SundialsPy 0.1 prints at every use of it."""
        equations, own = self.equations, self.module.arkode
        table = getattr(own.ButcherTable, ARKODE[self.name])

        def derivatives(t: float, y: Vector) -> Vector:
            return self.evaluate_guarded(equations.derivatives, t, y)

        functions = (None, derivatives) if self.name == "ARKODE" else (derivatives, None)
        self.solver = own.ARKodeSolver(len(y), *functions, table)
        self.called(lambda: self.solver.initialize(np.array(y), t, equations.relative, equations.absolute))

    def step(self, bound: float) -> tuple[float, Vector]:
        """One step, or the part of it until the bound."""
        if self.solver.get_current_time() < bound:
            status = self.called(lambda: self.solver.advance_one_step(bound))
            if status < 0:
                raise SimulationError(f"ARKODE returned {status}")
        t = float(self.solver.get_current_time())
        return (t, np.array(self.solver.get_current_solution())) if t <= bound else (bound, self.at(bound))

    def at(self, t: float) -> Vector:
        """By ARKODE's own interpolation."""
        return np.array(self.called(lambda: self.solver.solve_to(t)), np.float64)


def check(name: str) -> str:
    """Return a solver's name in its canonical case; FMUError if it is unknown."""
    names_by_lowercase = {name.lower(): name for name in NAMES}
    if name.lower() not in names_by_lowercase:
        raise FMUError(f"solver {name!r} is not known. {nearest(name, list(NAMES))}")
    return names_by_lowercase[name.lower()]


def make(name: str, equations: Equations) -> Solver:
    """Create the solver of a name; `Stateless` if there are no states."""
    if not len(equations.absolute):
        return Stateless()
    kind = SciPy if name in SCIPY else Cvode if name in CVODE else Arkode
    return kind(name, equations)
