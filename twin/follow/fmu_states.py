"""States of the third-party FMUs in a batch: copied between instances, saved and restored by FMI's functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.coupling import RecordMember, StateTransfer, verify_copy
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from twin.coupling import CoSimulation


@dataclass(frozen=True)
class StateSlot:
    """Saved states of all FMUs: transfers that save them again, and that restore them."""

    save: StateTransfer
    restore: StateTransfer


class FmuStates:
    """States of the FMUs of an initialized co-simulation. `slots`: saved states that are no longer needed."""

    def __init__(self, simulation: CoSimulation, build: Path) -> None:
        self.simulation, self._build = simulation, build
        self.members = {name: m for name, m in simulation.members.items() if not isinstance(m, RecordMember)}
        self._access = {name: member.state_access(1) for name, member in self.members.items()}  # for copies
        self.slots: list[StateSlot] = []

    def verify(self, pairs: Iterable[Sequence[str]]) -> None:
        """Refuse FMUs whose state does not continue in another instance, by trial; SimulationError names the first."""
        for first, *others in pairs:
            if first not in self.members or not others:
                continue
            problem = verify_copy(self.simulation, self.members[first], self.members[others[0]], self._build)
            if problem:
                name = first.partition("#")[0]
                raise SimulationError(
                    f"{name}: says that it can save its state, and cannot: {problem}. It cannot be followed."
                )

    def transfer(self, copies: Sequence[tuple[str, Sequence[str]]], other: FmuStates | None = None) -> StateTransfer:
        """Return the call that copies states: from a member, here or of another co-simulation, to some here."""
        source = other or self
        calls = []
        for name, targets in copies:
            access = source._access[name]
            calls += [(False, source.members[name], access), *((True, self.members[t], access) for t in targets)]
        return StateTransfer(self.simulation, self._build, calls)

    def save(self) -> StateSlot:
        """Save the states of all FMUs; append the slot to `slots` when it is no longer needed."""
        if not self.slots:
            access = {name: member.state_access(1) for name, member in self.members.items()}
            transfers = [
                StateTransfer(self.simulation, self._build, [(is_set, self.members[n], a) for n, a in access.items()])
                for is_set in (False, True)
            ]
            self.slots.append(StateSlot(*transfers))
        slot = self.slots.pop()
        slot.save()
        return slot
