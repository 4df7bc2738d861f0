"""The way back of a member that keeps a part of its state in this process: the FMU's own way, and what is beside it."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from twin.compiler import machine
from twin.coupling import Way
from twin.fmi.importing import binary

if TYPE_CHECKING:
    from collections.abc import Callable


def both(own: Way, take: Callable[[], Any], put: Callable[[Any], None], kept: list[Any]) -> Way:
    """A way back that also takes, and puts back, what lies in this process; `kept`: must live as long as the way."""
    beside: dict[int, Any] = {}  # by the address of the FMU's state, or its place where it has none
    functions = machine.STATE(own.get), machine.STATE(own.set)

    def save(instance: int, place: int) -> int:
        if not own.get:
            machine.write64(place, place)
        status = int(functions[0](instance, place)) if own.get else binary.OK
        beside[machine.read64(place)] = take()
        return status

    def restore(instance: int, state: int) -> int:
        status = int(functions[1](instance, state)) if own.set else binary.OK
        put(beside[state])
        return status

    made = machine.STATE(save), machine.STATE(restore)
    kept += [*made, *functions]
    addresses = [ctypes.cast(one, ctypes.c_void_p).value or 0 for one in made]
    return Way(get=addresses[0], set=addresses[1], places=own.places)
