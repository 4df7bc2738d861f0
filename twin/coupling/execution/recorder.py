"""Recorders of the loop's rows: in this process's memory, or through a ring buffer to a file that outlives the process.

A recorder owns the loop's record (`loop.RECORD`) and provides the memory between `next_row` and `limit`. The loop returns when
`next_row` reaches `limit`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from twin.coupling.execution import loop
from twin.errors import CouplingError, SimulationError
from twin.process import SupervisorChannel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from twin.coupling.member import MemberVariable

    Columns = list[tuple[tuple[str, str], int, MemberVariable]]

BUFFER_BYTES = 64 << 20  # size of a buffer in this process; touched before the loop runs, to avoid page faults in it
WORD = 8
FEWEST = 4  # smallest number of rows in a ring


@dataclass(frozen=True)
class RowLayout:
    """Layout of a row: the tick, then each variable's scalars, a word each, Float64 or Int64.

    `columns`: (member, variable), first word, the variable. `calls`: member and function of each call of the loop, by the
    address of its row. `count`: largest number of rows, or None.
    """

    begin: int
    step: int
    per_second: int  # ticks of `begin` and `step` per second
    words: int
    columns: Columns
    calls: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    count: int | None = None


@dataclass
class RecordedSignals:
    """Recorded signals: time [s], and per variable an array of rows (and elements)."""

    time: np.ndarray[Any, Any]
    signals: dict[str, np.ndarray[Any, Any]]


def decode_rows(words: np.ndarray[Any, Any], columns: Columns) -> dict[str, np.ndarray[Any, Any]]:
    """Return the values of each column of rows, shape (rows, *shape of the variable), by `member.variable`."""
    signals = {}
    for (member, name), first, variable in columns:
        block = np.ascontiguousarray(words[:, first : first + variable.size])
        if variable.dtype.kind == "f":
            values = block.view(np.float64)
        elif variable.type in ("Boolean", "Clock"):
            values = block != 0
        else:
            values = block.view(np.uint64) if variable.dtype.kind == "u" else block
        signals[f"{member}.{name}"] = values.reshape(len(words), *variable.shape)
    return signals


class Recorder(Protocol):
    """Interface of a recorder."""

    record: np.ndarray[Any, Any]  # one loop.RECORD

    def open(self, layout: RowLayout) -> None:
        """Provide memory for rows."""

    def make_room(self) -> None:
        """Provide more memory: the loop has reached the limit."""

    def words(self) -> np.ndarray[Any, Any]:
        """Return all rows until now, as words."""

    def look(self) -> None:
        """Raise an error if recording cannot continue; called between two calls of the loop."""

    def note(self, text: str) -> None:
        """Publish the activity outside of the loop."""


class MemoryRecorder:
    """Recorder in this process's memory, in buffers of `size` byte."""

    def __init__(self, size: int = BUFFER_BYTES) -> None:
        self.size = size
        self.record = np.zeros(1, loop.RECORD)
        self._full: list[np.ndarray[Any, Any]] = []

    def open(self, layout: RowLayout) -> None:
        """Allocate a buffer, no larger than needed."""
        self._words = layout.words
        rows = max(16, self.size // (WORD * layout.words))
        self._use(np.full((rows if layout.count is None else min(rows, layout.count), layout.words), 0, np.int64))

    def _use(self, rows: np.ndarray[Any, Any]) -> None:
        self._rows = rows
        state = self.record[0]
        state["next_row"], state["limit"] = rows.ctypes.data, rows.ctypes.data + rows.nbytes

    def make_room(self) -> None:
        """Keep the filled part of the buffer and allocate a new one."""
        count = (int(self.record[0]["next_row"]) - self._rows.ctypes.data) // (WORD * self._words)
        if count:
            fresh = np.full_like(self._rows, 0)
            if not self._full or self._full[-1].base is not self._rows:  # guards against Ctrl-C between these two lines
                self._full.append(self._rows[:count])
            self._use(fresh)

    def add(self, rows: np.ndarray[Any, Any]) -> None:
        """Add rows that another simulation recorded; those of the loop follow."""
        self.make_room()
        self._full.append(rows)

    def words(self) -> np.ndarray[Any, Any]:
        """Return all rows until now."""
        self.make_room()
        return np.concatenate(self._full) if self._full else np.zeros((0, self._words), np.int64)

    def look(self) -> None:
        """No-op."""

    def note(self, text: str) -> None:
        """No-op."""


class Ring:
    """Recorder through the ring of a `SupervisorChannel`, which is drained to a file.

    `begin`: function of the layout that returns the paths of the files of rows and of the position.
    """

    def __init__(self, link: SupervisorChannel, begin: Callable[[RowLayout], tuple[Path, Path]]) -> None:
        self.link, self._begin = link, begin
        memory = np.frombuffer(link.shared.memory, np.uint8)
        self.record = memory[link.record_offset :][: loop.RECORD.itemsize].view(loop.RECORD)
        self.record[:] = 0
        self._ring = memory[link.ring_offset :]
        self._front = int(self._ring.ctypes.data)

    def open(self, layout: RowLayout) -> None:
        """Touch the memory in use, to avoid page faults in the loop, and open the file."""
        row = WORD * layout.words
        rows = len(self._ring) // row
        if rows < FEWEST:
            raise CouplingError(
                f"record: {layout.words} values in a row do not fit into {len(self._ring)} byte. Use fewer."
            )
        rows = rows if layout.count is None else max(FEWEST, min(rows, layout.count))
        self._row, self._size = row, rows * row
        self._ring[: self._size : 4096] = 0
        self.file, position = self._begin(layout)
        restored = self.file.stat().st_size % self._size if self.file.exists() else 0  # rows before a checkpoint
        state = self.record[0]
        state["next_row"], state["limit"] = self._front + restored, self._front + self._size
        addresses = {name: self.link.record_offset + loop.RECORD.fields[name][1] for name in ("next_row", "tick", "at")}  # type: ignore[index]
        self.link.open(
            {
                "file": str(self.file),
                "position": str(position),
                "front": self._front,
                "row": row,
                "end": self._size,
                **addresses,
            }
        )
        self.look()

    def make_room(self) -> None:
        """Free the drained part of the ring for the loop; wait until there is one."""
        state = self.record[0]
        while True:
            position, drained = int(state["next_row"]) - self._front, self.link.tail // self._row * self._row
            if position == self._size and drained >= 2 * self._row:
                position = 0
            limit = drained - self._row if drained > position else self._size
            if limit > position:
                # Write `limit` first: the drainer reads `next_row` only.
                state["limit"], state["next_row"] = self._front + limit, self._front + position
                return
            self.link.wait()
            self.look()

    def words(self) -> np.ndarray[Any, Any]:
        """Return all rows until now, from the file."""
        self.link.sync()
        self.look()
        count = self.file.stat().st_size // self._row
        if not count:
            return np.zeros((0, self._row // WORD), np.int64)
        return np.memmap(self.file, np.int64, "r", shape=(count, self._row // WORD))

    def look(self) -> None:
        """Raise SimulationError if rows cannot be written, KeyboardInterrupt if the supervisor has died."""
        self.link.look()
        if self.link.stopped:
            raise KeyboardInterrupt
        if (trouble := self.link.trouble) is not None:
            raise SimulationError(f"the recording {trouble.filename} cannot go on ({trouble.strerror}).")

    def note(self, text: str) -> None:
        """Publish the activity outside of the loop to the supervisor."""
        self.record[0]["at"] = 0
        self.link.note(text)
