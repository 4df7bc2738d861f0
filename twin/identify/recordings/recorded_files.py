"""Recorded files: columns over time from CSV, MATLAB, Parquet, the folder of a run, or a decoded bus trace.

A column of a decoded trace (`twin can decode --csv`) is a name in its cell `values`; its rows are the frames that have it.
A TwinError names file and line.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.identify import tables
from twin.results import calibration, list_recorded_variables, read_variables

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.arrays import Array
    from twin.identify.recordings.schema import FileKeys

TRACE = ["time [s]", "id", "data", "node", "service", "text", "values"]  # what `twin can decode --csv` writes
TIMES = ("time", "t")
GAP = 5.0  # typical distances between rows: what is longer is a gap


@dataclass(frozen=True)
class Column:
    """Values over the run's time [s], in `unit` ("": not stated). `lines`: of the file, 0 if it has none."""

    file: str
    name: str
    unit: str
    time: Array
    values: Array
    lines: Array = field(repr=False)

    def where(self, row: int) -> str:
        """file:line."""
        line = int(self.lines[row]) if len(self.lines) else 0
        return f"{self.file}:{line}" if line else f"{self.file}: row {row + 1}"

    def refuse_gaps(self, longest_ns: int | None, begin: float, end: float) -> None:
        """TwinError if there is a gap between two times [s] that no line may be drawn through."""
        distances = np.diff(self.time)
        longest = GAP * float(np.median(distances)) if longest_ns is None else clock.seconds(longest_ns)
        inside = (self.time[1:] > begin) & (self.time[:-1] < end)
        rows = np.flatnonzero((distances > longest * (1 + 1e-9)) & inside)
        if not len(rows):
            return
        row = int(rows[0])
        raise TwinError(
            f"{self.where(row + 1)}: {self.name} has no values for {distances[row]:.4g} s before this row. "
            f"Choose from and to without the gap, or allow it: gap: {distances[row]:.4g} s."
        )


class RecordedFile:
    """A recorded file; what is in it is read when it is asked for."""

    def __init__(self, keys: FileKeys, folder: Path) -> None:
        self.keys = keys
        self.shown = keys.file
        self.path = located(folder / keys.file, keys.file)
        self._numbers: dict[str, Array] = {}

    @cached_property
    def sha256(self) -> str:
        """Hash of the file."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    @cached_property
    def is_run(self) -> bool:
        """Whether it is what a run recorded."""
        from pyarrow import ArrowInvalid, parquet

        if self.path.suffix != ".parquet":
            return False
        try:
            return {"variant", "seed", "time"} <= set(parquet.read_schema(self.path).names)
        except (ArrowInvalid, OSError) as error:
            raise TwinError(f"{self.shown}: is no Parquet file ({error}).") from None

    @cached_property
    def table(self) -> tuple[list[str], list[tuple[int, list[str]]]]:
        """Header and rows of a CSV file."""
        header, rows = tables.expand_lists(*calibration.read_rows(self.path), self.shown)
        if not header:
            raise TwinError(f"{self.shown}: is empty. Give a header `time [s],...` and rows.")
        if twice := [name for name in header if name and header.count(name) > 1]:
            raise TwinError(f"{self.shown}:1: column {twice[0]} is there twice. Rename one.")
        return header, rows

    @cached_property
    def matlab(self) -> dict[str, Array]:
        """Columns of a MATLAB file by name."""
        return tables.read_matlab(self.path, self.shown)

    @property
    def is_trace(self) -> bool:
        """Whether it is a decoded bus trace."""
        return self.path.suffix not in (".parquet", ".mat") and self.table[0] == TRACE

    @property
    def names(self) -> list[str]:
        """Names of its columns: those that `columns` gives, and those in the file."""
        return [*self.keys.columns, *(name for name in self.names_in_file if name not in self.keys.columns)]

    @cached_property
    def names_in_file(self) -> list[str]:
        """Names of its columns as the file has them."""
        if self.path.suffix == ".mat":
            return list(self.matlab)
        if self.path.suffix != ".parquet":
            return self.trace_names() if self.is_trace else self.table[0]
        if self.is_run:
            return [column for variable in list_recorded_variables(self.path).values() for column in variable.columns]
        from pyarrow import parquet

        return list(parquet.read_schema(self.path).names)

    def trace_names(self) -> list[str]:
        """Names of what the process data of a trace say."""
        names = dict.fromkeys(
            pair.partition("=")[0] for _, row in self.table[1] if self.is_of_node(row) for pair in row[6].split()
        )
        return list(names)

    def is_of_node(self, row: list[str]) -> bool:
        """Whether a row of a trace is process data of the node that is meant."""
        return row[4] == "PDO" and (self.keys.node is None or row[3] == str(self.keys.node))

    def column(self, name: str) -> Column:
        """A column over the run's time; rows where the whole cell is empty are none of its rows in a trace only."""
        alias = self.keys.columns.get(name)
        column = alias.name if alias and alias.name else name
        if column not in self.names_in_file:
            raise TwinError(f"{self.shown}: there is no column `{column}`. {nearest(column, self.names_in_file, '`')}")
        symbol = ""
        if self.path.suffix == ".parquet":
            time, values, symbol = self.parquet(column)
            lines = np.zeros(0, np.int64)
        elif self.path.suffix == ".mat":
            values, lines = self.matlab[column], np.zeros(0, np.int64)
            time = self.times(list(self.matlab), len(values), self.matlab.__getitem__)
        else:
            lines, time, values = self.trace(column) if self.is_trace else self.csv(column)
        symbol = alias.unit if alias and alias.unit else symbol or unit.split_header(column)[1]
        column_data = Column(self.shown, column, symbol, time - clock.seconds(self.keys.start), values, lines)
        return checked(tables.cleaned(column_data, self.keys))

    def times(self, header: list[str], count: int, read: Callable[[str], Array]) -> Array:
        """Times [s] of the rows: `sample_time` apart, or the column of times, which `read` reads."""
        if self.keys.sample_time is not None:
            return np.arange(count) * clock.seconds(self.keys.sample_time)
        name = self.time_name(header)
        return read(name) * self.seconds_of(name)

    def seconds_of(self, name: str) -> float:
        """Seconds in the unit of the column of times: that of `columns`, or of its header."""
        given = [alias.unit for key, alias in self.keys.columns.items() if name in (key, alias.name) and alias.unit]
        return seconds(f"{unit.split_header(name)[0]} [{given[0]}]" if given else name, self.shown)

    def time_name(self, header: list[str]) -> str:
        """The column of times."""
        alias = self.keys.columns.get(self.keys.time)
        if alias is not None and alias.name in header:
            return alias.name
        if self.keys.time:
            if self.keys.time not in header:
                raise TwinError(
                    f"{self.shown}: there is no column `{self.keys.time}`. {nearest(self.keys.time, header)}"
                )
            return self.keys.time
        for name in header:
            if unit.split_header(name)[0].lower() in TIMES:
                return name
        raise TwinError(
            f"{self.shown}: has no column `time`. Say which one it is, such as time: {header[0]!r}, or how far its "
            f"rows are apart, such as sample_time: 2 ms."
        )

    def csv(self, name: str) -> tuple[Array, Array, Array]:
        """Lines, times [s] and values of a column of a table."""
        header, rows = self.table
        lines = np.array([number for number, _ in rows], np.int64)
        return lines, self.times(header, len(rows), self.numbers), self.numbers(name)

    def numbers(self, name: str) -> Array:
        """Numbers of a column of a table, by its name in the file; read once."""
        if name not in self._numbers:
            header, rows = self.table
            self._numbers[name] = tables.numbers(
                rows, header, header.index(name), self.shown, may_be_missing=self.keys.missing == "drop"
            )
        return self._numbers[name]

    def trace(self, name: str) -> tuple[Array, Array, Array]:
        """Lines, times [s] and values of a name in the process data of a trace."""
        samples = []
        nodes: dict[str, int] = {}
        for number, row in self.table[1]:
            if not self.is_of_node(row) or f"{name}=" not in row[6]:
                continue
            pairs = dict(pair.split("=", 1) for pair in row[6].split())
            if name in pairs:
                nodes.setdefault(row[3], number)
                time = calibration.parse_cell(row, 0, TRACE, f"{self.shown}:{number}")
                samples.append(
                    (number, time, calibration.parse_cell([pairs[name]], 0, [name], f"{self.shown}:{number}"))
                )
        if len(nodes) > 1:
            listed = ", ".join(sorted(nodes, key=int))
            raise TwinError(f"{self.shown}: nodes {listed} have {name}. Say which one: node: {min(nodes, key=int)}.")
        table = np.array(samples, np.float64).reshape(-1, 3)
        return table[:, 0], table[:, 1], table[:, 2]

    def parquet(self, name: str) -> tuple[Array, Array, str]:
        """Times [s], values and unit of a column of a run, or of any other Parquet file."""
        if self.is_run:
            return self.run(name)
        from pyarrow import parquet

        def read(column: str) -> Array:
            cells = parquet.read_table(self.path, columns=[column])[column]
            if cells.null_count and self.keys.missing == "refuse":
                row = cells.is_null().to_pylist().index(True)
                raise TwinError(f"{self.shown}: row {row + 1}: {column} is missing. Leave the row out.")
            try:
                return np.asarray(cells.to_numpy(), np.float64)
            except (TypeError, ValueError):
                raise TwinError(f"{self.shown}: {column} has no numbers but {cells.type}.") from None

        values = read(name)
        noted = (parquet.read_schema(self.path).field(name).metadata or {}).get(b"unit", b"").decode()
        return self.times(self.names_in_file, len(values), read), values, noted

    def run(self, name: str) -> tuple[Array, Array, str]:
        """Times [s], values and unit of a signal of one case of a run."""
        variable, at = next(
            (variable, variable.columns.index(name))
            for variable in list_recorded_variables(self.path).values()
            if name in variable.columns
        )
        cases = read_variables(self.path, [variable])
        own = [
            case
            for case in cases
            if self.keys.variant in ("", case[0]) and (self.keys.seed is None or self.keys.seed == case[1])
        ]
        if len(own) != 1:
            listed = "; ".join(f"variant: {variant!r}, seed: {seed}" for variant, seed in cases)
            raise TwinError(f"{self.shown}: {len(own) or 'no'} cases are meant. Say which one: {listed}.")
        signals = cases[own[0]]
        values = np.asarray(signals.values[variable.name], np.float64).reshape(len(signals.time), -1)[:, at]
        return signals.time, values, variable.unit


def located(path: Path, shown: str) -> Path:
    """The file that is meant: of a run's folder its signals, of a scenario's folder those of its newest run."""
    if path.name == "latest" and not path.is_dir():
        path = path.parent
    if path.is_dir():
        there = sorted(folder.parent for folder in path.glob("*/signals.parquet"))
        path = (path if not there else there[-1]) / "signals.parquet"
    if not path.is_file():
        hint = nearest(path.name, [folder.name for folder in path.parent.glob("*")]) if path.parent.is_dir() else ""
        raise TwinError(f"there is no file {shown}. {hint or 'Give a path relative to this file.'}")
    return path


def seconds(name: str, shown: str) -> float:
    """Factor from the unit of a column of times to seconds."""
    symbol = unit.split_header(name)[1] or "s"
    try:
        return unit.conversion(symbol, "s", name)[0]
    except CouplingError:
        raise TwinError(f"{shown}: {name} is no time. Give it in s or ms.") from None


def checked(column: Column) -> Column:
    """The column, if it has rows, times that go on, and finite values."""
    if len(column.time) < 2:
        raise TwinError(f"{column.file}: {column.name} has {len(column.time)} values. Two at least are needed.")
    for what, values in (("time", column.time), (column.name, column.values)):
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise TwinError(
                f"{column.where(row)}: {what} is {values[row]}, expected a finite number. Leave the row out."
            )
    steps = np.diff(column.time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        relation = "the same as" if steps[row - 1] == 0 else "before that of"
        raise TwinError(f"{column.where(row)}: time is {relation} the row above. Sort the rows, each time once.")
    return column
