"""Reference trajectories: `expected.csv` of a component, and its replay in whatever form the component takes.

A file has one column per scalar: `time`, the inputs, the outputs; one row per communication point. Row 0 is after
initialization with that row's inputs; the outputs of a later row are what one step from the row before it gave, with
that row's inputs. The stimulus stands in the file, numbers are written so that they read back to the bit.

    twin reference NAME ...        writes expected.csv of these components anew, under the stimulus it has
"""

from __future__ import annotations

import csv
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi, sin
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from twin import clock
from twin.component import Boolean, Component, Float64, Role, Type, Variable, solver
from twin.errors import DeclarationError, SimulationError

STEPS = 100
STEP = 1_000_000  # communication step [ns]

Value = float | int | bool
Row = tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Values of inputs and outputs by element name; `rows` hold time [s], inputs, outputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def stimulus(self) -> tuple[Row, ...]:
        """Time and inputs alone."""
        return tuple(row[: 1 + len(self.inputs)] for row in self.rows)


class Target(Protocol):
    """What a trajectory is replayed on: an instance in this process, a member, an FMU. Names are those of elements."""

    def set(self, name: str, value: Value) -> None:
        """Write an input."""

    def start(self, t: float) -> None:
        """Initialize at t [s]."""

    def advance(self, t: float, h: float) -> int:
        """Step from t to t + h [s]; a status."""

    def get(self, name: str) -> Value:
        """Read an output."""


class InstanceTarget:
    """A component's instance: interpreted, or run by other `start(t)` and `advance(t, h)` over the same record."""

    def __init__(
        self,
        instance: Component,
        start: Callable[[float], Any] | None = None,
        advance: Callable[[float, float], int] | None = None,
    ) -> None:
        self.start = start or instance.start
        self.advance = advance or instance.advance
        self._places = {
            element: (instance.views[variable.name], index)
            for variable in instance.variables
            for element, index in zip(variable.elements(), np.ndindex(variable.shape), strict=True)
        }

    def set(self, name: str, value: Value) -> None:
        """Write an input."""
        view, index = self._places[name]
        view[index] = value

    def get(self, name: str) -> Value:
        """Read an output."""
        view, index = self._places[name]
        value: Value = view[index].item()
        return value


def elements(cls: type[Component], role: Role) -> tuple[str, ...]:
    """Names of all scalars of one role, in the order of declaration."""
    return tuple(name for variable in cls.variables if variable.role is role for name in variable.elements())


def stimulus(cls: type[Component]) -> tuple[Row, ...]:
    """A small excitation from the inputs' declarations: two sines of the nominal value about the start value.

    Integers and Booleans keep their start in the first half and go to `minimum`, or to the other value, in the second.
    """
    scalars = [
        (variable, start)
        for variable in cls.variables
        if variable.role is Role.input
        for start in variable.start_array().ravel().tolist()
    ]
    rows = []
    for step in range(STEPS + 1):
        values = [excited(*scalar, place, step / STEPS) for place, scalar in enumerate(scalars)]
        rows.append((clock.seconds(step * STEP), *values))
    return tuple(rows)


def excited(variable: Variable, start: Value, place: int, part: float) -> Value:
    """Value of the input at `place` after a part (0 to 1) of the excitation; `place` makes inputs differ."""
    if variable.type is Boolean:
        return bool(start) != (part > 0.5)
    if variable.type is not Float64:
        return int(start) if part <= 0.5 or variable.minimum is None else int(variable.minimum)
    size = variable.nominal or variable.maximum or 1.0
    value = start + size * (sin(2.0 * pi * part * (1.0 + 0.3 * place)) + 0.3 * sin(2.0 * pi * 3.7 * part)) / 1.3
    if variable.minimum is not None:
        value = max(value, variable.minimum)
    return value if variable.maximum is None else min(value, variable.maximum)


def record_reference(cls: type[Component], given: Sequence[Row] | None = None) -> Trajectory:
    """What a component answers, interpreted, to a stimulus (rows of time and inputs), by default the standard one."""
    inputs, outputs = elements(cls, Role.input), elements(cls, Role.output)
    blank = tuple(tuple(row) for row in given or stimulus(cls))
    return replay(cls, Trajectory(inputs, outputs, blank))


def replay(target: Target | type[Component], expected: Trajectory) -> Trajectory:
    """The trajectory that a target gives under the stimulus of an expected one."""
    player = InstanceTarget(target()) if isinstance(target, type) else target
    rows: list[Row] = []
    for given in expected.stimulus:
        if rows:
            begin, end = (clock.nanoseconds(float(time)) for time in (rows[-1][0], given[0]))
            status = player.advance(clock.seconds(begin), clock.seconds(end - begin))
            if status > solver.WARNING:
                raise SimulationError(
                    f"reference: status {status} after {clock.text(begin)}. Look at the inputs there."
                )
        for name, value in zip(expected.inputs, given[1:], strict=True):
            player.set(name, value)
        if not rows:
            player.start(float(given[0]))
        rows.append((*given, *(player.get(name) for name in expected.outputs)))
    return Trajectory(expected.inputs, expected.outputs, tuple(rows))


def differences(expected: Trajectory, found: Trajectory) -> dict[str, float]:
    """Largest absolute difference of every output that differs at all; not a number counts as infinite."""
    result = {}
    for column, name in enumerate(expected.outputs, 1 + len(expected.inputs)):
        both = np.array([(a[column], b[column]) for a, b in zip(expected.rows, found.rows, strict=True)], dtype=float)
        largest = float(np.max(np.abs(both[:, 0] - both[:, 1])))
        if largest != 0.0:
            result[name] = min(np.inf, largest)
    return result


def write(path: Path, trajectory: Trajectory) -> None:
    """Write a trajectory; Booleans as 0 and 1."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time", *trajectory.inputs, *trajectory.outputs))
        for row in trajectory.rows:
            writer.writerow([repr(int(value) if isinstance(value, bool) else value) for value in row])


def read(path: Path, cls: type[Component]) -> Trajectory:
    """Read the trajectory of a component."""
    names, lines = cells(path)
    inputs, outputs = elements(cls, Role.input), elements(cls, Role.output)
    if names != ("time", *inputs, *outputs):
        raise DeclarationError(f"{path}: columns are not the variables of {cls.__name__}. Run: {command(cls)}")
    return Trajectory(inputs, outputs, parsed(path, cls, names, lines))


def cells(path: Path) -> tuple[tuple[str, ...], list[list[str]]]:
    """Header and lines of a file; nothing of one that cannot be read as text."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (UnicodeDecodeError, csv.Error):
        lines = []
    return (tuple(lines[0]), lines[1:]) if lines else ((), [])


def parsed(path: Path, cls: type[Component], names: tuple[str, ...], lines: list[list[str]]) -> tuple[Row, ...]:
    """The numbers of lines, under the names of their columns."""
    types = {name: variable.type for variable in cls.variables for name in variable.elements()}
    convert = [PARSERS[types.get(name, Float64)] for name in names]
    rows = []
    for number, line in enumerate(lines, 2):
        try:
            rows.append(tuple(parse(text) for parse, text in zip(convert, line[: len(names)], strict=True)))
        except ValueError:
            raise DeclarationError(
                f"{path}:{number}: expected {len(names)} numbers. Restore the file, or remove it and run: {command(cls)}"
            ) from None
    return tuple(rows)


PARSERS: dict[Type, Callable[[str], Value]] = {
    Type.Float64: float,
    Type.Int32:   int,
    Type.Int64:   int,
    Type.Boolean: lambda text: bool(int(text)),
}  # fmt: skip


def command(cls: type[Component]) -> str:
    """What writes a component's file anew."""
    package, _, rest = cls.__module__.partition(".")
    name, _, module = rest.partition(".")
    shown = name if (package, module) == ("fmus", "model") else f"{cls.__module__}:{cls.__name__}"
    return f"twin reference {shown}"


def regenerate(cls: type[Component], path: Path | None = None) -> Path:
    """Write a component's expected.csv, by default beside its model.py; a stimulus that stands there is kept."""
    target = path or place(cls)
    write(target, record_reference(cls, kept_stimulus(target, cls)))
    return target


def place(cls: type[Component]) -> Path:
    """Where a component's expected.csv is."""
    return Path(inspect.getfile(cls)).parent / "expected.csv"


def kept_stimulus(path: Path, cls: type[Component]) -> Sequence[Row] | None:
    """Times and inputs of a file, or nothing if there is none or the component has other inputs by now."""
    if not path.exists():
        return None
    names, lines = cells(path)
    kept = ("time", *elements(cls, Role.input))
    if names[: len(kept)] != kept or len(names) <= len(kept) or not lines:
        return None
    return parsed(path, cls, kept, lines)
