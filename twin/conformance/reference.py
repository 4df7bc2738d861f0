"""Reference trajectories: `expected.csv` of a component, and its replay in every execution form.

A file has one column per scalar: `time`, the inputs, the outputs; one row per communication point. Row 0 holds the outputs
after initialization with that row's inputs; the outputs of a later row result from one step with the inputs of the row
before. The file contains the stimulus; numbers are written so that they read back to the bit.

    twin reference NAME ...        rewrites expected.csv of these components under the stimulus in the file
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
from twin.errors import DeclarationError, SimulationError, TwinError
from twin.files import read_csv

STEPS = 100
STEP = 1_000_000  # communication step [ns]

Value = float | int | bool
Row = tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Recorded inputs and outputs by element name; `rows` hold time [s], inputs, outputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def stimulus(self) -> tuple[Row, ...]:
        """Rows of time and inputs only."""
        return tuple(row[: 1 + len(self.inputs)] for row in self.rows)


class ReplayTarget(Protocol):
    """Interface for replaying a trajectory: an instance in this process, a member, an FMU. Names are those of elements."""

    def set(self, name: str, value: Value) -> None:
        """Write an input."""

    def start(self, t: float) -> None:
        """Initialize at t [s]."""

    def advance(self, t: float, h: float) -> int:
        """Step from t to t + h [s]; return the FMI status."""

    def get(self, name: str) -> Value:
        """Read an output."""


class InstanceTarget:
    """Replay target for a component instance; `start(t)` and `advance(t, h)` can be replaced by others over the same record."""

    def __init__(
        self,
        instance: Component,
        start: Callable[[float], Any] | None = None,
        advance: Callable[[float, float], int] | None = None,
    ) -> None:
        self.start = start or instance.start
        self.advance = advance or instance.advance
        self._elements = {
            element: (instance.views[variable.name], index)
            for variable in instance.variables
            for element, index in zip(variable.elements(), np.ndindex(variable.shape), strict=True)
        }

    def set(self, name: str, value: Value) -> None:
        """Write an input."""
        view, index = self._elements[name]
        view[index] = value

    def get(self, name: str) -> Value:
        """Read an output."""
        view, index = self._elements[name]
        value: Value = view[index].item()
        return value


def elements(cls: type[Component], role: Role) -> tuple[str, ...]:
    """Return the names of all scalars of one role, in the order of declaration."""
    return tuple(name for variable in cls.variables if variable.role is role for name in variable.elements())


def stimulus(cls: type[Component]) -> tuple[Row, ...]:
    """Generate a stimulus from the declarations of the inputs: two sines of the nominal value about the start value.

    Integers and Booleans keep their start value in the first half and take `minimum`, or the other value, in the second.
    """
    scalars = [
        (variable, start)
        for variable in cls.variables
        if variable.role is Role.input
        for start in variable.start_array().ravel().tolist()
    ]
    rows = []
    for step in range(STEPS + 1):
        values = [stimulus_value(*scalar, column, step / STEPS) for column, scalar in enumerate(scalars)]
        rows.append((clock.seconds(step * STEP), *values))
    return tuple(rows)


def stimulus_value(variable: Variable, start: Value, column: int, part: float) -> Value:
    """Return an input's value after a part (0 to 1) of the stimulus; `column` makes the inputs differ."""
    if variable.type is Boolean:
        return bool(start) != (part > 0.5)
    if variable.type is not Float64:
        return int(start) if part <= 0.5 or variable.minimum is None else int(variable.minimum)
    size = variable.nominal or variable.maximum or 1.0
    value = start + size * (sin(2.0 * pi * part * (1.0 + 0.3 * column)) + 0.3 * sin(2.0 * pi * 3.7 * part)) / 1.3
    if variable.minimum is not None:
        value = max(value, variable.minimum)
    return value if variable.maximum is None else min(value, variable.maximum)


def record_reference(cls: type[Component], stimulus_rows: Sequence[Row] | None = None) -> Trajectory:
    """Run the interpreted component under a stimulus (rows of time and inputs), by default the generated one."""
    inputs, outputs = elements(cls, Role.input), elements(cls, Role.output)
    blank = tuple(tuple(row) for row in stimulus_rows or stimulus(cls))
    return replay(cls, Trajectory(inputs, outputs, blank))


def replay(target: ReplayTarget | type[Component], expected: Trajectory) -> Trajectory:
    """Run a target under the stimulus of an expected trajectory; SimulationError if a step fails."""
    player = InstanceTarget(target()) if isinstance(target, type) else target
    rows: list[Row] = []
    for row in expected.stimulus:
        if rows:
            begin, end = (clock.nanoseconds(float(time)) for time in (rows[-1][0], row[0]))
            status = player.advance(clock.seconds(begin), clock.seconds(end - begin))
            if status > solver.WARNING:
                raise SimulationError(
                    f"reference: status {status} after {clock.text(begin)}. Look at the inputs there."
                )
        for name, value in zip(expected.inputs, row[1:], strict=True):
            player.set(name, value)
        if not rows:
            player.start(float(row[0]))
        rows.append((*row, *(player.get(name) for name in expected.outputs)))
    return Trajectory(expected.inputs, expected.outputs, tuple(rows))


def differences(expected: Trajectory, actual: Trajectory) -> dict[str, float]:
    """Return the largest absolute difference of every output that differs at all; NaN counts as infinite."""
    result = {}
    for column, name in enumerate(expected.outputs, 1 + len(expected.inputs)):
        pairs = np.array([(a[column], b[column]) for a, b in zip(expected.rows, actual.rows, strict=True)], dtype=float)
        largest = float(np.max(np.abs(pairs[:, 0] - pairs[:, 1])))
        if largest != 0.0:
            result[name] = min(np.inf, largest)
    return result


def write(path: Path, trajectory: Trajectory) -> None:
    """Write a trajectory as CSV; Booleans as 0 and 1."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time", *trajectory.inputs, *trajectory.outputs))
        for row in trajectory.rows:
            writer.writerow([repr(int(value) if isinstance(value, bool) else value) for value in row])


def read(path: Path, cls: type[Component]) -> Trajectory:
    """Read the trajectory of a component; DeclarationError if the columns do not match its variables."""
    names, lines = read_cells(path)
    inputs, outputs = elements(cls, Role.input), elements(cls, Role.output)
    if names != ("time", *inputs, *outputs):
        raise DeclarationError(f"{path}: columns are not the variables of {cls.__name__}. Run: {command(cls)}")
    return Trajectory(inputs, outputs, parse_rows(path, cls, names, lines))


def read_cells(path: Path) -> tuple[tuple[str, ...], list[list[str]]]:
    """Read header and rows of a CSV file; empty if it cannot be read as text."""
    try:
        lines = [cells for _, cells in read_csv(path)]
    except TwinError:
        lines = []
    return (tuple(lines[0]), lines[1:]) if lines else ((), [])


def parse_rows(path: Path, cls: type[Component], names: tuple[str, ...], lines: list[list[str]]) -> tuple[Row, ...]:
    """Parse rows of text by the types of their columns; DeclarationError with the line that is wrong."""
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
    Type.Int32: int,
    Type.Int64: int,
    Type.Boolean: lambda text: bool(int(text)),
}


def command(cls: type[Component]) -> str:
    """Return the command that rewrites a component's expected.csv."""
    package, _, rest = cls.__module__.partition(".")
    name, _, module = rest.partition(".")
    shown = name if (package, module) == ("fmus", "model") else f"{cls.__module__}:{cls.__name__}"
    return f"twin reference {shown}"


def regenerate(cls: type[Component], path: Path | None = None) -> Path:
    """Write a component's expected.csv, by default next to its model.py, under the stimulus in an existing file."""
    target = path or reference_path(cls)
    write(target, record_reference(cls, read_stimulus(target, cls)))
    return target


def reference_path(cls: type[Component]) -> Path:
    """Return the path of a component's expected.csv."""
    return Path(inspect.getfile(cls)).parent / "expected.csv"


def read_stimulus(path: Path, cls: type[Component]) -> Sequence[Row] | None:
    """Read the times and inputs of a file; None if it does not exist or the component's inputs have changed."""
    if not path.exists():
        return None
    names, lines = read_cells(path)
    columns = ("time", *elements(cls, Role.input))
    if names[: len(columns)] != columns or len(names) <= len(columns) or not lines:
        return None
    return parse_rows(path, cls, columns, lines)
