"""Measured data of a set: windows with inputs on the communication grid, and measurements at their own times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError, TwinError
from twin.identify import FileKeys, RecordedFile, TableKeys

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from twin.arrays import Array
    from twin.validation.schema import SetKeys

JUMP = 2.0  # times the largest change between rows of the training windows, if any: what is larger is no motion


@dataclass(frozen=True)
class Data:
    """Runs of a set. N samples in all, grid rows G >= N where samples are resampled.

    `inputs`: per window, shape (grid rows, inputs); `initial`: parameter -> value per window. `measured`: shape (N,
    outputs), `rates`: derivatives of outputs at each window's first sample, shape (windows, outputs), 0 where not
    measured. `time`: in the file [s]. `lower`, `weight`: a sample lies between grid rows `lower` and `lower + 1`. `jumps`:
    number of windows that begin because a column jumps; `changes`: largest change of each column between rows of a
    window. `turned`: outputs that some windows have with the opposite sign. All in units of the component's variables.
    """

    files: tuple[str, ...]
    hashes: tuple[str, ...]
    step: float
    inputs: tuple[Array, ...]
    initial: Mapping[str, Array]
    measured: Array
    rates: Array
    time: Array
    file_index: Array
    window_index: Array
    lower: Array
    weight: Array
    labels: Array  # of folds by column; empty otherwise
    jumps: int
    changes: Mapping[str, float]
    turned: tuple[int, ...] = ()

    def at_samples(self, grid: Array) -> Array:
        """Interpolate values on the grid, shape (G, ...), to the samples, shape (N, ...)."""
        upper = np.minimum(self.lower + 1, len(grid) - 1)
        weight = self.weight.reshape(-1, *[1] * (grid.ndim - 1))
        interpolated: Array = (1 - weight) * grid[self.lower] + weight * grid[upper]
        return interpolated

    def first_measured(self) -> Array:
        """Measurements at the first sample of each window, shape (windows, outputs)."""
        _, first = np.unique(self.window_index, return_index=True)
        return np.asarray(self.measured[first])


def recorded_file(keys: SetKeys, folder: Path, name: str) -> RecordedFile:
    """A file with the columns of a set."""
    table = {key: getattr(keys, key) for key in TableKeys.model_fields}
    return RecordedFile(FileKeys.model_construct(file=name, **table), folder)


def missing_columns(keys: SetKeys, folder: Path, name: str) -> int:
    """Number of columns that a set needs and a file lacks; 0 if the file cannot be read."""
    columns = {*keys.inputs, *keys.outputs, *keys.initial.values(), *(o.rate for o in keys.outputs.values() if o.rate)}
    sources = {keys.columns[column].name or column if column in keys.columns else column for column in columns}
    try:
        return len(sources.difference(recorded_file(keys, folder, name).names_in_file))
    except (TwinError, OSError):
        return 0


class SetReader:
    """Reads the files of a set; `units`: of the component's variables, by variable.

    `changes`: largest change of each column between rows of the training windows; a larger jump begins a new window.
    """

    def __init__(self, keys: SetKeys, units: Mapping[str, str], window: int, changes: Mapping[str, float]) -> None:
        self.keys, self.units, self.window, self.changes = keys, units, window, changes
        assert keys.step is not None, "the file was checked"
        self.step = clock.seconds(keys.step)
        self.targets = {
            **keys.inputs,
            **{column: output.signal for column, output in keys.outputs.items()},
        }

    def read(self, folder: Path, names: Sequence[str]) -> Data:
        """Read files, named relative to a folder. A TwinError names file and row."""
        parts = [self.windows(folder, name) for name in names]
        windows = [window for part in parts for window in part[0]]
        inputs, lowers, weights, begin = [], [], [], 0
        for window in windows:
            grid, lower, weight = self.gridded(window)
            inputs.append(grid)
            lowers.append(lower + begin)
            weights.append(weight)
            begin += len(grid)
        counts = [len(window["time"]) for window in windows]
        keys = self.keys
        return Data(
            tuple(names),
            tuple(part[1] for part in parts),
            self.step,
            tuple(inputs),
            {
                parameter: np.array([window[f"initial {parameter}"][0] for window in windows])
                for parameter in keys.initial
            },
            np.concatenate([np.stack([window[column] for column in keys.outputs], 1) for window in windows]),
            np.array(
                [[window[f"rate {c}"][0] if o.rate else 0.0 for c, o in keys.outputs.items()] for window in windows]
            ),
            np.concatenate([window["time"] for window in windows]),
            np.repeat(np.arange(len(parts)), [sum(len(w["time"]) for w in part[0]) for part in parts]),
            np.repeat(np.arange(len(windows)), counts),
            np.concatenate(lowers),
            np.concatenate(weights),
            np.concatenate([part[2] for part in parts]),
            sum(part[3] for part in parts),
            {
                column: float(max(np.max(np.abs(np.diff(window[column])), initial=0.0) for window in windows))
                for column in self.targets
            },
            tuple([*keys.outputs].index(column) for column in keys.turned),
        )

    def windows(self, folder: Path, name: str) -> tuple[list[dict[str, Array]], str, Array, int]:
        """Columns of each window of a file in the variables' units, its hash, fold labels of its rows, and its jumps."""
        keys, file = self.keys, recorded_file(self.keys, folder, name)
        columns: dict[str, Array] = {}
        rates = {f"rate {c}": (o.rate, o.signal, "/s") for c, o in keys.outputs.items() if o.rate}
        wanted = {
            **{column: (column, variable, "") for column, variable in self.targets.items()},
            **{f"initial {parameter}": (column, parameter, "") for parameter, column in keys.initial.items()},
            **rates,
        }
        read = {column: file.column(column) for column, _, _ in wanted.values()}
        time = next(iter(read.values())).time
        for name_of_column, column_data in read.items():
            if keys.missing == "drop":  # a row counts if no column misses it
                time = np.intersect1d(time, column_data.time)
            elif len(column_data.time) != len(time):
                raise TwinError(
                    f"{name}: {name_of_column} has {len(column_data.time)} rows, other columns {len(time)}. "
                    "Leave out the incomplete rows, or set missing: drop."
                )
        for label, (column, variable, per) in wanted.items():
            factor, offset = self.conversion(read[column].unit, variable, per, name)
            values = read[column].values
            rows = np.isin(read[column].time, time) if len(values) > len(time) else slice(None)
            columns[label] = values[rows] * factor + offset
        labels = self.labels(file, len(time))
        jumps = self.jumps(columns)
        parts = self.parts(len(time), jumps, name)
        windows = [{"time": time[part], **{key: values[part] for key, values in columns.items()}} for part in parts]
        return windows, file.sha256, labels[: parts[-1].stop], len(jumps)

    def jumps(self, columns: Mapping[str, Array]) -> list[int]:
        """Rows at which a column jumps as no motion does, where windows of the file join; none without windows."""
        if not self.window:
            return []
        is_jump = [
            np.abs(np.diff(columns[column])) > JUMP * change for column, change in self.changes.items() if change > 0.0
        ]
        return (np.flatnonzero(np.any(is_jump, axis=0)) + 1).tolist() if is_jump else []

    def parts(self, count: int, jumps: Sequence[int], name: str) -> list[slice]:
        """Rows of each window: at most `window` rows, not across jumps; an incomplete last window is left out."""
        size = self.window or count
        if size > count:
            raise TwinError(f"{name}: has {count} rows, fewer than a window of {size}. Choose a shorter window.")
        parts = [
            slice(begin, min(begin + size, end))
            for first, end in zip([0, *jumps], [*jumps, count], strict=True)
            for begin in range(first, end, size)
        ]
        if not jumps and parts[-1].stop - parts[-1].start < size:
            parts.pop()
        return parts

    def labels(self, file: RecordedFile, count: int) -> Array:
        """Fold labels of the rows, if folds are by column; none if the file lacks them, which matters for fits only."""
        if self.keys.folds.by != "column":
            return np.zeros(0)
        header, rows = file.table
        if self.keys.folds.column not in header or len(rows) != count:
            return np.zeros(0)
        index = header.index(self.keys.folds.column)
        return np.array([row[index].strip() for _, row in rows])

    def conversion(self, symbol: str, variable: str, per: str, name: str) -> tuple[float, float]:
        """Factor and offset from the unit of a column to that of a variable (or its derivative)."""
        target = self.units[variable]
        try:
            if per:
                return unit.conversion(symbol, f"{target}{per}", name)
            return unit.conversion(symbol, target, name)
        except CouplingError as error:
            raise TwinError(f"{error} Correct the unit in `columns`.") from None

    def gridded(self, window: Mapping[str, Array]) -> tuple[Array, Array, Array]:
        """Inputs on the grid of the communication step, and where the samples lie on it: row and weight."""
        position = (window["time"] - window["time"][0]) / self.step
        nearest_row = np.round(position)
        rows = np.where(np.abs(position - nearest_row) < 1e-6, nearest_row, position)
        count = int(np.ceil(rows[-1])) + 1
        inputs = []
        for column in self.keys.inputs:
            values = np.interp(np.arange(count), position, window[column])
            # a row after the last sample: on the straight line through that sample and the value one step before it
            values[-1] += (count - 1 - rows[-1]) * (values[-1] - np.interp(rows[-1] - 1.0, position, window[column]))
            inputs.append(values)
        lower = np.minimum(rows.astype(np.int64), count - 1)
        return np.stack(inputs, 1), lower, rows - lower
