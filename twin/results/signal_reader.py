"""Variables of a signals.parquet, each read when it is asked for, arrays whole again."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twin.results.run_folder import read_signals
from twin.results.signals import Signals

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


@dataclass(frozen=True)
class Recorded:
    """A recorded variable. `columns`: of its elements, row by row."""

    name: str
    columns: tuple[str, ...]
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    description: str = ""


def recorded(path: Path) -> dict[str, Recorded]:
    """The variables of a file by their names; only its schema is read."""
    from pyarrow import parquet

    arrays: dict[str, dict[tuple[int, ...], str]] = {}
    notes = {}
    for field in parquet.read_schema(path):
        if field.name in ("variant", "seed", "time"):
            continue
        notes[field.name] = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
        match = ELEMENT.fullmatch(field.name)
        index = tuple(int(part) - 1 for part in match[2].split(",")) if match else ()
        arrays.setdefault(match[1] if match else field.name, {})[index] = field.name
    found = {}
    for name, elements in arrays.items():
        shape = tuple(max(places) + 1 for places in zip(*elements, strict=True)) if () not in elements else ()
        if list(elements) == list(np.ndindex(shape)):
            first, *_ = columns = tuple(elements.values())
            found[name] = Recorded(name, columns, shape, **about(notes[first]))
        else:  # single elements of an FMU's array
            found.update({one: Recorded(one, (one,), (), **about(notes[one])) for one in elements.values()})
    return found


def about(notes: dict[str, str]) -> dict[str, str]:
    """What a file says of a column."""
    return {key: notes.get(key, "") for key in ("unit", "display_unit", "description")}


def read_variables(path: Path, variables: Iterable[Recorded]) -> dict[tuple[str, int], Signals]:
    """The signals of every case with these variables alone; those that a case has not recorded are missing in it."""
    wanted = list(variables)
    cases, _ = read_signals(path, [column for one in wanted for column in one.columns])
    result = {}
    for case, signals in cases.items():
        there = [one for one in wanted if all(column in signals.values for column in one.columns)]
        values = {
            one.name: np.stack([signals.values[column] for column in one.columns], 1).reshape(-1, *one.shape)
            for one in there
        }
        result[case] = Signals(signals.time, values, {one.name: one.unit for one in there})
    return result
