"""Tables of recorded files as arrays: numbers of text cells, lists in cells, MATLAB files, missing and duplicate rows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twin.errors import TwinError
from twin.results import calibration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.arrays import Array
    from twin.identify.recordings.recorded_files import Column
    from twin.identify.recordings.schema import TableKeys

Rows = list[tuple[int, list[str]]]  # line of the file, cells


def numbers(rows: Rows, header: Sequence[str], index: int, shown: str, *, may_be_missing: bool) -> Array:
    """Return a column of text cells as numbers; NaN for an empty cell if it may be missing.

    TwinError with file, line and column for a cell that is no number.
    """
    cells = [row[index] if index < len(row) else "" for _, row in rows]
    if may_be_missing:
        cells = [cell if cell.strip() else "nan" for cell in cells]
    try:
        values = np.array(cells, dtype=np.str_).astype(np.float64) if cells else np.zeros(0)
        is_valid = (may_be_missing or bool(np.isfinite(values).all())) and not any("_" in cell for cell in cells)
    except ValueError:
        is_valid = False
    if is_valid:
        return values
    for (line, _), cell in zip(rows, cells, strict=True):
        if not (may_be_missing and cell.strip().lower() == "nan"):
            calibration.parse_cell([cell], 0, [header[index]], f"{shown}:{line}")
    raise AssertionError("a cell that is no number was found")


def expand_lists(header: list[str], rows: Rows, shown: str) -> tuple[list[str], Rows]:
    """Expand cells that hold a list in brackets, `[1.5,2.0]`, to one column per element: `state[1]`, `state[2]`."""
    if not rows or not any(cell.lstrip().startswith("[") for cell in rows[0][1]):
        return header, rows
    first = [elements(cell) for cell in rows[0][1]]
    if len(first) != len(header):
        raise TwinError(f"{shown}:{rows[0][0]}: has {len(first)} cells, expected {len(header)} as in the header.")
    names = [
        f"{name}[{i + 1}]" if cell.lstrip().startswith("[") else name
        for name, cell, parts in zip(header, rows[0][1], first, strict=True)
        for i in range(len(parts))
    ]
    sizes = [len(parts) for parts in first]
    expanded = []
    for line, row in rows:
        parts = [elements(cell) for cell in row]
        for i, size in enumerate(sizes):
            if i >= len(parts) or len(parts[i]) != size:
                count = len(parts[i]) if i < len(parts) else 0
                raise TwinError(
                    f"{shown}:{line}: {header[i]} has {count} elements, expected {size} as in the first row."
                )
        expanded.append((line, [element for part in parts for element in part]))
    return names, expanded


def elements(cell: str) -> list[str]:
    """Return the elements of a list in brackets, or the cell itself."""
    text = cell.strip()
    return text[1:-1].split(",") if text.startswith("[") and text.endswith("]") else [text]


def read_matlab(path: Path, shown: str) -> dict[str, Array]:
    """Return the columns of a MATLAB file (up to version 7): vectors, and columns of matrices as `name[1]`.

    Rows of the table are the most common length among the vectors; what has another length is left out.
    """
    import zlib

    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path)
    except NotImplementedError:
        raise TwinError(f"{shown}: is a MATLAB 7.3 file. Save it with `save(name, '-v7')`.") from None
    except (ValueError, TypeError, OSError, IndexError, MatReadError, zlib.error) as error:  # of files that are cut
        raise TwinError(f"{shown}: is no MATLAB file ({' '.join(str(error).split())}).") from None
    arrays = {
        name: np.asarray(value, np.float64)
        for name, value in content.items()
        if not name.startswith("__")
        and isinstance(value, np.ndarray)
        and value.dtype.kind in "fiub"
        and value.ndim == 2
    }
    lengths = [value.size for value in arrays.values() if 1 in value.shape and value.size > 1]
    if not lengths:
        raise TwinError(f"{shown}: has no vectors of numbers. Save each signal as an n x 1 array.")
    count = max(set(lengths), key=lengths.count)
    columns = {}
    for name, value in arrays.items():
        if value.size == count and 1 in value.shape:
            columns[name] = value.reshape(-1)
        elif count in value.shape:
            matrix = value if value.shape[0] == count else value.T
            columns |= {f"{name}[{i + 1}]": matrix[:, i] for i in range(matrix.shape[1])}
    return columns


def cleaned(column: Column, keys: TableKeys) -> Column:
    """Return the column without missing values and duplicate times, as far as the keys allow it."""
    if keys.missing == "drop":
        column = chosen(column, np.isfinite(column.time) & np.isfinite(column.values))
    if keys.duplicates == "refuse" or len(column.time) < 2:
        return column
    is_first = np.diff(column.time, prepend=-np.inf) != 0
    if keys.duplicates == "mean":
        group = np.cumsum(is_first) - 1
        means = np.bincount(group, column.values) / np.bincount(group)
        column = replace(column, values=means[group])
    return chosen(column, is_first)


def chosen(column: Column, rows: Array) -> Column:
    """Return some rows of a column."""
    lines = column.lines[rows] if len(column.lines) else column.lines
    return replace(column, time=column.time[rows], values=column.values[rows], lines=lines)
