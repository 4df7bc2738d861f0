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

DEFAULT = "Radau"  # one-step and L-stable: neither stiffness nor many restarts at events are in its way
TOLERANCE = 1e-6  # relative, where neither the user nor the FMU says one
SCIPY = ("Radau", "BDF", "RK23", "RK45", "DOP853")
CVODE = {"CVODE": "BDF", "CVODE_Adams": "Adams"}
ARKODE = {"ARKODE": "ESDIRK437L2SA_7_3_4", "ARKODE_ERK": "VERNER_8_5_6"}  # order 4, implicit; order 6, explicit
NAMES = (*SCIPY, *CVODE, *ARKODE)


class Discarded(Exception):  # noqa: N818 - no error: the solver takes a smaller step
    """The equations cannot be evaluated at this point."""


@dataclass(frozen=True, slots=True)
class Equations:
    """What is integrated: der(y) = f(t, y), with its Jacobian if that is known, and how exactly."""

    derivatives: Callable[[float, Vector], Vector]
    jacobian: Callable[[float, Vector], Vector] | None
    relative: float
    absolute: Vector


class Solver(ABC):
    """Steps from `begin` on; values within the last step are found by `at`."""

    @abstractmethod
    def begin(self, t: float, y: Vector, first: float) -> None:
        """Start anew, with a first step of `first` [s], or one of the solver's choice if that is 0."""

    @abstractmethod
    def step(self, bound: float) -> tuple[float, Vector]:
        """One internal step that does not pass `bound`: where it came to."""

    @abstractmethod
    def at(self, t: float) -> Vector:
        """The states within the last step."""


class Stateless(Solver):
    """For what has no states: time goes on."""

    def begin(self, _t: float, _y: Vector, _first: float) -> None:
        """Nothing to do."""

    def step(self, bound: float) -> tuple[float, Vector]:
        """Go there."""
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
        asked = self.equations
        options: dict[str, Any] = {"rtol": asked.relative, "atol": asked.absolute}
        if asked.jacobian is not None and self.name in ("Radau", "BDF"):
            options["jac"] = asked.jacobian
        if first:
            options["first_step"] = first
        self.made = self.method(asked.derivatives, t, y, np.inf, **options)
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
        found: Vector = self.dense(t)
        return found


class Sundials(Solver):
    """Base of SUNDIALS' solvers: what is raised in a callback would have to pass through native frames, and waits."""

    package: ClassVar[str]
    place: ClassVar[str]  # of its module

    def __init__(self, name: str, equations: Equations) -> None:
        try:
            self.module: Any = importlib.import_module(self.place)
        except ImportError:
            raise FMUError(
                f"solver {name} needs {self.package}, which is not installed. Use `pip install 'catheter-twin[solvers]'`, "
                f"or one of SciPy's: {', '.join(SCIPY)}."
            ) from None
        self.name, self.equations = name, equations
        self.failure: BaseException | None = None

    def asked(self, call: Callable[[float, Vector], Vector], t: float, y: Vector) -> Vector:
        """What the equations are at a point; not a number after a failure, which is raised later."""
        try:
            return call(t, y)
        except BaseException as error:
            self.failure = error
            return np.full(len(y), np.nan)

    def called(self, call: Callable[[], Any]) -> Any:
        """Call native code, and raise what was raised in a callback."""
        try:
            found = call()
        except (RuntimeError, SystemError) as error:
            self.raised()
            raise SimulationError(str(error)) from None
        self.raised()
        return found

    def raised(self) -> None:
        """Raise what waits."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure


class Cvode(Sundials):
    """CVODE by scikit-sundae."""

    package, place = "scikit-sundae", "sksundae.cvode"

    def begin(self, t: float, y: Vector, first: float) -> None:
        """Make the solver; BDF takes the Jacobian."""
        known = self.equations

        def derivatives(t: float, y: Vector, found: Vector) -> None:
            found[:] = self.asked(known.derivatives, t, y)

        def jacobian(t: float, y: Vector, _: Vector, found: Vector) -> None:
            assert known.jacobian is not None
            found[:] = self.asked(known.jacobian, t, y)

        options = {"jacfn": jacobian} if known.jacobian is not None and self.name == "CVODE" else {}
        self.solver = self.module.CVODE(
            derivatives, method=CVODE[self.name], rtol=known.relative, atol=known.absolute, first_step=first, **options
        )
        self.called(lambda: self.solver.init_step(t, y))
        self.t = t

    def step(self, bound: float) -> tuple[float, Vector]:
        """One step; after an interpolation CVODE first tells once more where it is."""
        for _ in range(2):
            found = self.called(lambda: self.solver.step(bound, method="onestep", tstop=bound))
            if not found.success:
                raise SimulationError(found.message)
            if float(found.t) > self.t:
                break
        self.t = float(found.t)
        return self.t, np.array(found.y, np.float64).reshape(-1)

    def at(self, t: float) -> Vector:
        """By CVODE's own interpolation."""
        found = self.called(lambda: self.solver.step(t, method="normal"))
        return np.array(found.y, np.float64).reshape(-1)


class Arkode(Sundials):
    """ARKODE by SundialsPy, which cannot stop at a time: a step goes on beyond it, and is looked at inside."""

    package, place = "SundialsPy", "SundialsPy"

    def begin(self, t: float, y: Vector, _first: float) -> None:
        """Make the solver; it chooses its first step. Given a Jacobian, SundialsPy 0.1 prints at every use of it."""
        known, own = self.equations, self.module.arkode
        table = getattr(own.ButcherTable, ARKODE[self.name])

        def derivatives(t: float, y: Vector) -> Vector:
            return self.asked(known.derivatives, t, y)

        functions = (None, derivatives) if self.name == "ARKODE" else (derivatives, None)
        self.solver = own.ARKodeSolver(len(y), *functions, table)
        self.called(lambda: self.solver.initialize(np.array(y), t, known.relative, known.absolute))

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
    """A solver's name as it is written here; FMUError if there is none of that name."""
    known = {one.lower(): one for one in NAMES}
    if name.lower() not in known:
        raise FMUError(f"solver {name!r} is not known. {nearest(name, list(NAMES))}")
    return known[name.lower()]


def make(name: str, equations: Equations) -> Solver:
    """The solver of a name; one for nothing if there are no states."""
    if not len(equations.absolute):
        return Stateless()
    kind = SciPy if name in SCIPY else Cvode if name in CVODE else Arkode
    return kind(name, equations)
