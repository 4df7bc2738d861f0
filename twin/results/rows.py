"""Rows of 64-bit words as they lie in a file, and the columns in them, however many there are.

A small file is read into memory. A large one is read in slices where its columns are used slice by slice
(`Signals.parts`), and a whole column only where somebody asks for one: so a recording may be larger than memory.
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
class Place:
    """Where a variable lies in a row: first word, shape, and the kind of its words (NumPy's letter; `b` a word each)."""

    first: int
    shape: tuple[int, ...] = ()
    kind: str = "i"

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of its values."""
        return DTYPES.get(self.kind, DTYPES["i"])

    def of(self, words: Array) -> Array:
        """Its values in rows of words."""
        block = np.ascontiguousarray(words[:, self.first : self.first + math.prod(self.shape)])
        values = block != 0 if self.kind == "b" else block.view(self.dtype)
        return np.asarray(values.reshape(len(block), *self.shape))


TICK = Place(0)


@dataclass
class Rows:
    """The rows of a file that count, those up to tick `last`; one that is cut off does not.

    `width`: words in each; `large`: size [byte] from which on they are read in slices of `size` [byte].
    """

    file: Path
    width: int
    large: int
    size: int
    last: int | None = None
    count: int = 0
    _block: tuple[int, int, Array] = field(default=(0, 0, np.zeros((0, 1), np.int64)), repr=False)

    def __post_init__(self) -> None:
        self.count = self.file.stat().st_size // (WORD * self.width) if self.file.exists() else 0
        if self.last is not None:
            self.count = bisect_right(range(self.count), self.last, key=lambda row: int(self.read(row, row + 1)[0, 0]))

    @property
    def slice(self) -> int:
        """Rows that are read at once."""
        return max(1, self.size // (WORD * self.width))

    @property
    def is_large(self) -> bool:
        """Whether they are not to be read at once."""
        return self.count * self.width * WORD > self.large

    def read(self, begin: int, end: int) -> Array:
        """Rows of words; those read last are at hand."""
        if (begin, end) != self._block[:2]:
            size = self.width * max(0, end - begin)
            words = (
                np.fromfile(self.file, np.int64, size, offset=WORD * self.width * begin) if size else np.zeros(0, int)
            )
            self._block = begin, end, words.reshape(-1, self.width)
        return self._block[2]


class Column:
    """A variable in the rows of a large file; NumPy takes it for an array, and reads it whole then. A slice is an array.

    What is in the rows becomes `(offset + factor * value) / divisor` where a factor is given: so ticks become times.
    """

    def __init__(self, rows: Rows, place: Place, scale: tuple[int, int, int] | None = None) -> None:
        self.rows, self.place, self.scale = rows, place, scale
        self.shape = (rows.count, *place.shape)
        self.ndim = len(self.shape)
        self.dtype = place.dtype if scale is None else np.dtype(np.float64)

    def __len__(self) -> int:
        return self.rows.count

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, int | np.integer):
            row = range(len(self))[key]
            return self._of(self.rows.read(row, row + 1))[0]
        if not isinstance(key, slice) or (key.step or 1) < 1:
            return np.asarray(self)[key]
        begin, end, step = key.indices(len(self))
        found = np.empty((len(range(begin, end, step)), *self.shape[1:]), self.dtype)
        stride = max(step, self.rows.slice // step * step)
        for at in range(begin, end, stride):
            block = self._of(self.rows.read(at, min(at + self.rows.slice, end)))[::step][: stride // step]
            found[(at - begin) // step :][: len(block)] = block
        return found

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        whole: Array = self[:]
        return whole if dtype is None else whole.astype(dtype, copy=False)

    def _of(self, words: Array) -> Array:
        return times(words, *self.scale) if self.scale else self.place.of(words)


def times(words: Array, begin: int, step: int, per_second: int) -> Array:
    """Time of each row [s]: the float next to an exact ratio."""
    return np.asarray((begin + TICK.of(words) * step) / per_second)


def columns(rows: Rows, places: Mapping[str, Place], scale: tuple[int, int, int]) -> tuple[Any, dict[str, Any]]:
    """The times and the variables of rows: arrays, or columns of what is large."""
    if rows.is_large:
        return Column(rows, TICK, scale), {name: Column(rows, place) for name, place in places.items()}
    words = rows.read(0, rows.count)
    return times(words, *scale), {name: place.of(words) for name, place in places.items()}
