"""Scheduled Execution: FMI 3.0.2, section 5. The importer is the scheduler, and this is its schedule.

At a communication point where clocks tick, their model partitions run one after the other, none is preempted: those of small
`priority` first, of equal ones in the order of declaration. A partition's inputs are set before it runs, its outputs read
after it. What it lets tick at the same time (a countdown of 0 s) runs when all of those are done.
"""

from __future__ import annotations

import ctypes
from typing import Any

from twin import clock
from twin.coupling import StateAccess
from twin.fmi.clocks.clock_declarations import CHANGED
from twin.fmi.clocks.clocked_member import ClockedMember
from twin.fmi.importing import binary


class ScheduledMember(ClockedMember):
    """An FMU for Scheduled Execution: it computes when its clocks tick, and does nothing between."""

    interface = "ScheduledExecution"
    step_name = "schedule"

    def _describe(self, start_values: dict[str, Any]) -> None:
        super()._describe(start_values)
        self.identity["interface"] = "Scheduled Execution"
        self.has_fmu_state = True  # a step does nothing, whatever becomes of it

    def _instance_options(self) -> dict[str, Any]:
        return {"update_clocks": self._update_clocks}

    def _find_step(self) -> None:
        self.step_by(self._step)

    def _step(self, *_: Any) -> int:
        return binary.OK

    def save(self) -> Any:
        """Save the state in this process; the FMU's own does not change between ticks."""
        return self._local_state()

    def restore(self, saved: Any) -> None:
        """Restore a saved state."""
        self._restore_local_state(saved)

    def state_access(self, count: int) -> StateAccess:
        """Access to the state in this process only."""
        self._local_state_pointers = [ctypes.c_void_p() for _ in range(count)]
        addresses = tuple(map(ctypes.addressof, self._local_state_pointers))
        return self._with_local_state(StateAccess(pointer_addresses=addresses))

    def _update_clocks(self) -> None:
        """Clock Update Mode, entered by a running partition: read its output clocks and countdown intervals."""
        try:
            self.sense()
            for timer in self.timers.values():
                if timer.own.variability == "countdown":
                    interval, qualifier = self.read_interval(timer.own)
                    if qualifier == CHANGED:
                        timer.update(self._now, interval, qualifier)
        except BaseException as error:  # nothing may pass through native frames
            self.failure = error

    # what `coupling.events` asks

    def has_news(self, _now: clock.Time) -> bool:
        """Whether inputs wait for a partition or a clock tick was requested."""
        return bool(self._waiting or self._to_tick)

    def enter_events(self, now: clock.Time) -> None:
        """The scheduler looks at the FMU."""
        self.has_signalled = False
        self.apply_waiting(now)

    def evaluate(self, now: clock.Time) -> bool:
        """Run the partitions of clocks that tick; whether there were any."""
        due, self._new = (
            sorted(self._new, key=lambda activation: activation.priority),
            [],
        )  # a sort keeps the order of declaration
        for own in due:
            others, self.active = self.active, {own.reference}
            self.apply_inputs()
            self._call("fmi3ActivateModelPartition", own.reference, clock.seconds(now))
            self.check(binary.OK, "fmi3ActivateModelPartition")
            self.take()
            self.active |= others
        return bool(due)

    def finish(self, now: clock.Time) -> bool:
        """End the instant; there is another only if a clock ticks again."""
        self.reschedule_periodic(now, self.active)
        self.active.clear()
        return False

    def reschedule_periodic(self, now: clock.Time, ticked: set[int]) -> None:
        """Ask for the intervals that may change without a callback."""
        for timer in self.timers.values():
            own = timer.own
            if timer.needs_interval_query and own.variability != "countdown" and own.reference in ticked:
                timer.update(now, *self.read_interval(own))

    def leave_events(self) -> None:
        """Nothing runs until the next tick."""
