"""Transfers of FMU states between instances and saved states, without Python per instance."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, compiler
from twin.compiler import call_state, read64
from twin.coupling.member import StateAccess
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.coupling.cosimulation import CoSimulation
    from twin.coupling.member import Member

RECORD = np.dtype([(name, np.int64) for name in ("rows", "count", "member", "status")], align=True)
ROW_SIZE = (
    40  # function, instance, address of the pointer, whether the call gets the pointer itself, member; 8 byte each
)

StateCall = tuple[bool, "Member", "StateAccess"]  # whether the state is set, else saved; the member; the saved state


def run(self: Any) -> int:
    """Call the functions of all rows; 1 if a member fails."""
    row = self.rows
    for _ in range(self.count):
        state = read64(row + 16)
        if read64(row + 24) != 0:
            state = read64(state)
        status = call_state(read64(row), read64(row + 8), state)
        if status > 1:
            self.member, self.status = read64(row + 32), status
            return 1
        row += 40
    return 0


class StateTransfer:
    """A native call that saves and sets FMU states in the given order. All members must outlive it."""

    def __init__(self, cosimulation: CoSimulation, build: Path, calls: Sequence[StateCall]) -> None:
        self._names = list(cosimulation.members)
        rows = [
            [
                access.set if is_set else access.get,
                member.instance,
                access.pointer_addresses[0],
                is_set,
                self._names.index(member.name) if member.name in self._names else -1,
            ]
            for is_set, member, access in calls
        ]
        self._rows = np.array(rows, np.int64).reshape(len(rows), ROW_SIZE // 8)
        self._record = np.zeros(1, RECORD)
        self._record[0]["rows"], self._record[0]["count"] = self._rows.ctypes.data, len(rows)
        self._run = compiler.load_record_function(RECORD, "states", run, "Saving and setting of FMU states.", build)
        self._address = self._record.ctypes.data

    def __call__(self) -> None:
        """Save and set the states; SimulationError if an FMU refuses it."""
        if self._run(self._address):
            member, status = self._names[int(self._record[0]["member"])], int(self._record[0]["status"])
            raise SimulationError(f"{member}: its state cannot be saved or set (status {status}).")


def shared_state(saved: StateAccess, target: StateAccess) -> StateAccess:
    """Return the access of a target to the state that another instance has saved."""
    return replace(saved, set=target.set)


def verify_copy(cosimulation: CoSimulation, first: Sequence[Member], second: Sequence[Member], build: Path) -> str:
    """Return why other instances cannot continue the state of members that step together, by trial; empty if they can.

    Both are at the same state afterwards as before.
    """
    step = cosimulation.periods[first[0].name]
    names = [[v.name for v in m.variables.values() if v.causality == "output" and v.connectable] for m in first]
    pairs = list(zip(first, second, strict=True))
    begin, moved = ([(source.state_access(1), copy.state_access(1)) for source, copy in pairs] for _ in range(2))
    flags = np.zeros(5, np.int64)

    def saved(accesses: Sequence[tuple[StateAccess, StateAccess]]) -> list[StateCall]:
        return [(False, member, access) for member, (access, _) in zip(first, accesses, strict=True)]

    def restored(accesses: Sequence[tuple[StateAccess, StateAccess]], is_first: bool) -> list[StateCall]:
        calls: list[StateCall] = []
        for (source, copy), (access, target) in zip(pairs, accesses, strict=True):
            calls += [(True, source, access)] * is_first + [(True, copy, shared_state(access, target))]
        return calls

    def outputs(members: Sequence[Member], number: int) -> list[Any]:
        t = clock.seconds(cosimulation.time + number * step)
        if any(member.try_step(t, clock.seconds(step), flags) > 1 for member in members):
            raise SimulationError(f"its step by {clock.text(step)} fails")
        return [np.array(member.get(name)) for member, own in zip(members, names, strict=True) for name in own]

    try:
        StateTransfer(cosimulation, build, saved(begin))()
        outputs(first, 0)
        StateTransfer(cosimulation, build, [*saved(moved), *restored(moved, first[0].continuous)])()
        values = zip([name for own in names for name in own], outputs(first, 1), outputs(second, 1), strict=True)
        different = [f"{name} is {a} and {b}" for name, a, b in values if a.tobytes() != b.tobytes()]
        StateTransfer(cosimulation, build, restored(begin, True))()
    except SimulationError as error:
        return str(error)
    return f"in another instance it continues otherwise: {different[0]}" if different else ""
