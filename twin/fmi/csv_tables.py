"""Tables over time: inputs read from CSV, results written as CSV or Parquet."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import FMUError, TwinError
from twin.files import parse_float, read_csv, split_unit
from twin.fmi import values

if TYPE_CHECKING:
    from pathlib import Path

    from twin.coupling import MemberVariable
    from twin.fmi.importing.fmu_member import FMUMember

FORMATS = (".csv", ".parquet")
MEETS = 1e-3  # of a step: a row's time that is not farther from it is meant to be the step's


@dataclass
class InputColumn:
    """Values of one variable over the rows of an input table: array of rows x scalars."""

    variable: MemberVariable
    rows: np.ndarray[Any, Any]

    @property
    def linear(self) -> bool:
        """Whether values between rows are interpolated; else they are held."""
        return self.variable.variability == "continuous" and self.variable.dtype.kind == "f"


@dataclass
class Inputs:
    """Inputs over time: linear between rows if continuous, else held; constant before the first and after the last.

    Two rows at one time are a jump: the later one holds at and after that time.
    """

    times: np.ndarray[Any, Any]
    columns: list[InputColumn] = field(default_factory=list)

    def on_steps(self, start: clock.Time, step: clock.Time, count: int) -> Inputs:
        """The same with rows that nearly meet a step at its very time; `start`, `step`: of the steps [ns].

        Added up or written as single precision, a time is a little beside what was meant, and its row must not be
        held a step late for that. Rows keep their order; of several times near a step the nearest is meant.
        """
        nearest = np.rint((self.times * clock.NANOSECONDS - float(start)) / float(step))
        met = np.array([clock.seconds(start + int(k) * step) for k in np.clip(nearest, 0, count)])
        distance = np.abs(self.times - met)
        steps, number = np.unique(nearest, return_inverse=True)
        least = np.full(len(steps), MEETS * clock.seconds(step))
        np.minimum.at(least, number, distance)
        close = distance <= least[number]
        return Inputs(np.where(close, met, self.times), self.columns)

    def at(self, column: InputColumn, t: float) -> np.ndarray[Any, Any]:
        """Flat value of a column at a time [s]."""
        last = len(self.times) - 1
        row = max(int(np.searchsorted(self.times, t, side="right")) - 1, 0)
        here: np.ndarray[Any, Any] = column.rows[row]
        if not column.linear or row == last or t <= self.times[row]:
            return here
        share = (t - self.times[row]) / (self.times[row + 1] - self.times[row])
        mixed: np.ndarray[Any, Any] = here + share * (column.rows[row + 1] - here)
        return mixed

    def value(self, column: InputColumn, t: float) -> Any:
        """Value of a column at a time [s], a scalar as itself."""
        flat = self.at(column, t)
        return flat if column.variable.shape else flat[0]


def read_inputs(path: Path, member: FMUMember) -> Inputs:
    """Read and check a table of inputs; every defect is one error with file and line."""
    return table_inputs(read_cells(path), str(path), member)


def table_inputs(lines: list[tuple[int, list[Any]]], path: str, member: FMUMember) -> Inputs:
    """Check a table of inputs: (line, cells) of its header and rows, as text or as values. `path` is for messages."""
    header = [name.strip() for name in lines[0][1]]
    where = f"{path}:{lines[0][0]}"
    time_column = next((i for i, name in enumerate(header) if split_unit(name)[0].lower() == "time"), None)
    if time_column is None:
        hint = " Separate columns by commas." if len(header) == 1 and ";" in header[0] else ""
        raise FMUError(f"{where}: has no column 'time'. Name the first column time.{hint}")
    if len(lines) == 1:
        raise FMUError(f"{path}: has no rows below its header. Give the values at one time at least.")
    times = read_times(path, lines[1:], time_column, split_unit(header[time_column])[1])
    inputs = Inputs(times)
    columns_by_variable: dict[str, dict[int, int]] = {}  # variable -> element (-1: all of it) -> column
    units: dict[int, str] = {}
    for number, name in enumerate(header):
        if number == time_column:
            continue
        variable, element = find_input(name, member, where, units, number)
        taken = columns_by_variable.setdefault(variable.name, {})
        key = -1 if element is None else element
        if key in taken or (taken and -1 in (key, *taken)):
            raise FMUError(f"{where}: column {name!r} gives {variable.name} a second time. Remove one of them.")
        taken[key] = number
    for name, taken in columns_by_variable.items():
        inputs.columns.append(read_column(path, lines[1:], member, name, taken=taken, units=units))
    return inputs


def read_cells(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of all lines that are not empty; as many cells as the header has."""
    lines = read_csv(path, error_type=FMUError)
    if not lines:
        raise FMUError(f"{path}: is empty. Give a header `time,name,...` and rows.")
    width = len(lines[0][1])
    for line, row in lines:
        if len(row) != width:
            raise FMUError(f"{path}:{line}: has {len(row)} cells, expected {width} as in the header. Quote commas.")
    return lines


def read_times(path: str, lines: list[tuple[int, list[Any]]], time_column: int, unit_name: str) -> np.ndarray[Any, Any]:
    """Times [s], which must not run backward."""
    factor = unit.conversion(unit_name, "s", f"{path}: time")[0]
    with suppress(TypeError, ValueError):
        times = np.array([parse_float(cells[time_column]) for _, cells in lines]) * factor
        if np.isfinite(times).all() and (np.diff(times) >= 0.0).all():
            return times
    times = np.empty(len(lines))  # once more, to say what is wrong in which line
    for row, (line, cells) in enumerate(lines):
        times[row] = number(cells[time_column], f"{path}:{line}: time") * factor
        if row and times[row] < times[row - 1]:
            raise FMUError(
                f"{path}:{line}: time {cells[time_column]} is before {lines[row - 1][1][time_column]}. Sort the rows."
            )
    return times


def number(text: Any, what: str) -> float:
    """A finite number."""
    try:
        value = parse_float(text)
    except (TypeError, ValueError):
        raise FMUError(f"{what} is {text!r}, expected a number. Write it like 1.5e-3.") from None
    if not np.isfinite(value):
        raise FMUError(f"{what} is {text}, expected a finite number. Fill the gap or remove the row.")
    return value


def find_input(
    name: str, member: FMUMember, where: str, units: dict[int, str], column: int
) -> tuple[MemberVariable, int | None]:
    """The variable of a column; its unit goes to `units`."""
    if name not in member.variables:
        name, units[column] = split_unit(name)
    variable, element = values.find(name, member.variables, where)
    if variable.causality != "input" and variable.variability != "tunable":
        inputs = [each.name for each in member.variables.values() if each.causality == "input"]
        raise FMUError(f"{where}: {name!r} is no input ({variable.causality}). Inputs: {', '.join(inputs) or 'none'}.")
    if units.get(column) and not (variable.unit and variable.dtype.kind == "f"):
        raise FMUError(f"{where}: {name!r} has no unit to convert {units[column]} to. Remove the unit.")
    return variable, element


def read_column(
    path: str,
    lines: list[tuple[int, list[Any]]],
    member: FMUMember,
    name: str,
    *,
    taken: dict[int, int],
    units: dict[int, str],
) -> InputColumn:
    """Values of one variable, from one column or from those of its elements; missing elements keep their start."""
    variable = member.variables[name]
    items = member.items(name)
    base = variable.start
    if base is None and -1 not in taken and len(taken) < variable.size:
        missing = values.elements(variable)[next(i for i in range(variable.size) if i not in taken)]
        raise FMUError(f"{path}: {name} has no start value for its element {missing}. Add a column for it.")
    is_number = variable.dtype.kind == "f"
    rows = np.empty((len(lines), variable.size), dtype=np.float64 if is_number else variable.dtype)
    if base is not None:
        rows[:] = np.asarray(base, dtype=variable.dtype).reshape(-1)
    for element, column in taken.items():
        what = f"{path}: column {name!r}"
        given = units.get(column, "")
        own_units = {unit.shown(own): own for own in (variable.display_unit, variable.unit)}  # as the FMU calls them
        given = own_units.get(given, given)
        factor, offset = unit.conversion(given, variable.unit, what)
        part = slice(None) if element < 0 else element
        if element >= 0 or not variable.shape:
            element = max(element, 0)  # noqa: PLW2901
            with suppress(FMUError):
                parse = values.scalar_of(variable, items, "")
                rows[:, element] = [parse(cells[column]) for _, cells in lines]
                if not is_number:
                    continue
                if np.isfinite(rows[:, element]).all():
                    rows[:, element] = rows[:, element] * factor + offset
                    continue
        for row, (line, cells) in enumerate(lines):  # once more, to say what is wrong in which line
            location = f"{path}:{line}"
            if element < 0:
                rows[row] = values.array(variable, cells[column], items, location).reshape(-1)
            else:
                rows[row, element] = values.scalar_of(variable, items, location)(cells[column])
            if is_number:
                if not np.all(np.isfinite(rows[row, part])):
                    raise FMUError(f"{location}: {name} is {cells[column]}, expected a finite number. Fill the gap.")
                rows[row, part] = rows[row, part] * factor + offset
    return InputColumn(variable, rows)


@dataclass
class Results:
    """What was recorded: times [ns], and per variable an array of rows x scalars."""

    times: list[clock.Time]
    variables: list[MemberVariable]
    rows: list[np.ndarray[Any, Any]]

    def columns(self) -> list[tuple[str, MemberVariable, np.ndarray[Any, Any]]]:
        """Name, variable and values of every scalar."""
        return [
            (name, variable, rows[:, i])
            for variable, rows in zip(self.variables, self.rows, strict=True)
            for i, name in enumerate(values.elements(variable))
        ]


def check_output(path: Path) -> None:
    """Say before a long run, not after it, that its results cannot be written."""
    if path.suffix.lower() not in FORMATS:
        raise FMUError(f"{path}: results are written as {' or '.join(FORMATS)}. Name the file so.")
    if not path.parent.is_dir():
        raise FMUError(f"{path}: the folder {path.parent} is not there. Make it first.")
    if path.is_dir():
        raise FMUError(f"{path}: is a folder. Name a file.")


def write(results: Results, path: Path) -> None:
    """Write results as CSV or Parquet, by extension."""
    try:
        if path.suffix.lower() == ".parquet":
            write_parquet(results, path)
        else:
            write_csv(results, path)
    except OSError as error:
        raise TwinError(f"{path}: cannot be written ({error.strerror or error}). Choose another place.") from None


def quoted(text: str) -> str:
    """Text as CSV quotes it."""
    return '"' + text.replace('"', '""') + '"'


def cells(variable: MemberVariable, column: np.ndarray[Any, Any]) -> list[str]:
    """A column as CSV text: shortest decimals that read back the same, Boolean 0 or 1, Binary in hexadecimal."""
    if variable.type == "String":
        return [quoted(text) for text in column]
    if variable.type == "Binary":
        return [data.hex() for data in column]
    if variable.type in ("Boolean", "Clock"):
        return [str(int(value)) for value in column]
    if variable.type == "Float32":
        return [str(value) for value in column]
    return [repr(value) for value in column.tolist()]


def write_csv(results: Results, path: Path) -> None:
    """Header `time,name,...`, a name with a comma in quotes; one row per recorded time."""
    columns = results.columns()
    names = [quoted(name) if set(name) & set(',"\n\r') else name for name, _, _ in columns]
    texts = [[repr(clock.seconds(time)) for time in results.times]]
    texts += [cells(variable, column) for _, variable, column in columns]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(["time", *names]) + "\n")
        file.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))


def write_parquet(results: Results, path: Path) -> None:
    """One column per scalar, its unit in the metadata of the field."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [pa.field("time", pa.float64(), metadata={"unit": "s"})]
    arrays = [pa.array([clock.seconds(time) for time in results.times], pa.float64())]
    for name, variable, column in results.columns():
        if variable.dtype.kind == "O":
            array = pa.array(list(column), pa.string() if variable.type == "String" else pa.binary())
        else:
            array = pa.array(column.astype(np.bool_) if variable.type == "Boolean" else np.ascontiguousarray(column))
        fields.append(pa.field(name, array.type, metadata={"unit": variable.unit}))
        arrays.append(array)
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path)
