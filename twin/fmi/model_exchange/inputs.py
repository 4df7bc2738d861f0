"""Inputs over time of a member that is integrated: continuous ones at every evaluation, jumps as time events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from twin.fmi.csv_tables import Inputs
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember


class Followed:
    """A table that a member's inputs follow. Where two rows have one time, the first holds until then."""

    def __init__(self, member: ExchangeMember, inputs: Inputs) -> None:
        self.member, self.inputs = member, inputs
        self.linear = [column for column in inputs.columns if column.linear]
        times = inputs.times
        is_jump = np.zeros(len(times), np.bool_)
        is_jump[1:] = (np.diff(times) == 0.0) & bool(self.linear)
        for column in inputs.columns:
            if not column.linear:
                is_jump[1:] |= np.any(column.rows[1:] != column.rows[:-1], axis=1)
        self.jumps = np.unique(times[is_jump])
        self.row_times = np.unique(times) if self.linear else times[:0]

    def __call__(self, t: float) -> None:
        """Set all inputs before the run begins at t [s]; from then on the member does."""
        if self.member.is_initializing:
            self.apply(t)

    def apply(self, t: float) -> None:
        """Set all inputs to their values from t [s] on (right limit)."""
        for column in self.inputs.columns:
            self.member.set(column.variable.name, self.inputs.value(column, t))

    def move_to(self, t: float) -> None:
        """Set the continuous inputs to their values until t [s] (left limit)."""
        index = int(np.searchsorted(self.jumps, t))
        if index < len(self.jumps) and self.jumps[index] == t:
            t = float(np.nextafter(t, -np.inf))
        for column in self.linear:
            slot = self.member.slot(column.variable.name)
            slot.values[:] = self.inputs.at(column, t)
            if slot.has_changed:
                slot.applied[:] = slot.values
                self.member.move(slot)

    def next_row(self, t: float) -> float:
        """The next row after t [s] of a continuous input, whose slope may change there."""
        index = int(np.searchsorted(self.row_times, t, side="right"))
        return float(self.row_times[index]) if index < len(self.row_times) else np.inf

    def due(self, t: float) -> float:
        """The next jump after t [s]."""
        index = int(np.searchsorted(self.jumps, t, side="right"))
        return float(self.jumps[index]) if index < len(self.jumps) else np.inf
