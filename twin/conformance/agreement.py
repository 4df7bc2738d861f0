"""What every component must pass; `twin test NAME` and the test suite run these same checks.

A check takes a component class and the build folder and raises ConformanceError with one line if it does not hold.
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
    """A component does not do what every component must."""


class MemberTarget:
    """A member on which a reference trajectory is replayed, through the address that the loop would call.

    Arrays are read and written whole, once between two steps, though a trajectory knows their elements.
    """

    def __init__(self, member: Member) -> None:
        self.member = member
        self.flags = np.zeros(8, np.int64)
        self.places = {
            name: (variable.name, index)
            for variable in member.variables.values()
            for name, index in zip(elements(variable.name, variable.shape), np.ndindex(variable.shape), strict=True)
        }
        # arrays are written whole; before initialization an FMU need not let them be read
        self.arrays = {
            variable.name: np.array(np.broadcast_to(variable.start, variable.shape))
            for variable in member.variables.values()
            if variable.shape
        }
        self.changed: set[str] = set()  # arrays that are still to be written
        self.known: dict[str, np.ndarray[Any, Any]] = {}  # what was read since anything changed
        member.instantiate()

    def set(self, name: str, value: Value) -> None:
        """Write an input."""
        variable, index = self.places[name]
        self.known.clear()
        if index:
            self.arrays[variable][index] = value
            self.changed.add(variable)
        else:
            self.member.set(variable, value)

    def get(self, name: str) -> Value:
        """Read an output."""
        self._write()
        variable, index = self.places[name]
        if variable not in self.known:
            self.known[variable] = np.asarray(self.member.get(variable))
        value: Value = self.known[variable][index].item()
        return bool(value) if self.member.variables[variable].type == "Boolean" else value

    def start(self, t: float) -> None:
        """Initialize at t [s]."""
        self._write()
        self.member.enter_initialization(t, None)
        self.member.exit_initialization()

    def advance(self, t: float, h: float) -> int:
        """Step from t to t + h [s]."""
        self._write()
        self.known.clear()
        member, address = self.member, int(self.flags.ctypes.data)
        return machine.call_step(member.step_function, member.step_signature, member.instance, t, h, address)

    def _write(self) -> None:
        for variable in sorted(self.changed):
            self.member.set(variable, self.arrays[variable])
        self.changed.clear()


def elements(name: str, shape: tuple[int, ...]) -> list[str]:
    """Names of the scalars of a variable, as in `Variable.elements`."""
    return [f"{name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(shape)] if shape else [name]


def expected(cls: type[Component]) -> Trajectory:
    """The trajectory in the component's expected.csv."""
    path = reference.place(cls)
    if not path.exists():
        raise ConformanceError(f"{cls.__name__}: has no {path}. Run: {reference.command(cls)}")
    return reference.read(path, cls)


_answers: dict[type[Component], Trajectory] = {}


def interpreted(cls: type[Component]) -> Trajectory:
    """What the component answers as plain Python to the stimulus of its expected.csv, whatever outputs stand there.

    Other forms are compared with it, so that a file that is missing or out of date is told once.
    """
    if cls not in _answers:
        _answers[cls] = reference.record_reference(cls, reference.kept_stimulus(reference.place(cls), cls))
    return _answers[cls]


def same(cls: type[Component], what: str, other: str, wanted: Trajectory, found: Trajectory) -> None:
    """Demand equality to the bit."""
    wrong = reference.differences(wanted, found)
    if wrong:
        text = ", ".join(f"{name} by {size:.3g}" for name, size in wrong.items())
        raise ConformanceError(f"{cls.__name__}: {what} differs from {other} in {text}.")


def check_source(cls: type[Component], build: Path) -> None:
    """The functions hold nothing that cannot be compiled, and write no input or parameter."""
    demand(compiler.problems(cls, build))


def check_documentation(cls: type[Component], _build: Path) -> None:
    """Docstring and descriptions are there, units are coherent SI, parameters name their source."""
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
    demand(problems)


def check_outputs_written(cls: type[Component], _build: Path) -> None:
    """Outputs that were poisoned with NaN are written by initialization and again by a step."""
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
                    f"{cls.__name__}: {phase} does not write {variable.name}. {written(function, variable)}"
                )
    demand(problems)


def written(function: str, variable: Variable) -> str:
    """How an output is set in a function."""
    element = f"[{', '.join('0' * len(variable.shape))}]" if variable.shape else ""
    every = " and so on, every element" if variable.shape else ""
    return f"Write `def {function}:` with `self.{variable.name}{element} = ...`{every}, whatever branch is taken."


def demand(problems: list[str]) -> None:
    """Nothing may be wrong; all that is, is told."""
    if problems:
        raise ConformanceError("\n".join(problems))


def step_size(cls: type[Component]) -> float:
    """A communication step that makes a component step [s]."""
    return cls.period or 1e-3


def check_interpreted(cls: type[Component], _build: Path) -> None:
    """Interpreted, the component reproduces expected.csv to the bit."""
    wanted = expected(cls)
    same(cls, "interpreted", f"expected.csv (if that is wanted: {reference.command(cls)})", wanted, interpreted(cls))


def check_compiled(cls: type[Component], build: Path) -> None:
    """Compiled in process, the component does the same to the bit."""
    wanted = interpreted(cls)
    member = RecordMember("part", cls(), compiler.load_component(cls, build))
    same(cls, "compiled", "interpreted", wanted, reference.replay(MemberTarget(member), wanted))


def check_fmu(cls: type[Component], build: Path) -> None:
    """As FMI 2.0 and as FMI 3.0 FMU, the component does the same to the bit and passes FMPy's validation."""
    from fmpy.validation import validate_fmu

    from twin.fmi import FMUMember, exporter

    wanted = interpreted(cls)
    for version in VERSIONS:
        path = exporter.build(cls, version, build)
        problems = validate_fmu(str(path))
        if problems:
            raise ConformanceError(f"{cls.__name__}: FMPy says of {path}: {'; '.join(map(str, problems))}")
        member = FMUMember("part", path)
        try:
            same(cls, f"the FMI {version} FMU", "interpreted", wanted, reference.replay(MemberTarget(member), wanted))
        finally:
            member.close()


CHECKS: dict[str, Callable[[type[Component], Path], None]] = {
    "source":        check_source,
    "documentation": check_documentation,
    "outputs":       check_outputs_written,
    "interpreted":   check_interpreted,
    "compiled":      check_compiled,
    "fmu":           check_fmu,
}  # fmt: skip


def checks(cls: type[Component]) -> dict[str, Callable[[type[Component], Path], Any]]:
    """The checks that apply: a Python-side component is neither compiled nor an FMU."""
    functions(cls)
    if issubclass(cls, PythonComponent):
        return {name: CHECKS[name] for name in ("documentation", "interpreted")}
    return CHECKS
