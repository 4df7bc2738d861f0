"""States of the third-party FMUs in a batch: copied between instances, saved and restored by FMI's functions.

What FMI lets not be set while an FMU runs, its states and fixed parameters, is set by initializing it anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import (
    Access,
    CoSimulation,
    MemberVariable,
    RecordMember,
    StateTransfer,
    Transfer,
    integrated_with,
    shared_state,
    verify_copy,
)
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    import numpy as np

    Buffers = Mapping[tuple[str, str], np.ndarray[Any, Any]]  # by member and variable


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
        self._continuous = [name for name, member in self.members.items() if member.continuous]
        self.slots: list[StateSlot] = []

    def verify(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Refuse FMUs whose state does not continue in another instance, by trial; SimulationError names the first."""
        verified = set[str]()
        for pair in pairs:
            if pair[0] not in self.members or pair[0] in verified:
                continue
            first, second = (
                [self.members[name] for name in integrated_with(own, self.simulation.members, self.simulation.links)]
                for own in pair
            )
            verified |= {member.name for member in first}
            if problem := verify_copy(self.simulation, first, second, self._build):
                name = " and ".join(member.name.partition("#")[0] for member in first)
                raise SimulationError(
                    f"{name}: says that it can save its state, and cannot: {problem}. It cannot be followed."
                )

    def transfer(self, copies: Sequence[tuple[str, Sequence[str]]], other: FmuStates | None = None) -> StateTransfer:
        """Return the call that copies states: from a member, here or of another co-simulation, to some here.

        The solver of a source for Model Exchange begins anew as those of the targets do, if the source is here.
        """
        source = other or self
        calls = []
        for name, targets in copies:
            access = source._access[name]
            restored = [name, *targets] if other is None and name in self._continuous else targets
            calls.append((False, source.members[name], access))
            calls += [(True, self.members[target], shared_state(access, self._access[target])) for target in restored]
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
        if self._continuous:
            slot.restore()  # the solvers of Model Exchange begin anew, now and after `restore`
        return slot


class FmuRestarts:
    """FMUs that are initialized anew when they are set. `buffers`: all of their states, and what is set in them."""

    def __init__(self, simulation: CoSimulation, build: Path, names: Sequence[str], buffers: Buffers) -> None:
        self.simulation, self.names = simulation, names
        self._values = {name: {v: values for (own, v), values in buffers.items() if own == name} for name in names}
        numbers = {name: number for number, name in enumerate(simulation.members)}
        self._accesses: list[Access] = []  # whose references the loop reads
        reads = []
        for name in names:
            member = simulation.members[name]
            for variable, values in self._values[name].items():
                if is_settable(member.variables[variable]):
                    continue  # it keeps the value that was set
                self._accesses.append(member.access([variable], write=False))
                reads.append(access_row(self._accesses[-1], member, values, numbers[name]))
        published = [
            row for name in names if simulation.plan.is_read_directly(name) for row in simulation.plan.gets[name]
        ]
        self.read = Transfer(simulation, build, accesses=reads)
        self._publish = Transfer(simulation, build, accesses=published)

    def set(self) -> None:
        """Initialize the FMUs at the communication point reached with the values of their buffers, and publish their outputs."""
        from twin.fmi import FMUMember, restart

        for name in self.names:
            member = self.simulation.members[name]
            assert isinstance(member, FMUMember)
            restart(member, clock.seconds(self.simulation.time), self._values[name])
        self._publish()


def access_row(access: Access, member: Any, values: np.ndarray[Any, Any], number: int) -> list[int]:
    """Return the row of the loop that gets or sets variables of a member, with its number; they lie in `values`."""
    references, address = access.references.ctypes.data, values.ctypes.data
    return [access.function, member.instance, references, access.count, address, access.size_argument, number]


def is_settable(variable: MemberVariable) -> bool:
    """Return whether FMI lets a variable be set while an FMU runs."""
    return variable.causality == "input" or (variable.causality == "parameter" and variable.variability == "tunable")
