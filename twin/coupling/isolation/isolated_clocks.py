"""Member with clocks in a separate process: values lie in shared memory, each call of `events` is a message.

An event costs a message for every call, and a communication point without one a single message.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.isolation.isolated_member import IsolatedMember
from twin.coupling.isolation.isolated_worker import from_words, to_words
from twin.coupling.member import Access, MemberVariable
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin import clock

WIDEST = 8  # size of the widest scalar and alignment of all variables [byte]


@dataclass(slots=True)
class SharedSlot:
    """Values of a variable: in shared memory; strings and binaries in this process, sent with the next message."""

    variable: MemberVariable
    values: np.ndarray[Any, Any]


def in_process(method: str) -> Callable[..., Any]:
    """Return a method of `events.Clocked` that calls the member's own in its process."""

    def call(self: IsolatedClocks, *arguments: Any) -> Any:
        return self._event(method, *arguments)

    return call


class IsolatedClocks(IsolatedMember):
    """Isolated member that implements `events.Clocked` by messages."""

    clocked = True

    def _share(self, shared: int) -> None:
        super()._share(shared)
        self.slots: dict[str, SharedSlot] = {}
        self.due: clock.Time | None = None
        self.event_time: clock.Time | None = None
        self.ended = self.has_jumped = False
        self._is_running = self._rests = False
        size = sum(self._room(variable) for variable in self.variables.values())
        first = self._take(size)
        self._span = first, first + size

    def _memory_size(self) -> int:
        return super()._memory_size() + sum(self._room(variable) for variable in self.variables.values()) + 64

    @staticmethod
    def _room(variable: MemberVariable) -> int:
        return WIDEST * max(1, variable.size)

    def exit_initialization(self) -> None:
        """Leave InitializationMode; from now on values may be clocked."""
        super().exit_initialization()
        self._is_running = True
        self._event("rest")

    # values

    def slot(self, name: str) -> SharedSlot:
        """Return the memory of a variable's values."""
        if name not in self.slots:
            variable = self.variables[name]
            if offset := self._request("slot", name):
                raw = (ctypes.c_uint8 * (variable.size * variable.dtype.itemsize)).from_address(self._memory + offset)
                values = np.ctypeslib.as_array(raw).view(variable.dtype)
            else:
                values = np.empty(variable.size, object)
                values[:] = np.ravel(np.asarray(self.get(name), object))
            self.slots[name] = SharedSlot(variable, values)
        return self.slots[name]

    def address(self, name: str) -> int:
        """Return the address of a variable in the shared memory, or 0 for strings and binaries."""
        return int(self.slot(name).values.ctypes.data) if self.variables[name].connectable else 0

    def access(self, names: list[str], write: bool) -> Access:
        """Return a call that moves values between the loop's memory and the shared slots."""

        def set_before_run(slot: SharedSlot) -> None:
            if not self._is_running:
                self.set(slot.variable.name, slot.values.reshape(slot.variable.shape)[()])

        return self.slot_access([self.slot(name) for name in names], write, set_before_run)

    # interface `events.Clocked`

    def _event(self, what: str, *arguments: Any) -> Any:
        """Call a method in the process and update the event state of this proxy."""
        inputs = {
            name: slot.values.tolist()
            for name, slot in self.slots.items()
            if not slot.variable.connectable and slot.variable.causality == "input"
        }
        self._phase = what
        try:
            if self._rests and what != "rest":
                self._rests = False
                self._event("rest")
            reply = self._request("event", what, [to_words(argument) for argument in arguments], inputs)
        except SimulationError as error:
            self.failure = error
            raise
        finally:
            self._phase = "an access"
        answer, due, announced, self.ended, self.has_jumped, values = reply
        self.due, self.event_time = from_words(due), from_words(announced)
        for name, elements in values.items():
            self.slots[name].values[:] = elements
        return answer

    due_clocks = in_process("due_clocks")
    has_news = in_process("has_news")
    enter_events = in_process("enter_events")
    tick = in_process("tick")
    evaluate = in_process("evaluate")
    ticked_clocks = in_process("ticked_clocks")
    finish = in_process("finish")
    leave_events = in_process("leave_events")

    def rest(self) -> None:
        """Begin a new communication step: all clocks are inactive. Sent with the next message."""
        self._rests = True
