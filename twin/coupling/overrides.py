"""Overrides: replace a variable's value for its readers, without changing the member that computes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.execution.plan import Key, RowReference
from twin.coupling.execution.value_memory import bits, kind, view
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.member import Member


class Overrides:
    """Overrides in the tables of a co-simulation."""

    def __init__(self, tables: Tables, members: Mapping[str, Member]) -> None:
        self.tables, self.plan, self.members = tables, tables.plan, members
        self._shadows: dict[Key, int] = {}  # addresses of overriding values
        self.active: dict[Key, int] = {}  # those that readers get now
        self._elements: dict[tuple[Key, int], np.ndarray[Any, Any]] = {}  # overridden elements

    def set(self, key: Key, value: Any) -> None:
        """Replace an output for all its readers, or an input for its member, by `value`."""
        variable = self.members[key[0]].variables[key[1]]
        rows = self._rows(key)
        if key not in self._shadows:
            self._shadows[key] = self.plan.memory.take(8 * variable.size)
        self.active[key] = self._shadows[key]
        view(self._shadows[key], variable)[:] = np.ravel(np.asarray(value, variable.dtype))
        for table, row, column, offset in rows:
            entry = self.tables.arrays[table][row]
            entry[column] = self._shadows[key] + offset
            if variable.causality == "input" and table == "converts":
                entry[[1, 5, 6]] = kind(variable.dtype), bits(1.0), bits(0.0)

    def release(self, key: Key) -> None:
        """End an override: readers get the published value again, an input its source."""
        for table, row, _, _ in self._rows(key):
            self.tables.reset(table, row)
        self.active.pop(key, None)

    def set_element(self, key: Key, element: int, value: Any) -> None:
        """Publish `value` for an element until it is changed; None: publish the member's own value again."""
        if key not in self.plan.elements:
            raise CouplingError(f"{key[0]}.{key[1]}: nothing reads it, so overriding it has no effect. Use set.")
        variable = self.members[key[0]].variables[key[1]]
        table, row = self.plan.elements[key][element]
        self.tables.reset(table, row)
        self._elements.pop((key, element), None)
        now = np.ravel(self.members[key[0]].get(key[1]))[element]
        if value is not None:
            now = self._elements[key, element] = np.array([value], variable.dtype)
            self.tables.arrays[table][row][0] = now.ctypes.data
        view(self.plan.published[key], variable)[element : element + 1] = now

    def hold(self) -> None:
        """Write the overridden elements again after the array was published."""
        for (key, element), value in self._elements.items():
            view(self.plan.published[key], self.members[key[0]].variables[key[1]])[element : element + 1] = value

    def _rows(self, key: Key) -> list[RowReference]:
        variable = self.members[key[0]].variables[key[1]]
        rows = self.plan.writers.get(key, []) if variable.causality == "input" else self.plan.readers.get(key, [])
        if not rows:
            raise CouplingError(f"{key[0]}.{key[1]}: nothing reads it, so overriding it has no effect. Use set.")
        return rows
