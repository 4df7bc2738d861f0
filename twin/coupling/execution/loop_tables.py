"""Tables of the loop: the plan's rows as arrays, and the initial published values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import bits, view

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.execution.plan import LoopPlan
    from twin.coupling.member import Member


class Tables:
    """Tables of a plan. `arrays`: by name, a row per operation; overrides change rows in place. Must outlive the loop."""

    def __init__(self, plan: LoopPlan, members: Mapping[str, Member]) -> None:
        self.plan, self.members = plan, members
        self.arrays = {
            name: np.array(rows, np.int64).reshape(len(rows), -1) if rows else np.zeros((1, 1), np.int64)
            for name, rows in (
                ("copies", plan.copies),
                ("converts", plan.converts),
                ("accesses", plan.accesses),
                ("steps", plan.steps),
                ("records", plan.records),
                ("instructions", plan.instructions),
            )
        }
        gets, steps = self.arrays["accesses"], self.arrays["steps"]
        if plan.steps:
            steps[:, -3] = gets.ctypes.data + steps[:, -3] * gets.strides[0]
        self._operations = plan.operation_rows(self.arrays)

    def publish(self) -> None:
        """Copy the members' values to the published memory; members that step with the loop are read in place."""
        for (member, name), address in self.plan.published.items():
            direct = self.members[member].address(name) and (member, name) not in self.plan.unsplit
            if not direct or not self.plan.is_read_directly(member):
                self.put(member, name, address)
        for (member, name), address in self.plan.buffers.items():
            self.put(member, name, address)

    def put(self, member: str, name: str, address: int) -> None:
        """Copy the value of a member's variable to an address."""
        view(address, self.members[member].variables[name])[:] = np.ravel(self.members[member].get(name))

    def write_addresses(self, state: Any) -> None:
        """Write the addresses of the tables into the loop's record."""
        state["operations"], state["operation_count"] = self._operations.ctypes.data, len(self._operations)
        state["row_bytes"] = 8 * self.plan.row_words
        begin, end = self.plan.record_converts
        converts = self.arrays["converts"]
        state["record_converts"] = converts.ctypes.data + begin * converts.strides[0]
        state["record_convert_count"] = end - begin
        self.merge_records(state)
        order, flags = list(self.members), {row[-1]: row[loop.STEP.index("flags")] for row in self.plan.steps}
        rows = [
            [flags[i], bits(clock.seconds(self.plan.periods[name])), i]
            for i, name in enumerate(order)
            if self.members[name].may_return_early
        ]
        self._early_return_rows = np.array(rows, np.int64)
        state["early_returns"], state["early_return_count"] = self._early_return_rows.ctypes.data, len(rows)

    def merge_records(self, state: Any) -> None:
        """Set the loop's recording rows, merged into as few as possible."""
        rows = self.arrays["records"][: len(self.plan.records)]
        self._runs = merge_rows(rows) if len(rows) else rows
        state["records"], state["record_count"] = self._runs.ctypes.data, len(self._runs)

    def reset(self, table: str, row: int) -> None:
        """Reset a row to the plan's values."""
        self.arrays[table][row] = getattr(self.plan, table)[row]


def merge_rows(rows: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Merge neighboring copy rows whose sources and targets are both adjacent."""
    result: list[list[int]] = []
    for source, target, words in rows.tolist():
        if result and result[-1][0] + 8 * result[-1][2] == source and result[-1][1] + 8 * result[-1][2] == target:
            result[-1][2] += words
        else:
            result.append([source, target, words])
    return np.array(result, np.int64).reshape(len(result), 3)
