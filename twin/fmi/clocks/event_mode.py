"""Co-Simulation with Event Mode: FMI 3.0.2, sections 2.3.5 and 4.2.

At an event the FMU is in Event Mode. Its clocks are set, then its inputs; outputs and output clocks are read, until nothing
changes any more in any member; fmi3UpdateDiscreteStates ends the instant of super-dense time, and there may be another.
"""

from __future__ import annotations

from typing import Any

from twin import clock
from twin.compiler import machine
from twin.fmi.clocks.clock_declarations import computed
from twin.fmi.clocks.clocked_member import ClockedMember
from twin.fmi.importing import binary


class EventMember(ClockedMember):
    """An FMU for Co-Simulation that has clocks, and Event Mode for them. `early`: it may end steps before their end."""

    step_name = "fmi3DoStep"
    early = False

    def _instance_options(self) -> dict[str, Any]:
        return {"events": True, "early": self.early}

    def _find_step(self) -> None:
        self._do_step = machine.STEP(self._address("DoStep"))
        self.step_by(self._step)
        self.in_events = True  # that is what Initialization Mode leads to

    def _step(self, instance: int, t: float, h: float, no_return: int, *flags: int) -> int:
        for slot in self.free_inputs:
            if slot.has_changed:
                self.move(slot)
        event, *_ = flags
        machine.write8(event, 0)
        status = int(self._do_step(instance, t, h, no_return, *flags))
        if status <= binary.WARNING:
            self.has_signalled = machine.read8(event) != 0
            self.active.clear()
            self.take()
        return status

    # what `coupling.events` asks

    def enter_events(self, now: clock.Time) -> None:
        """To Event Mode."""
        if not self.in_events:
            self._call("fmi3EnterEventMode")
        self.in_events, self.has_signalled = True, False
        self._ticked: set[int] = set()
        self.apply_waiting(now)

    def evaluate(self, _now: clock.Time) -> bool:
        """Set ticks and inputs in the FMU, then read its outputs; return whether anything was set."""
        ticking, self._new = self._new, []
        if ticking:
            self.set_clocks(ticking)
        has_changed = self.apply_inputs()
        self.sense()
        self.take()
        return has_changed or bool(ticking)

    def finish(self, now: clock.Time) -> bool:
        """End the event iteration; return whether another one is needed."""
        needed, terminate, self.has_jumped, due = self.update_discrete_states()
        self._ticked |= self.active
        self.active.clear()
        self.ended = self.ended or terminate
        self.event_time = None if due is None else computed(due, f"{self.name}: next event")
        self.reschedule(now, self._ticked)
        return needed

    def leave_events(self) -> None:
        """Back to Step Mode."""
        self._call("fmi3EnterStepMode")
        self.in_events = False
