"""Third-party FMU with clocks as a member: common base of Event Mode of Co-Simulation and Scheduled Execution.

A clocked variable may be read and set only while one of its clocks ticks, and discrete inputs only at events. So what others
read and write lies in this process (`address`), and keeps its values from tick to tick; `coupling.events` says when to
look. A clock's value is whether it has ticked since the last communication point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import Access, MemberVariable
from twin.fmi import values
from twin.fmi.clocks.clock_calls import ClockedFMU
from twin.fmi.clocks.clock_declarations import Clock
from twin.fmi.importing.local_state import VariableSlot

if TYPE_CHECKING:
    from twin.fmi.csv_tables import Inputs


class ClockedMember(ClockedFMU):
    """An FMU with clocks for Co-Simulation or Scheduled Execution."""

    clocked = True

    def _describe(self, start_values: dict[str, Any]) -> None:
        self.free_inputs: list[VariableSlot] = []  # inputs that may be set between events
        self.discrete_inputs: list[VariableSlot] = []  # inputs whose change is an event
        self.clocked_inputs: list[VariableSlot] = []
        self.outputs: list[VariableSlot] = []  # and whatever else is read
        self.lit: list[VariableSlot] = []  # of the clocks that have ticked in this communication step
        super()._describe(start_values)
        self.has_cheap_fmu_state = False  # Much of the state is in this process.
        self.active: set[int] = set()  # clocks that tick in the present instant, by value reference
        self._new: list[Clock] = []  # active clocks not yet set in the FMU
        self._sensed_ticks: list[str] = []  # clocks that the FMU activated since `found` was called last
        self._waiting: dict[str, Any] = {}  # values to set at the next event
        self.is_running = self.has_signalled = self.ended = self.has_jumped = False
        self.event_time: clock.Time | None = None  # of an event that the FMU announced

    # call sequence

    def exit_initialization(self) -> None:
        """Query the first ticks, and values readable in Initialization Mode only, before the mode ends."""
        self.begin_timers()
        declarations = self._unpacked.description.clocks
        for name, variable in self.variables.items():
            clocked = variable.references[0] in self._unpacked.description.clocks.of and variable.causality != "input"
            if clocked or variable.type == "Clock":
                slot = self.slot(name)
                if clocked and variable.references[0] in declarations.initial:
                    self.move(slot)
        super().exit_initialization()
        self.is_running = True
        self.take()

    # what `coupling.events` asks

    def tick(self, name: str, now: clock.Time) -> bool:
        """Activate an input clock in the present instant; return False if it is active already."""
        own = self.clocks[name]
        if own.reference in self.active:
            return False
        self.active.add(own.reference)
        self._new.append(own)
        if name in self.timers:
            self.timers[name].ticked(now)
        self.light(name)
        return True

    def light(self, name: str) -> None:
        """Set the clock's value until the next communication step."""
        slot = self.slot(name)
        slot.values[:] = True
        self.lit.append(slot)

    def has_news(self, now: clock.Time) -> bool:
        """Whether there is an event now, apart from clock ticks."""
        if self.event_time is not None and self.event_time <= now:
            return True
        return (
            self.has_signalled
            or bool(self._waiting or self._to_tick)
            or any(variable.has_changed for variable in self.discrete_inputs)
        )

    def ticked_clocks(self) -> list[str]:
        """Return the clocks that the FMU activated since the last call."""
        ticked, self._sensed_ticks = self._sensed_ticks, []
        return ticked

    # values

    def set(self, name: str, value: Any) -> None:
        """Set a variable, at the next event where it is not an input; a clock ticks then, or has a new interval."""
        variable = self.variables[name]
        if variable.type == "Clock":
            self._set_clock(self.clocks[name], value)
        elif not self.is_running:
            super().set(name, value)
        elif variable.causality == "input":
            slot = self.slot(name)
            slot.values[:] = np.ravel(values.array(variable, value, self._items[name], self.name))
        else:
            self._waiting[name] = value

    def _set_clock(self, own: Clock, value: Any) -> None:
        if own.is_settable and own.variability == "tunable" and self.is_running:
            self._waiting[own.name] = self._interval(own, value)
        else:
            self.request_tick(own, value)

    def apply_waiting(self, now: clock.Time) -> None:
        """Apply, at an event, the values that were set between events."""
        self._now = now
        waiting, self._waiting = self._waiting, {}
        for name, value in waiting.items():
            if name in self.timers:
                timer = self.timers[name]
                timer.interval = self._set_interval(timer.own, value)
                timer.due = now + timer.interval
            else:
                super().set(name, value)

    def get(self, name: str) -> Any:
        """Read a variable; a clocked one has its value of the last tick."""
        variable = self.variables[name]
        slot = self.slots.get(name)
        if variable.type != "Clock" and (not self.is_running or slot is None):
            return super().get(name)
        assert slot is not None
        return slot.value

    def _write(self, variable: MemberVariable, value: np.ndarray[Any, Any]) -> None:
        super()._write(variable, value)
        if variable.causality == "input":
            slot = self.slot(variable.name)
            slot.values[:] = slot.applied[:] = np.ravel(value)

    def fill(self, slot: VariableSlot) -> None:
        """Start with the start value, or with that of now."""
        variable = slot.variable
        if variable.start is not None:
            slot.values[:] = slot.applied[:] = np.ravel(variable.start)
        if variable.type != "Clock":
            self._group(slot).append(slot)
            if self.is_running and not slot.is_input and not slot.clocks:
                self.move(slot)

    def _group(self, slot: VariableSlot) -> list[VariableSlot]:
        if not slot.is_input:
            return self.outputs
        if slot.clocks:
            return self.clocked_inputs
        return self.free_inputs if slot.variable.variability == "continuous" else self.discrete_inputs

    def move(self, slot: VariableSlot) -> None:
        """Set an input's values in the FMU, or read another variable's from it."""
        name = slot.variable.name
        if slot.name:
            self.check(slot.call(), f"{slot.name} of {name}")
        elif slot.is_input:
            shaped = slot.values.reshape(slot.variable.shape) if slot.variable.shape else slot.values
            super()._write(slot.variable, shaped)
        else:
            slot.values[:] = np.ravel(np.asarray(super()._read_objects(slot.variable), object))
        if slot.is_input:
            slot.applied[:] = slot.values

    def access(self, names: list[str], write: bool) -> Access:
        """Create a call that copies values between memory and the slots."""
        return self.slot_access([self.slot(name) for name in names], write)

    def sense(self) -> None:
        """Poll the FMU's output clocks for ticks."""
        for own in self._sensed:
            if own.reference not in self.active and self.is_ticking(own):
                self.active.add(own.reference)
                self._sensed_ticks.append(own.name)
                self.light(own.name)

    def take(self) -> None:
        """Read all values that are readable while the active clocks tick."""
        for slot in self.outputs:
            if slot.is_open(self.active):
                self.move(slot)

    def apply_inputs(self) -> bool:
        """Set changed inputs that may be set while the active clocks tick; return whether there were any."""
        inputs = (*self.free_inputs, *self.discrete_inputs, *self.clocked_inputs)
        changed = [variable for variable in inputs if variable.has_changed and variable.is_open(self.active)]
        for slot in changed:
            self.move(slot)
        return bool(changed)

    def follow(self, inputs: Inputs) -> Callable[[float], None]:
        """Take inputs and ticks from a table, as `simulate_clocks` does."""
        from twin.fmi.clocks.simulate_clocks import Fed

        return Fed(self, inputs)

    def rest(self) -> None:
        """Reset the clock values at the begin of a communication step."""
        for slot in self.lit:
            slot.values[:] = False
        self.lit.clear()
