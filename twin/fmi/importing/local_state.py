"""FMUs that keep a part of their state in this process: values that others read and write, and state callbacks for them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.coupling import Access, MemberVariable, StateAccess
from twin.errors import TwinError, described
from twin.fmi.importing import binary
from twin.fmi.importing.fmu_member import FMUMember

if TYPE_CHECKING:
    from collections.abc import Sequence


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
        own, saved_states = super().state_access(count), self._unpacked.saved_states
        return both(own, self._local_state, self._restore_local_state, saved_states, self._keep_alive)

    def _local_state(self) -> Any:
        """Return the state outside the FMU: values in this process."""
        return {name: (slot.values.copy(), slot.applied.copy()) for name, slot in self.slots.items()}

    def _restore_local_state(self, saved: Any) -> None:
        for name, (current, applied) in saved.items():
            self.slots[name].values[:], self.slots[name].applied[:] = current, applied
        self.failure = None

    def slot(self, name: str) -> VariableSlot:
        """Return the slot of a variable, created at its first use."""
        raise NotImplementedError

    def address(self, name: str) -> int:
        """Return the address of a variable's values in this process."""
        return self.slot(name).address if self.variables[name].connectable else 0

    def slot_access(self, slots: Sequence[VariableSlot], write: bool) -> Access:
        """Create a call that copies values between memory and slots."""

        def moved(_instance: int, _references: int, _count: int, address: int, _size: int) -> int:
            for slot in slots:
                ends = (slot.address, address) if write else (address, slot.address)
                ctypes.memmove(*ends, slot.values.nbytes)
                address += slot.values.nbytes
            return binary.OK

        self._keep_alive.append(machine.ACCESS(self.guarded(moved)))
        return Access.from_callback(self._keep_alive[-1], [slot.variable for slot in slots])

    def guarded(self, call: Callable[..., int]) -> Callable[..., int]:
        """Wrap a callback: store its exception, since none may pass through native frames."""

        def called(*arguments: Any) -> int:
            try:
                return call(*arguments)
            except BaseException as error:  # also Ctrl-C
                self.failure = error
                self.log.append(str(error) if isinstance(error, TwinError) else described(error))
                return binary.ERROR

        return called

    def check(self, status: int, what: str) -> None:
        """Raise the stored exception of a callback, or `SimulationError` if its status says that it failed."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure
        super().check(status, what)


def both(
    own: StateAccess,
    take: Callable[[], Any],
    put: Callable[[Any], None],
    saved_states: dict[int, Any],
    keep_alive: list[Any],
) -> StateAccess:
    """Extend state access to the state in this process. `keep_alive` must live as long as the returned access.

    `saved_states`: what `take` returned, by the address of the FMU's state, or the pointer's address if it has none. Instances
    that share it can set each other's states.
    """
    functions = machine.STATE(own.get), machine.STATE(own.set)

    def save(instance: int, address: int) -> int:
        if not own.get:
            machine.write64(address, address)
        status = int(functions[0](instance, address)) if own.get else binary.OK
        saved_states[machine.read64(address)] = take()
        return status

    def restore(instance: int, state: int) -> int:
        status = int(functions[1](instance, state)) if own.set else binary.OK
        put(saved_states[state])
        return status

    made = machine.STATE(save), machine.STATE(restore)
    keep_alive += [*made, *functions]
    addresses = [ctypes.cast(callback, ctypes.c_void_p).value or 0 for callback in made]
    return StateAccess(get=addresses[0], set=addresses[1], pointer_addresses=own.pointer_addresses)
