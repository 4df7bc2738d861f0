"""Conditions of a co-simulation: their tables in the loop, and the actions when they are met.

The loop evaluates all conditions at each communication point, on the values that are recorded there, and returns when one is
met. The action then happens at that point, before the next step. The state of conditions lies in the plan's memory, so
checkpoints save it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, compiler
from twin.coupling.execution import condition_loop, loop
from twin.coupling.execution.condition_loop import CONDITION_STATE, DISARMED, INSTRUCTION, MET, VALUE, WAITING
from twin.coupling.execution.value_memory import bits, kind

if TYPE_CHECKING:
    from pathlib import Path

    from twin.coupling.cosimulation import CoSimulation
    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.execution.plan import Key, LoopPlan
    from twin.coupling.system import Reference

    Instruction = tuple[
        int, float | Reference | None
    ]  # operation of `condition_loop`; number, scalar value, or nothing

WORD = 8
STATE_BYTES = WORD * len(CONDITION_STATE)


@dataclass(frozen=True)
class Condition:
    """A condition on outputs. `instructions`: for the stack machine of `condition_loop`.

    `hold`: time for which it must be true without interruption [ns]; `after`: time before which it is not evaluated [ns].
    `repeats`: it acts again after it was false. `act`: called with the co-simulation when the condition is met.
    """

    instructions: Sequence[Instruction]
    act: Callable[[CoSimulation], object]
    hold: clock.Time = 0
    after: clock.Time | None = None
    repeats: bool = False


class Conditions:
    """Conditions of a co-simulation, in the order in which they act. `met`: time [ns] and index of each that was met."""

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self.conditions = tuple(conditions)
        self.met: list[tuple[clock.Time, int]] = []
        self.has_stopped = False  # whether one of them ended the run
        self._stop: clock.Time | None = None

    def keys(self) -> list[Key]:
        """Return the variables that are read."""
        return [
            operand.key  # type: ignore[union-attr]
            for condition in self.conditions
            for operation, operand in condition.instructions
            if operation == VALUE
        ]

    def add_rows(self, plan: LoopPlan) -> None:
        """Add the instructions to a plan whose variables are published; overrides redirect what they read."""
        for condition in self.conditions:
            for operation, operand in condition.instructions:
                row = [operation, 0, 0]
                if operation == VALUE:
                    reference: Reference = operand  # type: ignore[assignment]
                    offset = reference.first * reference.variable.dtype.itemsize
                    plan.readers.setdefault(reference.key, []).append(
                        ("instructions", len(plan.instructions), 1, offset)
                    )
                    row = [operation, plan.published[reference.key] + offset, kind(reference.variable.dtype)]
                elif operand is not None:
                    row[1] = bits(operand)  # type: ignore[arg-type]
                plan.instructions.append(row)

    def connect(self, tables: Tables, state: Any, begin: clock.Time, step: clock.Time, stop: clock.Time | None) -> None:
        """Write the tables to the loop's record. `begin`, `step`, `stop`: of the communication points [ns]."""
        self.met, self.has_stopped, self._stop = [], False, stop
        if not self.conditions:
            return
        instructions, first, rows = tables.arrays["instructions"], 0, []
        states = tables.plan.memory.take(STATE_BYTES * len(self.conditions))
        for index, condition in enumerate(self.conditions):
            count, after = len(condition.instructions), begin if condition.after is None else condition.after
            rows.append(
                [
                    int(instructions.ctypes.data) + WORD * len(INSTRUCTION) * first,
                    count,
                    -int(-condition.hold // step),  # rounded up
                    -int(-(after - begin) // step),
                    states + STATE_BYTES * index,
                ]
            )
            first += count
        self._rows = np.array(rows, np.int64)
        self._stack = np.zeros(max(row[1] for row in rows), np.float64)
        words = (ctypes.c_int64 * (len(rows) * len(CONDITION_STATE))).from_address(states)
        self._states = np.ctypeslib.as_array(words).reshape(len(rows), -1)
        state["conditions"], state["condition_count"] = self._rows.ctypes.data, len(rows)
        state["stack"] = self._stack.ctypes.data

    def start(self, cosimulation: CoSimulation, record: np.ndarray[Any, Any], build: Path) -> None:
        """Evaluate the conditions before the first step."""
        head = "Conditions before the first step."
        names = loop.RECORD, "conditions", condition_loop.start, head
        if self.conditions and compiler.load_record_function(*names, build)(record.ctypes.data):
            self.act(cosimulation)

    def act(self, cosimulation: CoSimulation) -> None:
        """Let the conditions act that are met at the communication point reached, unless it is the last one."""
        if not self.conditions or (self._stop is not None and cosimulation.time >= self._stop):
            return
        for index in np.flatnonzero(self._states[:, 0] == MET).tolist():
            condition = self.conditions[index]
            self._states[index, 0] = WAITING if condition.repeats else DISARMED
            self.met.append((cosimulation.time, index))
            condition.act(cosimulation)

    def stop(self, cosimulation: CoSimulation, reason: str) -> None:
        """End the run at the communication point reached."""
        self.has_stopped = cosimulation.finished = True
        cosimulation.failure = reason
