"""Files of rows of 64-bit words, and the columns in them.

A small file is read into memory. A large file is read in slices if its columns are used slice by slice
(`Signals.parts`), and a column is read entirely only on request: a recording may be larger than memory.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = np.ndarray[Any, Any]

WORD = 8
DTYPES: dict[str, np.dtype[Any]] = {
    kind: np.dtype(name) for kind, name in {"f": "f8", "i": "i8", "u": "u8", "b": "?"}.items()
}


@dataclass(frozen=True)
class RowField:
    """Position of a variable in a row: first word, shape, and kind of its words (NumPy's letter; `b`: one word each)."""

    first: int
    shape: tuple[int, ...] = ()
    kind: str = "i"

    @property
    def dtype(self) -> np.dtype[Any]:
        """Data type of the values."""
        return DTYPES.get(self.kind, DTYPES["i"])

    def decode(self, words: Array) -> Array:
        """Decode the variable's values from rows of words."""
        block = np.ascontiguousarray(words[:, self.first : self.first + math.prod(self.shape)])
        values = block != 0 if self.kind == "b" else block.view(self.dtype)
        return np.asarray(values.reshape(len(block), *self.shape))


TICK_FIELD = RowField(0)


def row_fields(layout: Mapping[str, Any]) -> dict[str, RowField]:
    """Return the fields of the variables in a recorded layout."""
    return {name: RowField(first, tuple(shape), kind) for name, first, shape, kind, *_ in layout["columns"]}


@dataclass
class RowFile:
    """Rows of a file up to tick `last`; a truncated last row is ignored.

    `width`: words in each row; `large_size`: size [byte] above which the file is read in slices of `slice_size` [byte].
    """

    file: Path
    width: int
    large_size: int
    slice_size: int
    last: int | None = None
    count: int = 0
    _block: tuple[int, int, Array] = field(default=(0, 0, np.zeros((0, 1), np.int64)), repr=False)

    def __post_init__(self) -> None:
        self.count = self.file.stat().st_size // (WORD * self.width) if self.file.exists() else 0
        if self.last is not None:
            self.count = bisect_right(range(self.count), self.last, key=lambda row: int(self.read(row, row + 1)[0, 0]))

    @property
    def rows_per_slice(self) -> int:
        """Number of rows in a slice."""
        return max(1, self.slice_size // (WORD * self.width))

    @property
    def is_large(self) -> bool:
        """Whether the file is read in slices."""
        return self.count * self.width * WORD > self.large_size

    def read(self, begin: int, end: int) -> Array:
        """Read rows of words; the last result is cached."""
        if (begin, end) != self._block[:2]:
            size = self.width * max(0, end - begin)
            words = (
                np.fromfile(self.file, np.int64, size, offset=WORD * self.width * begin) if size else np.zeros(0, int)
            )
            self._block = begin, end, words.reshape(-1, self.width)
        return self._block[2]


class RowColumn:
    """Variable in the rows of a large file. NumPy converts it to an array, which reads it entirely; a slice is an array.

    With `scale` values become `(offset + factor * value) / divisor`: ticks become times.
    """

    def __init__(self, rows: RowFile, field: RowField, scale: tuple[int, int, int] | None = None) -> None:
        self.rows, self.field, self.scale = rows, field, scale
        self.shape = (rows.count, *field.shape)
        self.ndim = len(self.shape)
        self.dtype = field.dtype if scale is None else np.dtype(np.float64)

    def __len__(self) -> int:
        return self.rows.count

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, int | np.integer):
            row = range(len(self))[key]
            return self._of(self.rows.read(row, row + 1))[0]
        if not isinstance(key, slice) or (key.step or 1) < 1:
            return np.asarray(self)[key]
        begin, end, step = key.indices(len(self))
        values = np.empty((len(range(begin, end, step)), *self.shape[1:]), self.dtype)
        stride = max(step, self.rows.rows_per_slice // step * step)
        for start in range(begin, end, stride):
            block = self._of(self.rows.read(start, min(start + self.rows.rows_per_slice, end)))[::step][
                : stride // step
            ]
            values[(start - begin) // step :][: len(block)] = block
        return values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        values: Array = self[:]
        return values if dtype is None else values.astype(dtype, copy=False)

    def _of(self, words: Array) -> Array:
        return row_times(words, *self.scale) if self.scale else self.field.decode(words)


def row_times(words: Array, begin: int, step: int, per_second: int) -> Array:
    """Compute the time of each row [s]: the float nearest to an exact ratio."""
    return np.asarray((begin + TICK_FIELD.decode(words) * step) / per_second)


def read_columns(
    rows: RowFile, fields: Mapping[str, RowField], scale: tuple[int, int, int]
) -> tuple[Any, dict[str, Any]]:
    """Return the times and the variables of rows: arrays, or lazy columns of a large file."""
    if rows.is_large:
        return RowColumn(rows, TICK_FIELD, scale), {name: RowColumn(rows, field) for name, field in fields.items()}
    words = rows.read(0, rows.count)
    return row_times(words, *scale), {name: field.decode(words) for name, field in fields.items()}
