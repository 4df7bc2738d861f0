"""Transfers of values between the members of a co-simulation and arrays, without Python per value: rows of the compiled loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.cosimulation import compiled_loop
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import NEVER, ValueMemory, bits, kind
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.coupling.cosimulation import CoSimulation
    from twin.coupling.member import Member


class Transfer:
    """A native call that copies `copies` (source, target, words), then evaluates members at the point reached.

    `conversions`: source address, its type, and the target address of a Float64. `accesses`: rows of the loop (`loop.ACCESS`),
    calls after the copies. `evaluated`: members whose outputs and derivatives are computed from their states, by a step of
    length 0. All addresses must outlive the transfer.
    """

    def __init__(
        self,
        cosimulation: CoSimulation,
        build: Path,
        copies: Sequence[tuple[int, int, int]] = (),
        conversions: Sequence[tuple[int, np.dtype[Any], int]] = (),
        evaluated: Sequence[Member] = (),
        accesses: Sequence[Sequence[int]] = (),
    ) -> None:
        self._state, self._run, self._memory = cosimulation.state, compiled_loop(build), ValueMemory()
        converted = [
            [source, kind(dtype), target, loop.KINDS["f8"], 1, bits(1.0), bits(0.0)]
            for source, dtype, target in conversions
        ]
        self._names = list(cosimulation.members)
        steps = [
            [m.step_function, m.step_signature, m.instance, self._memory.take(32), 0, 0, self._names.index(m.name)]
            for m in evaluated
        ]
        self._tables = [
            np.array(rows, np.int64).reshape(len(rows), len(columns))
            for rows, columns in (
                (copies, loop.COPY),
                (converted, loop.CONVERT),
                (accesses, loop.ACCESS),
                (steps, loop.STEP),
            )
        ]
        operation = [1, 0, bits(0.0), *(word for table in self._tables for word in (table.ctypes.data, len(table)))]
        self._operation = np.array(operation, np.int64)
        self._record = np.zeros(1, loop.RECORD)
        record = self._record[0]
        for name in ("begin_ns", "step_ns", "per_second"):
            record[name] = self._state[name]
        record["operations"], record["operation_count"] = self._operation.ctypes.data, 1
        record["limit"], record["every"] = 1, NEVER
        self._address = self._record.ctypes.data

    def __call__(self) -> None:
        """Transfer; SimulationError if a member fails."""
        record, tick = self._record[0], self._state["tick"]
        record["tick"], record["stop"] = tick, tick + 1
        if self._run(self._address) != loop.DONE:
            raise SimulationError(f"{self._names[int(record['member'])]}: failed with status {int(record['status'])}.")
