"""State callbacks of a member that keeps a part of its state in this process, outside the FMU state."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from twin.compiler import machine
from twin.coupling import StateAccess
from twin.fmi.importing import binary

if TYPE_CHECKING:
    from collections.abc import Callable


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
