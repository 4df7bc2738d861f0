"""cases.parquet: a row per case with its inputs, seed, metrics, verdicts, status and time; bands.parquet: samples of signals."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from twin.errors import ScenarioError
from twin.study.design import SAMPLED, Study, StudyRequest

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from twin.arrays import Array
    from twin.results import Metric
    from twin.study.execution.case_engine import Row
    from twin.study.execution.journal import StudyJournal

NAME, BANDS = "cases.parquet", "bands.parquet"
HOLDS, MARGIN = "holds: ", "margin: "  # before the name of an expectation
CHUNK = 1000  # rows


class LimitExcess(NamedTuple):
    """By how much a case is beyond a limit of an expectation, as a part of the width of the limits; below zero: within it.

    `margin`: the distance within the limit, SI; below zero: beyond it.
    """

    excess: float
    number: int
    value: float
    limit: float
    word: str
    margin: float


@dataclass
class CaseTable:
    """Finished cases of a study as columns, in the order of their numbers. Metrics (n, m) in SI, NaN without a value."""

    study: Study
    requests: list[StudyRequest]
    rows: list[Row]

    @property
    def values(self) -> Array:
        """Values of the factors and knobs, (n, k)."""
        return np.array([request.all_values for request in self.requests], np.float64).reshape(
            len(self.requests), len(self.study.all_factors)
        )

    @property
    def metrics(self) -> Array:
        """Metrics, (n, m), in the order of the scenario."""
        count = len(self.study.scenario.metrics)
        values = [row.metrics or (None,) * count for row in self.rows]
        return np.array(values, np.float64).reshape(len(self.rows), count)

    def metric(self, name: str) -> Array:
        """One metric, (n,)."""
        return np.asarray(self.metrics[:, list(self.study.scenario.metrics).index(name)])

    @property
    def holds(self) -> list[tuple[bool | None, ...]]:
        """Verdicts of each case; a case without an end holds nothing."""
        count = len(self.study.scenario.expectations)
        return [row.holds or (False,) * count for row in self.rows]

    def limit_excess(self, i: int, k: int) -> LimitExcess | None:
        """Return the value of row i that is farthest beyond a limit of expectation k, or nearest to it; None without either."""
        expectation, row = self.study.scenario.expectations[k], self.rows[i]
        if expectation.ordered:
            return None
        values: Sequence[float] = row.extremes[k] or () if row.extremes else ()
        if expectation.metric:
            index = list(self.study.scenario.metrics).index(expectation.metric)
            values = [value for value in row.metrics[index : index + 1] if value is not None]
        limits = [(expectation.at_most, 1.0, "at most"), (expectation.at_least, -1.0, "at least")]
        given = [limit for limit, _, _ in limits if limit is not None]
        width = (abs(given[0] - given[-1]) if len(given) > 1 else max(map(abs, given), default=0.0)) or 1.0
        number = self.requests[i].number
        excesses = [
            LimitExcess(sign * (value - limit) / width, number, value, limit, word, sign * (limit - value))
            for value in values
            for limit, sign, word in limits
            if limit is not None and np.isfinite(value)
        ]
        return max(excesses, default=None)

    def margins(self, k: int) -> list[float | None]:
        """Return the margin of each case to the limits of expectation k, SI; negative if violated, None if not judged."""
        excesses = [self.limit_excess(i, k) if row[k] is not None else None for i, row in enumerate(self.holds)]
        return [None if entry is None else entry.margin for entry in excesses]

    def where(self, part: str, variant: str = "") -> list[int]:
        """Return the row indices of the cases of one part of the study and one variant (all variants by default)."""
        return [
            i for i, request in enumerate(self.requests) if request.part == part and variant in ("", request.variant)
        ]

    def by_metric(self) -> Iterator[tuple[Metric, str, list[int]]]:
        """Yield each metric that is reported with each variant that has it, and the row indices of its samples."""
        for metric in self.study.metrics.values():
            for variant in self.study.variants:
                if not metric.variants or variant in metric.variants:
                    yield metric, variant, self.where(SAMPLED, variant)


def finished_cases(study: Study, requests: Sequence[StudyRequest], journal: StudyJournal) -> CaseTable:
    """Return the finished cases, sorted by number."""
    done = sorted(
        (request for request in requests if request.number in journal.rows), key=lambda request: request.number
    )
    return CaseTable(study, done, [journal.rows[request.number] for request in done])


def columns(cases: CaseTable) -> list[tuple[str, Any, Any, str]]:
    """Name, values, type and unit of each column."""
    import pyarrow as pa

    study, holds = cases.study, cases.holds
    integer, number, text = pa.int64(), pa.float64(), pa.string()

    def of(items: Sequence[Any], field: str, kind: Any, name: str = "", unit: str = "") -> tuple[str, Any, Any, str]:
        return name or field, [getattr(item, field) for item in items], kind, unit

    return [
        of(cases.requests, "number", integer, "case"),
        of(cases.requests, "part", text),
        of(cases.requests, "sample", integer),
        of(cases.requests, "variant", text),
        of(cases.requests, "seed", integer),
        *(
            (factor.name, values, number, factor.unit)
            for factor, values in zip(study.all_factors, cases.values.T, strict=True)
        ),
        *(
            (metric.name, values, number, f"SI, shown in {metric.unit}" if metric.unit else "")
            for metric, values in zip(study.scenario.metrics.values(), cases.metrics.T, strict=True)
        ),
        *(
            (f"{HOLDS}{expectation.name or expectation.metric or i + 1}", [row[i] for row in holds], pa.bool_(), "")
            for i, expectation in enumerate(study.scenario.expectations)
        ),
        *(
            (
                f"{MARGIN}{each.name or each.metric or k + 1}",
                values,
                number,
                f"SI, shown in {each.unit}" * bool(each.unit),
            )
            for k, each in enumerate(study.scenario.expectations)
            for values in [cases.margins(k)]
            if any(value is not None for value in values)
        ),
        of(cases.rows, "status", text),
        of(cases.rows, "why", text),
        of(cases.rows, "tries", integer),
        of(cases.rows, "seconds", number, unit="s"),
    ]


def write(folder: Path, cases: CaseTable) -> None:
    """Write cases.parquet atomically."""
    import pyarrow as pa
    from pyarrow import parquet

    own = columns(cases)
    fields = [pa.field(name, kind, metadata={"unit": unit} if unit else None) for name, _, kind, unit in own]
    # NaN is no value
    arrays = [pa.array(values, kind, from_pandas=True) for _, values, kind, _ in own]
    table = pa.table(arrays, schema=pa.schema(fields))
    parquet.write_table(table, folder / f"{NAME}.part")
    (folder / f"{NAME}.part").replace(folder / NAME)


def write_bands(folder: Path, names: Sequence[str], journal: StudyJournal) -> None:
    """Write bands.parquet, some cases in memory at a time."""
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema([("case", pa.int64()), *((name, pa.list_(pa.float32())) for name in names)])
    with parquet.ParquetWriter(folder / f"{BANDS}.part", schema) as writer:
        chunk: list[dict[str, Any]] = []
        for number, texts in journal.bands():
            samples = {name: decoded(text) for name, text in zip(names, texts, strict=False)}
            chunk.append({"case": number, **samples})
            if len(chunk) == CHUNK:
                writer.write_table(pa.Table.from_pylist(chunk, schema))
                chunk = []
        writer.write_table(pa.Table.from_pylist(chunk, schema))
    (folder / f"{BANDS}.part").replace(folder / BANDS)


def decoded(text: str) -> Array:
    """Samples from their text."""
    return np.frombuffer(base64.b64decode(text), np.float32)


def single(folder: Path, number: int) -> dict[str, Any]:
    """One row of cases.parquet. ScenarioError if there is none of that number."""
    from pyarrow import parquet

    path = folder / NAME
    if not path.exists():
        raise ScenarioError(f"{path}: is not there. Run the study to its end, or go on with --resume.")
    rows = parquet.read_table(path, filters=[("case", "=", number)]).to_pylist()
    if not rows:
        last = parquet.read_metadata(path).num_rows
        raise ScenarioError(f"{path}: has no case {number}. The study has cases 1 to {last}.")
    row: dict[str, Any] = rows[0]
    return row
