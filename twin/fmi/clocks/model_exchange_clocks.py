"""Clocks of an FMU for Model Exchange: they tick at events of the system that it is integrated with, wherever these are.

A tick is a time event that the solver does not pass. Clocks of several such FMUs cannot be connected yet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import Access
from twin.errors import FMUError
from twin.fmi.clocks.clock_calls import ClockedFMU
from twin.fmi.clocks.clock_declarations import computed
from twin.fmi.importing.local_state import VariableSlot
from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

if TYPE_CHECKING:
    from twin.fmi.csv_tables import Inputs
    from twin.fmi.model_exchange.inputs import Followed


class ClockedExchangeMember(ClockedFMU, ExchangeMember):
    """An FMU for Model Exchange with clocks."""

    def _describe(self, start_values: dict[str, Any]) -> None:
        self.active: set[int] = set()  # clocks that tick in the present instant, by value reference
        super()._describe(start_values)
        self.has_cheap_fmu_state = False  # The FMU state does not contain the timers.

    def follow(self, inputs: Inputs) -> Followed:
        """Take inputs over time from a table; ticks are for FMUs that step."""
        if clocks := [column.variable.name for column in inputs.columns if column.variable.type == "Clock"]:
            raise FMUError(f"{self.name}: {clocks[0]} cannot tick by a table in Model Exchange. Leave the column out.")
        return super().follow(inputs)

    def exit_initialization(self) -> None:
        """Query the first ticks and create the slots of clocked variables before the mode ends."""
        self.begin_timers()
        for name, variable in self.variables.items():
            if variable.type == "Clock" or self._unpacked.description.clocks.of.get(variable.references[0]):
                self.slot(name)
        super().exit_initialization()

    def _step(self, _instance: int, t: float, h: float, _: int, *flags: int) -> int:
        for name in self.clocks:
            self.slot(name).values[:] = False
        return super()._step(_instance, t, h, _, *flags)

    def _local_state(self) -> tuple[Any, ...]:
        timers = {name: (timer.interval, timer.due) for name, timer in self.timers.items()}
        return super()._local_state(), timers, self._now, list(self._to_tick)

    def _restore_local_state(self, saved: tuple[Any, ...]) -> None:
        member_state, timers, self._now, to_tick = saved
        super()._restore_local_state(member_state)
        self._to_tick = list(to_tick)
        for name, (interval, due) in timers.items():
            self.timers[name].interval, self.timers[name].due = interval, due

    # values

    def is_open(self, slot: VariableSlot) -> bool:
        """Whether a variable may be read or set now."""
        return self.is_initializing or slot.is_open(self.active)

    def move(self, slot: VariableSlot) -> None:
        """Move values between here and the FMU; those of clocks that do not tick stay as they are."""
        if slot.variable.type != "Clock" and self.is_open(slot):
            super().move(slot)

    def get(self, name: str) -> Any:
        """Read a variable; a clocked one has its value of the last tick."""
        slot = self.slots.get(name)
        if slot is None or (slot.variable.type != "Clock" and self.is_open(slot)):
            return super().get(name)
        return slot.value

    def set(self, name: str, value: Any) -> None:
        """Set a variable; a triggered input clock ticks at the next event, which that is."""
        own = self.clocks.get(name)
        if own is None:
            super().set(name, value)
        else:
            self.request_tick(own, value)

    def access(self, names: list[str], write: bool) -> Access:
        """Create the call that copies these variables; clocked ones are read from their slots."""
        slots = [self.slot(name) for name in names]
        if write or not any(slot.clocks or slot.variable.type == "Clock" for slot in slots):
            return super().access(names, write)
        return self.slot_access(slots, write)

    # events

    def has_changed(self) -> bool:
        """Whether others have written an input, or let a clock tick."""
        return bool(self._to_tick) or super().has_changed()

    def apply(self) -> None:
        """In Event Mode, set changed inputs and activate the clocks that are due."""
        super().apply()
        assert self.system is not None
        self._now = computed(self.system.t, self.name)
        self._tick()

    def _tick(self) -> bool:
        """Activate the clocks that are due; return whether there are any."""
        due = self.due
        if due is not None and clock.seconds(due) <= clock.seconds(self._now):
            self._now = max(self._now, due)
        names = self.due_clocks(self._now)
        if not names:
            return False
        ticking = [self.clocks[name] for name in names]
        self.set_clocks(ticking)
        self.active |= {clock.reference for clock in ticking}
        for name in names:
            self.slot(name).values[:] = True
            if name in self.timers:
                self.timers[name].ticked(self._now)
        for slot in self.slots.values():
            if slot.is_input and slot.clocks:
                self.move(slot)
        return True

    def update(self) -> tuple[bool, bool, float]:
        """Read clocked outputs, then update as in the base class; the next tick is a time event, too."""
        for own in self._sensed:
            if self.is_ticking(own):
                self.active.add(own.reference)
                self.slot(own.name).values[:] = True
        for slot in self.slots.values():
            if not slot.is_input and slot.clocks:
                self.move(slot)
        needed, ends, due = super().update()
        ticked = self.active.copy()
        self.active.clear()
        self.reschedule(self._now, ticked)
        again = self._tick()
        following = self.due
        return needed or again, ends, due if following is None else min(due, clock.seconds(following))
