"""Member with clocks in a separate process: values lie in shared memory, each call of `events` is a message.

An event costs a message for every call, and a communication point without one a single message.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.coupling.isolation.isolated_member import IsolatedMember
from twin.coupling.isolation.isolated_worker import from_words, to_words
from twin.coupling.member import Access, MemberVariable
from twin.errors import SimulationError

if TYPE_CHECKING:
    from twin import clock

OK, ERROR = 0, 3
WIDEST = 8  # size of the widest scalar and alignment of all variables [byte]


@dataclass(slots=True)
class SharedSlot:
    """Values of a variable: in shared memory; strings and binaries in this process, sent with the next message."""

    variable: MemberVariable
    values: np.ndarray[Any, Any]


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
        self._calls: list[Any] = []
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
        slots = [self.slot(name) for name in names]

        def move_values(_instance: int, _references: int, _count: int, address: int, _size: int) -> int:
            try:
                for slot in slots:
                    ends = (slot.values.ctypes.data, address) if write else (address, slot.values.ctypes.data)
                    ctypes.memmove(*ends, slot.values.nbytes)
                    address += slot.values.nbytes
                    if write and not self._is_running:
                        self.set(slot.variable.name, slot.values.reshape(slot.variable.shape)[()])
            except BaseException as error:  # no exception may pass through native frames
                self.failure = error
                return ERROR
            return OK

        self._calls.append(machine.ACCESS(move_values))
        return Access.from_callback(self._calls[-1], [slot.variable for slot in slots])

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

    def due_clocks(self, now: clock.Time) -> list[str]:
        """Return the clocks that tick now."""
        return list(self._event("due_clocks", now))

    def has_news(self, now: clock.Time) -> bool:
        """Whether the member has an event now, regardless of its clocks."""
        return bool(self._event("has_news", now))

    def enter_events(self, now: clock.Time) -> None:
        """Enter Event Mode."""
        self._event("enter_events", now)

    def tick(self, name: str, now: clock.Time) -> bool:
        """Activate an input clock in this instant; return whether it was inactive."""
        return bool(self._event("tick", name, now))

    def evaluate(self, now: clock.Time) -> bool:
        """Set the member's clocks and inputs, then read its outputs; return whether anything was set."""
        return bool(self._event("evaluate", now))

    def ticked_clocks(self) -> list[str]:
        """Return the output clocks that have ticked since the last call."""
        return list(self._event("ticked_clocks"))

    def finish(self, now: clock.Time) -> bool:
        """End the instant; return whether another one is needed."""
        return bool(self._event("finish", now))

    def leave_events(self) -> None:
        """Leave Event Mode for Step Mode."""
        self._event("leave_events")

    def rest(self) -> None:
        """Begin a new communication step: all clocks are inactive. Sent with the next message."""
        self._rests = True
