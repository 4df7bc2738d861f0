"""Read the recording of a running session: rows in the file that the process of the loop writes."""

from __future__ import annotations

import mmap
import os
import threading
from bisect import bisect_right
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.results import stream

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

Array = np.ndarray[Any, Any]
WORD = 8
DTYPES = {"f": np.dtype(np.float64), "i": np.dtype(np.int64), "u": np.dtype(np.uint64)}


class RefusedError(TwinError):
    """A command or request that is refused, with a one-line reason."""


@dataclass(frozen=True)
class Samples:
    """Rows of some signals. `epoch`: number of resets before them; `time` [s]."""

    epoch: int
    time: Array
    values: dict[str, Array]


class RecordingReader:
    """The rows of one run as they are appended; the rows up to `close` stay readable, also after the file is removed."""

    def __init__(self, run: Path, epoch: int) -> None:
        recorded = stream.read_recording(run)
        part = recorded.case_recordings[-1]
        self.epoch, layout = epoch, part.layout
        self.width = int(layout["words"])
        self.begin, self.step, self.per_second = layout["begin"], layout["step"], layout["per_second"]
        self.columns = {name: (first, tuple(shape), kind) for name, first, shape, kind, *_ in layout["columns"]}
        self._file = os.open(recorded.folder / f"{part.number}.rows", os.O_RDONLY)
        self._words: Array = np.zeros((0, self.width), np.int64)
        self._lock = threading.RLock()  # another thread may close the file

    def rows(self) -> Array:
        """Return all rows so far, as 64-bit words."""
        with self._lock:
            count = os.fstat(self._file).st_size // (WORD * self.width) if self._file >= 0 else 0
            if count > len(self._words):
                mapped = mmap.mmap(self._file, count * WORD * self.width, access=mmap.ACCESS_READ)
                self._words = np.frombuffer(mapped, np.int64).reshape(count, self.width)
            return self._words

    def read(self, names: Sequence[str], since: float | None, until: float | None) -> Samples:
        """Return rows with since < time <= until [s]; None: from the first, to the last."""
        words = self.rows()
        first = 0 if since is None else self.first_row_after(words, since)
        last = len(words) if until is None else self.first_row_after(words, until)
        return self.samples(words[first:last], names)

    def first_row_after(self, words: Array, time: float) -> int:
        """Return the index of the first row after a time [s]."""
        return bisect_right(range(len(words)), time, key=lambda row: self.time(int(words[row, 0])))

    def time(self, tick: int) -> float:
        """Return the time of a tick [s]."""
        return float((self.begin + tick * self.step) / self.per_second)

    def latest(self, names: Sequence[str]) -> Samples:
        """Return the last row, if there is one."""
        return self.samples(self.rows()[-1:], names)

    def samples(self, words: Array, names: Sequence[str]) -> Samples:
        """Return some signals of some rows."""
        time = (self.begin + words[:, 0] * self.step) / self.per_second
        return Samples(self.epoch, np.asarray(time, np.float64), {name: self.column(words, name) for name in names})

    def column(self, words: Array, name: str) -> Array:
        """Return a signal or an element of one, `member.variable[2]`; RefusedError if it is not recorded."""
        position, index = self.columns.get(name), ""
        if position is None and name.endswith("]"):
            array_name, _, index = name[:-1].rpartition("[")
            position = self.columns.get(array_name)
        if position is None:
            raise RefusedError(f"{name}: is not recorded. Add it to `record` at the start of the session.")
        first, shape, kind = position
        if index:
            first, shape = first + self.element(name, index, shape), ()
        block = np.ascontiguousarray(words[:, first : first + prod(shape)])
        values = block != 0 if kind == "b" else block.view(DTYPES.get(kind, DTYPES["i"]))
        return values.reshape(len(words), *shape)

    def element(self, name: str, index: str, shape: tuple[int, ...]) -> int:
        """Return the flat index of an array element, from 0."""
        try:
            indices = tuple(int(number) - 1 for number in index.split(","))
            if any(index < 0 for index in indices):
                raise ValueError  # noqa: TRY301
            return int(np.ravel_multi_index(indices, shape))
        except ValueError:
            size = " x ".join(map(str, shape))
            raise RefusedError(f"{name}: there is no such element. The array has {size}, counted from 1.") from None

    def close(self) -> None:
        """Map the last rows and close the file; mapped rows stay valid until the last reference to them is gone."""
        with self._lock:
            if self._file >= 0:
                self.rows()
                os.close(self._file)
                self._file = -1
