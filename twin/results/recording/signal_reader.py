"""Reader of the variables of a signals.parquet, each on access; arrays are restored from their elements."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.results.recording.run_folder import RecordedVariable, read_signals
from twin.results.recording.signals import Signals

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


@contextmanager
def readable_recording(path: Path) -> Iterator[None]:
    """Report a truncated or damaged signals.parquet as TwinError."""
    from pyarrow import ArrowException

    try:
        yield
    except (ArrowException, OSError) as error:
        raise TwinError(f"{path}: cannot be read ({str(error).splitlines()[0]}). Run the scenario again.") from None


def list_recorded_variables(path: Path) -> dict[str, RecordedVariable]:
    """Return the variables of a file by name; only its schema is read."""
    from pyarrow import parquet

    arrays: dict[str, dict[tuple[int, ...], str]] = {}
    metadata: dict[str, dict[str, Any]] = {}
    with readable_recording(path):
        schema = parquet.read_schema(path)
    for field in schema:
        if field.name in ("variant", "seed", "time"):
            continue
        texts = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
        metadata[field.name] = {key: texts.get(key, "") for key in ("unit", "display_unit", "description")}
        match = ELEMENT.fullmatch(field.name)
        index = tuple(int(part) - 1 for part in match[2].split(",")) if match else ()
        arrays.setdefault(match[1] if match else field.name, {})[index] = field.name
    variables: dict[str, RecordedVariable] = {}
    for name, elements in arrays.items():
        shape = tuple(max(indices) + 1 for indices in zip(*elements, strict=True)) if () not in elements else ()
        if list(elements) == list(np.ndindex(shape)):
            variables[name] = RecordedVariable(name, shape=shape, **metadata[next(iter(elements.values()))])
        else:  # single elements of an FMU's array
            variables |= {column: RecordedVariable(column, **metadata[column]) for column in elements.values()}
    return variables


def list_empty_columns(path: Path) -> set[str]:
    """Return the columns without any value, as of variants that were not run; only the file's metadata is read."""
    from pyarrow import parquet

    with readable_recording(path):
        metadata = parquet.read_metadata(path)
    groups = [metadata.row_group(number) for number in range(metadata.num_row_groups)]
    columns = [[group.column(index) for group in groups] for index in range(metadata.num_columns)]
    return {
        chunks[0].path_in_schema
        for chunks in columns
        if chunks and all(chunk.is_stats_set and chunk.statistics.null_count == chunk.num_values for chunk in chunks)
    }


def read_variables(path: Path, variables: Iterable[RecordedVariable]) -> dict[tuple[str, int], Signals]:
    """Read these variables of every case; variables that a case has not recorded are missing in it."""
    requested = list(variables)
    with readable_recording(path):
        cases, _ = read_signals(path, [column for variable in requested for column in variable.columns])
    result = {}
    for case, signals in cases.items():
        present = [variable for variable in requested if all(column in signals.values for column in variable.columns)]
        values = {
            variable.name: np.stack([signals.values[column] for column in variable.columns], 1).reshape(
                -1, *variable.shape
            )
            for variable in present
        }
        result[case] = Signals(signals.time, values, {variable.name: variable.unit for variable in present})
    return result
