"""A run in progress: `UnfinishedRun` replaces a `Run`, `GrowingRecording` replaces its signals.parquet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.errors import TwinError
from twin.results import column_from_dict, evaluate, rows, run_folder, stream
from twin.scenario import lint
from twin.viewer.recording import ColumnCache, RecordedColumns

if TYPE_CHECKING:
    from pathlib import Path

    Array = np.ndarray[Any, Any]

RUNNING, OPEN = "running", "open"  # status of a run, verdict of an expectation


def is_running(folder: Path) -> bool:
    """Return whether a folder belongs to a run in progress."""
    return not (folder / "summary.json").is_file() and stream.has_journal(folder)


class UnfinishedRun:
    """A run with a recording and without a summary."""

    def __init__(self, folder: Path) -> None:
        if stream.is_abandoned(folder):
            raise TwinError(f"{folder}: its process has ended. Recover its results with: twin recover {folder}")
        self.folder = folder
        about = stream.read_recording(folder).header
        self.summary: dict[str, Any] = {
            "scenario": {key: about[key] for key in ("name", "title", "description", "source", "path")},
            "status": RUNNING,
            "started": about["started"],
            "overrides": about["overrides"],
            "reason": "",
            "metrics": {},
            "cases": [{"variant": variant, "seed": seed, "complete": False} for variant, seed in about["cases"]],
            "expectations": expected(folder),
        }


def expected(folder: Path) -> list[dict[str, str]]:
    """Return the expectations with open verdicts, by their names in the later summary."""
    try:
        scenario, _ = lint(folder / "scenario.yaml", imports=False)
    except TwinError:  # reported by `Verdicts`
        return []
    names = [outcome.name for outcome in evaluate(scenario.metrics, scenario.expectations, {}).expectation_results]
    return [{"name": name, "verdict": OPEN, "detail": "the run is in progress"} for name in names]


class GrowingRecording(RecordedColumns):
    """The rows recorded until the last `refresh`, of all cases including those not started."""

    def __init__(self, folder: Path, cache: ColumnCache) -> None:
        super().__init__(folder / stream.FOLDER, cache)
        self.folder = folder
        self._read = stream.read_recording(folder)
        variables = [column_from_dict(column) for column in self._read.header["columns"]]
        self._scalars = {column.label: column for column in run_folder.flatten_columns(variables)}
        self.variables = {variable.name: variable for variable in variables}
        self.column_indices = {name: index for index, name in enumerate(["variant", "seed", "time", *self._scalars])}
        self._counts: dict[tuple[str, int], int] = {}
        self.refresh()

    @property
    def cases(self) -> list[tuple[str, int]]:
        """All cases in order."""
        return self._read.cases

    @property
    def is_over(self) -> bool:
        """Whether the run has finished."""
        return (self.folder / "summary.json").is_file()

    def refresh(self) -> bool:
        """Read new rows; return whether there are any."""
        try:
            self._read = stream.read_recording(self.folder)
        except TwinError:
            return False  # the run ends at this moment
        counts = {
            self.cases[part.number]: self._rows(part.number).count for part in self._read.case_recordings if part.layout
        }
        grown = counts != self._counts
        if grown:
            self._counts = counts
            self.cache.forget(self.path)
        return grown

    def _part(self, case: tuple[str, int]) -> dict[str, Any]:
        """Return the row layout of a case; empty before it has started."""
        number = self.cases.index(case)
        return self._read.case_recordings[number].layout if number < len(self._read.case_recordings) else {}

    def _rows(self, number: int) -> rows.RowFile:
        part = self._read.case_recordings[number]
        last = part.end["last"] if part.end else None
        width = part.layout["words"]
        return rows.RowFile(self.path / f"{number}.rows", width, stream.LARGE_FILE, stream.SLICE_SIZE, last)

    def samples(self, case: tuple[str, int]) -> int:
        """Return the number of samples so far."""
        return self._counts.get(case, 0)

    def span(self, case: tuple[str, int]) -> tuple[float, float]:
        """Return first and last time of a case [s] so far."""
        count, part = self.samples(case), self._part(case)
        if not count:
            return 0.0, 0.0
        own = self._rows(self.cases.index(case))
        edges = [rows.row_times(own.read(row, row + 1), *scale_of(part))[0] for row in (0, count - 1)]
        return float(edges[0]) + 0.0, float(edges[1]) + 0.0

    def has(self, case: tuple[str, int], name: str) -> bool:
        """Return whether a case records a column; before its start, whether any case may."""
        return name in self._scalars and (not self._part(case) or self._find_column(case, name) is not None)

    def _find_column(self, case: tuple[str, int], name: str) -> tuple[rows.RowField, str] | None:
        """Return the position of a column in the rows of a case, and its unit there; None if absent."""
        scalar = self._scalars[name]
        for variables, first, shape, kind, unit, *_ in self._part(case).get("columns", ()):
            if (
                variables == scalar.name
                and len(shape) == len(scalar.index)
                and all(map(int.__lt__, scalar.index, shape))
            ):
                position = first + int(np.ravel_multi_index(scalar.index, shape)) if shape else first
                return rows.RowField(position, (), kind), unit
        return None

    def column(self, case: tuple[str, int], name: str) -> Array:
        """Return the values of a column in one case so far, (n,); Booleans as 0 and 1."""

        def read() -> tuple[Array, ...]:
            part, count = self._part(case), self.samples(case)
            if not count:
                return (np.zeros(0),)
            words: Any = np.memmap(
                self.path / f"{self.cases.index(case)}.rows", np.int64, "r", shape=(count, part["words"])
            )
            if name == "time":
                return (rows.row_times(words, *scale_of(part)),)
            column = self._find_column(case, name)
            assert column is not None
            values = column[0].decode(words)
            factor, offset = units.conversion(column[1], self._scalars[name].unit, name)
            if (factor, offset) != (1.0, 0.0):
                values = values * factor + offset  # another variant has it in another unit
            return (values.view(np.uint8) if values.dtype == bool else values,)

        (values,) = self.cache.get((self.path, case, name), read)
        return values

    def is_boolean(self, name: str) -> bool:
        """Return whether a column has Booleans."""
        return self._scalars[name].dtype == bool


def scale_of(part: dict[str, Any]) -> tuple[int, int, int]:
    """Return the conversion from ticks to time."""
    return part["begin"], part["step"], part["per_second"]
