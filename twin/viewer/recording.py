"""A signals.parquet, of which a column of one case is read when somebody looks at it, and kept while there is room.

Cases are found by the statistics of the file's row groups: to open ten million samples reads none of them.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.results import list_recorded_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable
    from pathlib import Path

    from twin.results import RecordedVariable

    Array = np.ndarray[Any, Any]

ROOM = 1_500_000_000  # of columns that are kept, of all runs together [byte]: eighteen of ten million samples


class Room:
    """Arrays that were looked at last; those that nobody looks at go when it is full."""

    def __init__(self, most: int = ROOM) -> None:
        self.most, self.size = most, 0
        self.kept: OrderedDict[Hashable, tuple[Array, ...]] = OrderedDict()
        self.lock = threading.RLock()

    def take(self, key: Hashable, make: Callable[[], tuple[Array, ...]]) -> tuple[Array, ...]:
        """What is kept under a key, made if it is not; one is made at a time."""
        with self.lock:
            if key in self.kept:
                self.kept.move_to_end(key)
                return self.kept[key]
            made = self.kept[key] = make()
            self.size += sum(one.nbytes for one in made)
            while self.size > self.most and len(self.kept) > 1:
                _, gone = self.kept.popitem(last=False)
                self.size -= sum(one.nbytes for one in gone)
            return made

    def forget(self, owner: Path) -> None:
        """Drop all that is kept of a recording, and what was made of it."""
        with self.lock:
            for key in [one for one in self.kept if isinstance(one, tuple) and owner in one]:
                self.size -= sum(one.nbytes for one in self.kept.pop(key))


class Columns(ABC):
    """What cases recorded, column by column. A name is that of a column: `sensor.force`, or an element `sheath.x[2]`."""

    variables: dict[str, RecordedVariable]
    places: dict[str, int]  # of all columns, `variant`, `seed` and `time` too

    def __init__(self, path: Path, room: Room) -> None:
        self.path, self.room = path, room

    @property
    @abstractmethod
    def cases(self) -> Collection[tuple[str, int]]:
        """Variant and seed of each case, in order."""

    @abstractmethod
    def samples(self, case: tuple[str, int]) -> int:
        """How many a case has."""

    @abstractmethod
    def span(self, case: tuple[str, int]) -> tuple[float, float]:
        """First and last time of a case [s]."""

    @abstractmethod
    def has(self, case: tuple[str, int], name: str) -> bool:
        """Whether a case recorded a column."""

    @abstractmethod
    def column(self, case: tuple[str, int], name: str) -> Array:
        """The values of a column in one case, (n,); Booleans as 0 and 1. Never written to: others look at them too."""

    @abstractmethod
    def is_truth(self, name: str) -> bool:
        """Whether a column has Booleans."""

    def values(self, case: tuple[str, int], name: str) -> Array:
        """A variable in one case, an array whole, (n, ...)."""
        variable = self.variables[name]
        if not variable.shape:
            return self.column(case, name)
        columns = [self.column(case, one) for one in variable.columns]
        return np.stack(columns, 1).reshape(-1, *variable.shape)


@dataclass(frozen=True)
class Rows:
    """Some rows of a row group that belong to one case."""

    group: int
    begin: int
    end: int


class Recording(Columns):
    """The columns of a file."""

    def __init__(self, path: Path, room: Room) -> None:
        from pyarrow import ArrowException, parquet

        super().__init__(path, room)
        try:
            self.file = parquet.ParquetFile(path, memory_map=False)
            self.variables = list_recorded_variables(path)
        except (ArrowException, OSError) as error:
            raise TwinError(f"{path}: cannot be read ({str(error).splitlines()[0]}). Run the scenario again.") from None
        self.places = {name: place for place, name in enumerate(self.file.schema_arrow.names)}
        if not {"variant", "seed", "time"} <= self.places.keys():
            raise TwinError(
                f"{path}: is no recording: it has no columns variant, seed and time. Give the folder of a run."
            )
        self._rows = self._cases()

    @property
    def cases(self) -> Collection[tuple[str, int]]:
        """Variant and seed of each case, in order."""
        return self._rows.keys()

    def _cases(self) -> dict[tuple[str, int], list[Rows]]:
        """The rows of each case."""
        found: dict[tuple[str, int], list[Rows]] = {}
        about = self.file.metadata
        for group in range(about.num_row_groups):
            rows = about.row_group(group)
            edges = [rows.column(self.places[name]).statistics for name in ("variant", "seed")]
            if all(one is not None and one.has_min_max and one.min == one.max for one in edges):
                found.setdefault((str(edges[0].min), int(edges[1].min)), []).append(Rows(group, 0, rows.num_rows))
                continue
            table = self.file.read_row_group(group, columns=["variant", "seed"])
            names, seeds = np.array(table["variant"].to_pylist(), object), table["seed"].to_numpy()
            changes = np.flatnonzero((names[1:] != names[:-1]) | (seeds[1:] != seeds[:-1])) + 1
            for begin, end in zip([0, *changes.tolist()], [*changes.tolist(), len(seeds)], strict=True):
                if begin < end:
                    found.setdefault((str(names[begin]), int(seeds[begin])), []).append(Rows(group, begin, end))
        return found

    def samples(self, case: tuple[str, int]) -> int:
        """How many a case has."""
        return sum(one.end - one.begin for one in self._rows[case])

    def span(self, case: tuple[str, int]) -> tuple[float, float]:
        """First and last time of a case [s], from statistics where they tell."""
        edges = [
            self.file.metadata.row_group(one.group).column(self.places["time"]).statistics for one in self._rows[case]
        ]
        whole = all(
            rows.begin == 0 and rows.end == self.file.metadata.row_group(rows.group).num_rows
            for rows in self._rows[case]
        )
        if whole and all(one is not None and one.has_min_max for one in edges):
            return float(edges[0].min) + 0.0, float(edges[-1].max) + 0.0
        time = self.column(case, "time")
        return (float(time[0]), float(time[-1])) if len(time) else (0.0, 0.0)

    def has(self, case: tuple[str, int], name: str) -> bool:
        """Whether a case recorded a column: one that it did not is there, and empty."""
        place = self.places.get(name)
        if place is None or not self._rows[case]:
            return False
        told = self.file.metadata.row_group(self._rows[case][0].group).column(place).statistics
        return told is None or not told.has_null_count or told.null_count < told.num_values + told.null_count

    def column(self, case: tuple[str, int], name: str) -> Array:
        """The values of a column in one case, (n,)."""

        def read() -> tuple[Array, ...]:
            parts = []
            for rows in self._rows[case]:
                column = self.file.read_row_group(rows.group, columns=[name])[name].slice(
                    rows.begin, rows.end - rows.begin
                )
                parts.append(column.to_numpy())
            values = parts[0] if len(parts) == 1 else np.concatenate(parts)
            if values.dtype == object:  # Booleans, some of which are missing
                values = np.array([np.nan if one is None else float(one) for one in values])
            return (values.view(np.uint8) if values.dtype == bool else values,)

        (values,) = self.room.take((self.path, case, name), read)
        return values

    def is_truth(self, name: str) -> bool:
        """Whether a column has Booleans."""
        return str(self.file.schema_arrow.field(name).type) == "bool"
