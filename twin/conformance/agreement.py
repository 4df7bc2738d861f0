"""Conformance checks that every component must pass; `twin test NAME` and the test suite run the same ones.

A check takes a component class and the build folder and raises ConformanceError with one line a problem.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import compiler
from twin.compiler import machine
from twin.component import Component, Float64, PythonComponent, Role, Variable, functions
from twin.conformance import reference
from twin.coupling import Member, RecordMember
from twin.errors import CouplingError, TwinError

if TYPE_CHECKING:
    from twin.conformance.reference import Trajectory, Value

VERSIONS = ("2.0", "3.0")


class ConformanceError(TwinError):
    """A component fails a conformance check."""


class MemberTarget:
    """Replay target for a member: reference trajectories are replayed through the step function that the loop calls.

    Arrays are read and written as a whole, once between two steps; trajectories hold single elements.
    """

    def __init__(self, member: Member) -> None:
        self.member = member
        self.flags = np.zeros(8, np.int64)
        self._elements = {
            name: (variable.name, index)
            for variable in member.variables.values()
            for name, index in zip(elements(variable.name, variable.shape), np.ndindex(variable.shape), strict=True)
        }
        # Arrays are written as a whole, and an FMU need not allow reading before initialization.
        self.arrays = {
            variable.name: np.array(np.broadcast_to(variable.start, variable.shape))
            for variable in member.variables.values()
            if variable.shape
        }
        self.changed: set[str] = set()  # arrays with pending writes
        self._cache: dict[str, np.ndarray[Any, Any]] = {}  # values read since the last write or step
        member.instantiate()

    def set(self, name: str, value: Value) -> None:
        """Write an input."""
        variable, index = self._elements[name]
        self._cache.clear()
        if index:
            self.arrays[variable][index] = value
            self.changed.add(variable)
        else:
            self.member.set(variable, value)

    def get(self, name: str) -> Value:
        """Read an output."""
        self._write()
        variable, index = self._elements[name]
        if variable not in self._cache:
            self._cache[variable] = np.asarray(self.member.get(variable))
        value: Value = self._cache[variable][index].item()
        return bool(value) if self.member.variables[variable].type == "Boolean" else value

    def start(self, t: float) -> None:
        """Initialize at t [s]."""
        self._write()
        self.member.enter_initialization(t, None)
        self.member.exit_initialization()

    def advance(self, t: float, h: float) -> int:
        """Step from t to t + h [s]."""
        self._write()
        self._cache.clear()
        member, address = self.member, int(self.flags.ctypes.data)
        return machine.call_step(member.step_function, member.step_signature, member.instance, t, h, address)

    def _write(self) -> None:
        for variable in sorted(self.changed):
            self.member.set(variable, self.arrays[variable])
        self.changed.clear()


def elements(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of the scalars of a variable, as `Variable.elements` does."""
    return [f"{name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(shape)] if shape else [name]


def read_expected(cls: type[Component]) -> Trajectory:
    """Read the trajectory in the component's expected.csv; ConformanceError if there is none."""
    path = reference.reference_path(cls)
    if not path.exists():
        raise ConformanceError(f"{cls.__name__}: has no {path}. Run: {reference.command(cls)}")
    return reference.read(path, cls)


_responses: dict[type[Component], Trajectory] = {}


def run_interpreted(cls: type[Component]) -> Trajectory:
    """Run the component as plain Python under the stimulus of its expected.csv; the outputs in the file are ignored.

    The other forms are compared with this trajectory, so a missing or outdated file is reported only once.
    """
    if cls not in _responses:
        _responses[cls] = reference.record_reference(cls, reference.read_stimulus(reference.reference_path(cls), cls))
    return _responses[cls]


def require_equal(cls: type[Component], what: str, other: str, wanted: Trajectory, actual: Trajectory) -> None:
    """Raise ConformanceError unless two trajectories are equal to the bit."""
    mismatches = reference.differences(wanted, actual)
    if mismatches:
        text = ", ".join(f"{name} by {size:.3g}" for name, size in mismatches.items())
        raise ConformanceError(f"{cls.__name__}: {what} differs from {other} in {text}.")


def check_source(cls: type[Component], build: Path) -> None:
    """Check that the functions can be compiled and write no input or parameter."""
    raise_problems(compiler.problems(cls, build))


def check_documentation(cls: type[Component], _build: Path) -> None:
    """Check for docstrings and descriptions, coherent SI units, and sources of parameters."""
    from twin.component import unit

    problems = []
    if not (cls.__doc__ or "").strip():
        problems.append(f"{cls.__name__}: has no docstring. Say what it is and where the equations come from.")
    for variable in cls.variables:
        where = f"{cls.__name__}.{variable.name}"
        if not variable.description:
            problems.append(f"{where}: has no description. Say what it means, with its sign.")
        try:
            if unit.describe(variable.unit).factor != 1.0:
                problems.append(f"{where}: unit {variable.unit} is not SI. Use SI inside and display_unit beside it.")
        except CouplingError as error:
            problems.append(f"{where}: {error}")
        if variable.role is Role.parameter and variable.type is Float64 and not variable.source:
            problems.append(f"{where}: has no source. Say where the value comes from, or `assumed`.")
    for name, terminal in cls.terminals.items():
        if not terminal.description:
            problems.append(f"{cls.__name__}.{name}: has no description. Say what is connected there.")
    raise_problems(problems)


def check_outputs_set(cls: type[Component], _build: Path) -> None:
    """Check that initialization and a step write all outputs, which are set to NaN before."""
    part = cls()
    outputs = [v for v in cls.variables if v.role is Role.output and v.type is Float64]
    continuous = "derivatives(self, t)" if hasattr(cls, "derivatives") else ""
    phases: dict[str, tuple[str, Callable[[], object]]] = {
        continuous or "initialize(self)": ("initialization", part.start),
        continuous or "step(self, t, h)": ("a step", lambda: part.advance(0.0, step_size(cls))),
    }
    problems = []
    for function, (phase, call) in phases.items():
        for variable in outputs:
            part.views[variable.name][...] = np.nan
        call()
        for variable in outputs:
            if np.any(np.isnan(part.views[variable.name])):
                problems.append(
                    f"{cls.__name__}: {phase} does not write {variable.name}. {output_remedy(function, variable)}"
                )
    raise_problems(problems)


def output_remedy(function: str, variable: Variable) -> str:
    """Return the remedy for an output that a function does not write."""
    element = f"[{', '.join('0' * len(variable.shape))}]" if variable.shape else ""
    every = " and so on, every element" if variable.shape else ""
    return f"Write `def {function}:` with `self.{variable.name}{element} = ...`{every}, whatever branch is taken."


def raise_problems(problems: list[str]) -> None:
    """Raise ConformanceError with all problems, if there are any."""
    if problems:
        raise ConformanceError("\n".join(problems))


def step_size(cls: type[Component]) -> float:
    """Return a communication step in which the component makes one step [s]."""
    return cls.period or 1e-3


def check_interpreted(cls: type[Component], _build: Path) -> None:
    """Check that the interpreted component reproduces expected.csv to the bit."""
    wanted = read_expected(cls)
    require_equal(
        cls, "interpreted", f"expected.csv (if that is wanted: {reference.command(cls)})", wanted, run_interpreted(cls)
    )


def check_compiled(cls: type[Component], build: Path) -> None:
    """Check that the component compiled in process equals the interpreted one to the bit."""
    wanted = run_interpreted(cls)
    member = RecordMember("part", cls(), compiler.load_component(cls, build))
    require_equal(cls, "compiled", "interpreted", wanted, reference.replay(MemberTarget(member), wanted))


def check_fmu(cls: type[Component], build: Path) -> None:
    """Check that the FMI 2.0 and 3.0 FMUs equal the interpreted component to the bit and pass FMPy's validation."""
    from fmpy.validation import validate_fmu

    from twin.fmi import FMUMember, exporter

    wanted = run_interpreted(cls)
    for version in VERSIONS:
        path = exporter.build(cls, version, build)
        problems = validate_fmu(str(path))
        if problems:
            raise ConformanceError(f"{cls.__name__}: FMPy says of {path}: {'; '.join(map(str, problems))}")
        member = FMUMember("part", path)
        try:
            require_equal(
                cls, f"the FMI {version} FMU", "interpreted", wanted, reference.replay(MemberTarget(member), wanted)
            )
        finally:
            member.close()


CHECKS: dict[str, Callable[[type[Component], Path], None]] = {
    "source": check_source,
    "documentation": check_documentation,
    "outputs": check_outputs_set,
    "interpreted": check_interpreted,
    "compiled": check_compiled,
    "fmu": check_fmu,
}


def checks(cls: type[Component]) -> dict[str, Callable[[type[Component], Path], Any]]:
    """Return the checks that apply to a component: a Python-side one is neither compiled nor exported."""
    functions(cls)
    if issubclass(cls, PythonComponent):
        return {name: CHECKS[name] for name in ("documentation", "interpreted")}
    return CHECKS
