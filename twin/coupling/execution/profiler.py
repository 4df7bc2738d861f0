"""Profiler of the loop: computing time of each operation, with the clock read by the loop itself.

The loop calls the address in each row; the profiler inserts rows that read the system's clock. Every few communication
points the times of the last one are sampled, with warm caches as in an ordinary run; the time of reading the clock is
measured too and subtracted.
"""

from __future__ import annotations

import ctypes
import sys
import time as wall
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.coupling.execution import loop
from twin.errors import CouplingError

if TYPE_CHECKING:
    from twin.coupling.cosimulation import CoSimulation

MONOTONIC = 1  # CLOCK_MONOTONIC of Linux
STRIDES = (7, 11, 13, 17, 19, 23)  # communication points between two samples: no multiple of a period
STEP, VALUES, COPIES = "steps", "accesses", "copies"
GETS, GET_COUNT = loop.STEP.index("gets"), loop.STEP.index("get_count")


def clock_address() -> int:
    """Return the address of the system's `clock_gettime`, which the loop can call like an FMU's getter."""
    if not sys.platform.startswith("linux"):
        raise CouplingError("profile: reads Linux's clock from the loop. Run it on Linux.")
    return machine.address_of(ctypes.CDLL(None).clock_gettime)


class Stopwatch:
    """Profiler of an initialized co-simulation, from now on. CouplingError if its algorithm has no fixed steps."""

    def __init__(self, simulated: CoSimulation) -> None:
        if not simulated.algorithm.is_plain:
            raise CouplingError(
                f"profile: {simulated.algorithm} repeats or divides steps. Measure what one step costs with "
                f"--set algorithm=jacobi."
            )
        self.names = list(simulated.members)
        self.table, self._loop, self._state = simulated.plan, simulated._loop, simulated.state
        arrays = simulated._tables.arrays
        pieces = [piece for row in simulated.plan.operation_rows(arrays) for piece in split_operation(row, arrays)]
        self.kinds = [kind for kind, _, _ in pieces]
        self.members = [-1 if member is None else member for _, member, _ in pieces]
        self.dividers = np.array([row[0] for *_, row in pieces])
        self._shifts = np.array([row[1] for *_, row in pieces])
        # The clock is read twice before the first piece, and after each piece.
        self._stamps = np.zeros((len(pieces) + 2, 2), np.int64)
        address = clock_address()
        readings = [[address, MONOTONIC, self._stamps[i].ctypes.data, 0, 0, 0, 0] for i in range(len(self._stamps))]
        self._readings = np.array(readings, np.int64)
        rows = [clock_operation(self._readings[0]), clock_operation(self._readings[1])]
        for i, (*_, row) in enumerate(pieces):
            rows += [row, clock_operation(self._readings[i + 2])]
        self._operations = np.array(rows, np.int64)
        simulated.state["operations"], simulated.state["operation_count"] = self._operations.ctypes.data, len(rows)
        self.stride = next(stride for stride in STRIDES if all(int(divider) % stride for divider in self.dividers))
        self.durations_ns = np.zeros(len(pieces), np.int64)  # [ns] in the sampled communication points
        self.done = np.zeros(len(pieces), np.int64)  # executions of each piece in them
        self.sampled, self.ticks, self.wall = 0, 0, 0.0
        self.overheads: list[int] = []
        simulated._loop = self.run

    def run(self, record: int) -> int:
        """Run the loop and sample the clock readings; replaces the loop's function."""
        state, last = self._state, int(self._state["stop"])
        result = loop.DONE
        while result == loop.DONE and int(state["tick"]) < last:
            tick = int(state["tick"])
            state["stop"] = min(last, tick + self.stride)
            begin = wall.perf_counter()
            result = self._loop(record)
            self.wall += wall.perf_counter() - begin
            self.ticks += int(state["tick"]) - tick
            if int(state["tick"]) - tick == self.stride:
                self.add_sample(int(state["tick"]) - 1)
        state["stop"] = last
        return result

    def add_sample(self, tick: int) -> None:
        """Add the durations of a communication step."""
        spans = np.diff(self._stamps @ np.array([1_000_000_000, 1]))
        due = (tick + self._shifts) % self.dividers == 0
        self.overheads.append(int(spans[0]))
        self.durations_ns += np.where(due, spans[1:], 0)
        self.done += due
        self.sampled += 1

    @property
    def overhead(self) -> float:
        """Time of reading the clock [s]."""
        return float(np.median(self.overheads)) * 1e-9 if self.overheads else 0.0

    def per_tick(self) -> np.ndarray[Any, Any]:
        """Return the mean duration of each piece per communication step [s]."""
        durations = self.durations_ns * 1e-9 - self.done * self.overhead
        return np.maximum(durations, 0.0) / max(self.sampled, 1)


def clock_operation(row: np.ndarray[Any, Any]) -> list[int]:
    """Return an operation that reads the clock."""
    return [1, 0, 0, 0, 0, 0, 0, int(row.ctypes.data), 1, 0, 0]


def split_operation(operation: np.ndarray[Any, Any], arrays: dict[str, Any]) -> list[tuple[str, int | None, list[int]]]:
    """Split an operation into pieces, in order: copies, then call by call, each with its member."""
    head, (copies, converts, accesses, steps) = operation[:3].tolist(), operation[3:].reshape(4, 2).tolist()
    pieces: list[tuple[str, int | None, list[int]]] = []
    if copies[1] or converts[1]:
        pieces.append((COPIES, None, [*head, *copies, *converts, 0, 0, 0, 0]))
    for kind, (address, count) in ((VALUES, accesses), (STEP, steps)):
        table = arrays[kind]
        for i in range(count):
            row = address + i * table.strides[0]
            words = table[(row - table.ctypes.data) // table.strides[0]]
            member = int(words[-1])
            columns = [row, 1, 0, 0] if kind == VALUES else [0, 0, row, 1]
            pieces.append((kind, member, [*head, 0, 0, 0, 0, *columns]))
            if kind == STEP and words[GET_COUNT]:
                pieces.append((VALUES, member, [*head, 0, 0, 0, 0, int(words[GETS]), int(words[GET_COUNT]), 0, 0]))
                words[GET_COUNT] = 0  # They are a piece of their own.
    return pieces
