"""Reader of the variables of a signals.parquet, each on access; arrays are restored from their elements."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin.results.recording.run_folder import read_signals
from twin.results.recording.signals import Signals

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


@dataclass(frozen=True)
class RecordedVariable:
    """Recorded variable. `columns`: names of its elements' columns in row-major order."""

    name: str
    columns: tuple[str, ...]
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    description: str = ""


def list_recorded_variables(path: Path) -> dict[str, RecordedVariable]:
    """Return the variables of a file by name; only its schema is read."""
    from pyarrow import parquet

    arrays: dict[str, dict[tuple[int, ...], str]] = {}
    metadata = {}
    for field in parquet.read_schema(path):
        if field.name in ("variant", "seed", "time"):
            continue
        metadata[field.name] = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
        match = ELEMENT.fullmatch(field.name)
        index = tuple(int(part) - 1 for part in match[2].split(",")) if match else ()
        arrays.setdefault(match[1] if match else field.name, {})[index] = field.name
    variables = {}
    for name, elements in arrays.items():
        shape = tuple(max(indices) + 1 for indices in zip(*elements, strict=True)) if () not in elements else ()
        if list(elements) == list(np.ndindex(shape)):
            first, *_ = columns = tuple(elements.values())
            variables[name] = RecordedVariable(name, columns, shape, **column_metadata(metadata[first]))
        else:  # single elements of an FMU's array
            variables.update(
                {
                    column: RecordedVariable(column, (column,), (), **column_metadata(metadata[column]))
                    for column in elements.values()
                }
            )
    return variables


def column_metadata(metadata: dict[str, str]) -> dict[str, str]:
    """Return unit, display unit and description of a column."""
    return {key: metadata.get(key, "") for key in ("unit", "display_unit", "description")}


def read_variables(path: Path, variables: Iterable[RecordedVariable]) -> dict[tuple[str, int], Signals]:
    """Read these variables of every case; variables that a case has not recorded are missing in it."""
    requested = list(variables)
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
