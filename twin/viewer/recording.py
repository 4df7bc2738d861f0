"""Recorded signals of a finished run: columns of signals.parquet, read on demand and cached.

Cases are located by the statistics of the row groups, without reading samples.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.results import list_recorded_variables, readable_recording

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable
    from pathlib import Path

    from twin.results import RecordedVariable

    Array = np.ndarray[Any, Any]

CACHE_SIZE = 1_500_000_000  # of cached columns of all runs [byte]: eighteen of ten million samples


class ColumnCache:
    """LRU cache of arrays, limited by size."""

    def __init__(self, capacity: int = CACHE_SIZE) -> None:
        self.capacity, self.size = capacity, 0
        self.arrays: OrderedDict[Hashable, tuple[Array, ...]] = OrderedDict()
        self.lock = threading.RLock()

    def get(self, key: Hashable, compute: Callable[[], tuple[Array, ...]]) -> tuple[Array, ...]:
        """Return the arrays of a key, computed if absent; one computation at a time."""
        with self.lock:
            if key in self.arrays:
                self.arrays.move_to_end(key)
                return self.arrays[key]
            entry = self.arrays[key] = compute()
            self.size += sum(array.nbytes for array in entry)
            while self.size > self.capacity and len(self.arrays) > 1:
                _, evicted = self.arrays.popitem(last=False)
                self.size -= sum(array.nbytes for array in evicted)
            return entry

    def forget(self, owner: Path) -> None:
        """Remove all arrays of a recording, and those derived from them."""
        with self.lock:
            for key in [key for key in self.arrays if isinstance(key, tuple) and owner in key]:
                self.size -= sum(array.nbytes for array in self.arrays.pop(key))


class RecordedColumns(ABC):
    """Recorded columns of all cases. A name is that of a column: `sensor.force`, or an element `sheath.x[2]`."""

    variables: dict[str, RecordedVariable]
    column_indices: dict[str, int]  # of all columns, including `variant`, `seed` and `time`

    def __init__(self, path: Path, cache: ColumnCache) -> None:
        self.path, self.cache = path, cache

    @property
    @abstractmethod
    def cases(self) -> Collection[tuple[str, int]]:
        """Variant and seed of each case, in order."""

    @abstractmethod
    def samples(self, case: tuple[str, int]) -> int:
        """Return the number of samples of a case."""

    @abstractmethod
    def span(self, case: tuple[str, int]) -> tuple[float, float]:
        """Return first and last time of a case [s]."""

    @abstractmethod
    def has(self, case: tuple[str, int], name: str) -> bool:
        """Return whether a case recorded a column."""

    @abstractmethod
    def column(self, case: tuple[str, int], name: str) -> Array:
        """Return the values of a column in one case, (n,); Booleans as 0 and 1. Shared: callers must not modify them."""

    @abstractmethod
    def is_boolean(self, name: str) -> bool:
        """Return whether a column has Booleans."""

    def values(self, case: tuple[str, int], name: str) -> Array:
        """Return a variable in one case, arrays as (n, ...)."""
        variable = self.variables[name]
        if not variable.shape:
            return self.column(case, name)
        columns = [self.column(case, column) for column in variable.columns]
        return np.stack(columns, 1).reshape(-1, *variable.shape)


@dataclass(frozen=True)
class RowRange:
    """Rows of a row group that belong to one case."""

    group: int
    begin: int
    end: int


class ParquetRecording(RecordedColumns):
    """The columns of a Parquet file."""

    def __init__(self, path: Path, cache: ColumnCache) -> None:
        from pyarrow import ArrowException, parquet

        super().__init__(path, cache)
        try:
            self.file = parquet.ParquetFile(path, memory_map=False)
            self.variables = list_recorded_variables(path)
        except (ArrowException, OSError) as error:
            raise TwinError(f"{path}: cannot be read ({str(error).splitlines()[0]}). Run the scenario again.") from None
        self.column_indices = {name: index for index, name in enumerate(self.file.schema_arrow.names)}
        if not {"variant", "seed", "time"} <= self.column_indices.keys():
            raise TwinError(
                f"{path}: is not a recording: columns variant, seed and time are missing. Give the folder of a run."
            )
        self._rows = self._cases()

    @property
    def cases(self) -> Collection[tuple[str, int]]:
        """Variant and seed of each case, in order."""
        return self._rows.keys()

    def _cases(self) -> dict[tuple[str, int], list[RowRange]]:
        rows_by_case: dict[tuple[str, int], list[RowRange]] = {}
        metadata = self.file.metadata
        for group in range(metadata.num_row_groups):
            rows = metadata.row_group(group)
            edges = [rows.column(self.column_indices[name]).statistics for name in ("variant", "seed")]
            if all(edge is not None and edge.has_min_max and edge.min == edge.max for edge in edges):
                rows_by_case.setdefault((str(edges[0].min), int(edges[1].min)), []).append(
                    RowRange(group, 0, rows.num_rows)
                )
                continue
            table = self.file.read_row_group(group, columns=["variant", "seed"])
            names, seeds = np.array(table["variant"].to_pylist(), object), table["seed"].to_numpy()
            changes = np.flatnonzero((names[1:] != names[:-1]) | (seeds[1:] != seeds[:-1])) + 1
            for begin, end in zip([0, *changes.tolist()], [*changes.tolist(), len(seeds)], strict=True):
                if begin < end:
                    rows_by_case.setdefault((str(names[begin]), int(seeds[begin])), []).append(
                        RowRange(group, begin, end)
                    )
        return rows_by_case

    def samples(self, case: tuple[str, int]) -> int:
        """Return the number of samples of a case."""
        return sum(row.end - row.begin for row in self._rows[case])

    def span(self, case: tuple[str, int]) -> tuple[float, float]:
        """Return first and last time of a case [s], from statistics if available."""
        edges = [
            self.file.metadata.row_group(row.group).column(self.column_indices["time"]).statistics
            for row in self._rows[case]
        ]
        is_complete = all(
            rows.begin == 0 and rows.end == self.file.metadata.row_group(rows.group).num_rows
            for rows in self._rows[case]
        )
        if is_complete and all(edge is not None and edge.has_min_max for edge in edges):
            return float(edges[0].min) + 0.0, float(edges[-1].max) + 0.0
        time = self.column(case, "time")
        return (float(time[0]), float(time[-1])) if len(time) else (0.0, 0.0)

    def has(self, case: tuple[str, int], name: str) -> bool:
        """Return whether a case recorded a column; columns of other cases exist, but are null."""
        index = self.column_indices.get(name)
        if index is None or not self._rows[case]:
            return False
        statistics = self.file.metadata.row_group(self._rows[case][0].group).column(index).statistics
        return (
            statistics is None
            or not statistics.has_null_count
            or statistics.null_count < statistics.num_values + statistics.null_count
        )

    def column(self, case: tuple[str, int], name: str) -> Array:
        """Return the values of a column in one case, (n,)."""

        def read() -> tuple[Array, ...]:
            parts = []
            for rows in self._rows[case]:
                with readable_recording(self.path):
                    table = self.file.read_row_group(rows.group, columns=[name])
                parts.append(table[name].slice(rows.begin, rows.end - rows.begin).to_numpy())
            values = parts[0] if len(parts) == 1 else np.concatenate(parts)
            if values.dtype == object:  # Booleans with missing values
                values = np.array([np.nan if value is None else float(value) for value in values])
            return (values.view(np.uint8) if values.dtype == bool else values,)

        (values,) = self.cache.get((self.path, case, name), read)
        return values

    def is_boolean(self, name: str) -> bool:
        """Return whether a column has Booleans."""
        return str(self.file.schema_arrow.field(name).type) == "bool"
