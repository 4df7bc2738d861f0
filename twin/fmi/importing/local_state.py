"""FMUs that keep a part of their state in this process: values that others read and write, and state callbacks for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from twin.compiler import machine
from twin.coupling import MemberVariable, StateAccess
from twin.fmi.importing import binary
from twin.fmi.importing.fmu_member import FMUMember

WORD = 8  # bytes that every scalar has room for


@dataclass(slots=True)
class VariableSlot:
    """A variable's values in this process. `applied`: the last value set in the FMU, of an input.

    `call`, `name`: the FMU's function that moves the values in the variable's direction; no name: they are not numbers.
    `clocks`: value references of its clocks; none: it may be read and set whenever the mode allows it. `is_driven`: an
    input that has all its values from a member that it is integrated with.
    """

    variable: MemberVariable
    is_input: bool
    values: np.ndarray[Any, Any]
    applied: np.ndarray[Any, Any]
    clocks: frozenset[int] = frozenset()
    name: str = ""
    call: Callable[[], int] = int
    is_driven: bool = False

    @property
    def address(self) -> int:
        """Address of the values."""
        return int(self.values.ctypes.data)

    @property
    def value(self) -> Any:
        """Copy of the values in the variable's shape, a scalar as itself."""
        return self.values.reshape(self.variable.shape).copy()[()]

    @property
    def has_changed(self) -> bool:
        """Whether an input's values from outside differ from those set in the FMU last."""
        if not self.variable.connectable:
            return self.is_input and bool(self.values.tolist() != self.applied.tolist())
        return self.is_input and not self.is_driven and self.values.tobytes() != self.applied.tobytes()

    def is_open(self, active: set[int]) -> bool:
        """Whether it may be read and set while these clocks tick."""
        return not self.clocks or not self.clocks.isdisjoint(active)


class FMUWithSlots(FMUMember):
    """FMU whose variables have values in this process, which others read and write."""

    def _describe(self, start_values: dict[str, Any]) -> None:
        self.slots: dict[str, VariableSlot] = {}
        self._keep_alive: list[Any] = []  # callbacks
        super()._describe(start_values)

    def save(self) -> Any:
        """Save the FMU state and the state in this process."""
        return super().save(), self._local_state()

    def restore(self, saved: Any) -> None:
        """Restore a saved state."""
        super().restore(saved[0])
        self._restore_local_state(saved[1])

    def state_access(self, count: int) -> StateAccess:
        """Access to the FMU state and the state in this process."""
        return self._with_local_state(super().state_access(count))

    def _with_local_state(self, own: StateAccess) -> StateAccess:
        """Extend state access to the state in this process, which is kept by the address of the FMU's state.

        It is kept by the pointer's address if there is none. Instances that share the FMU can set each other's states.
        """
        functions, saved_states = (machine.STATE(own.get), machine.STATE(own.set)), self._unpacked.saved_states

        def save(instance: int, address: int) -> int:
            if not own.get:
                machine.write64(address, address)
            status = int(functions[0](instance, address)) if own.get else binary.OK
            saved_states[machine.read64(address)] = self._local_state()
            return status

        def restore(instance: int, state: int) -> int:
            status = int(functions[1](instance, state)) if own.set else binary.OK
            self._restore_local_state(saved_states[state])
            return status

        made = StateAccess.from_callbacks(save, restore, [])
        made.pointer_addresses = own.pointer_addresses
        self._keep_alive.append(made)
        return made

    def _local_state(self) -> Any:
        """Return the state outside the FMU: values in this process."""
        return {name: (slot.values.copy(), slot.applied.copy()) for name, slot in self.slots.items()}

    def _restore_local_state(self, saved: Any) -> None:
        for name, (current, applied) in saved.items():
            self.slots[name].values[:], self.slots[name].applied[:] = current, applied
        self.failure = None

    def slot(self, name: str) -> VariableSlot:
        """Return the slot of a variable, created at its first use."""
        if name not in self.slots:
            variable = self.variables[name]
            room = self.room(WORD * variable.size) if variable.connectable else np.full(variable.size, None)
            values, is_clock = room.view(variable.dtype)[: variable.size], variable.type == "Clock"
            is_input = variable.causality == "input" and not is_clock
            clocks = frozenset(self._unpacked.description.clocks.of.get(variable.references[0], ()))
            slot = self.slots[name] = VariableSlot(variable, is_input, values, values.copy(), clocks)
            if variable.connectable and not is_clock:
                access = FMUMember.access(self, [name], write=is_input)
                slot.name, slot.call = access.name, partial(access.call, self.instance, slot.address)
            self.fill(slot)
        return self.slots[name]

    def room(self, size: int) -> np.ndarray[Any, Any]:
        """Fresh bytes for values."""
        return np.zeros(size, np.uint8)

    def fill(self, slot: VariableSlot) -> None:
        """Give a new slot its first values."""
        raise NotImplementedError

    def address(self, name: str) -> int:
        """Return the address of a variable's values in this process."""
        return self.slot(name).address if self.variables[name].connectable else 0

    def check(self, status: int, what: str) -> None:
        """Raise the stored exception of a callback, or `SimulationError` if its status says that it failed."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure
        super().check(status, what)
