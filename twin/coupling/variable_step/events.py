"""Events between variable steps: processed after every accepted step; no step crosses the next event.

So a step that is rolled back had no event. Clocks tick at their exact times; when a member returns early, all members are
stepped to that time first.
"""

from __future__ import annotations

import ctypes
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling.variable_step.record_layout import PAST

if TYPE_CHECKING:
    from twin.coupling.events import Events
    from twin.coupling.variable_step.stage_tables import Stages

NEVER = float("inf")
WORD = 8


class VariableStepEvents:
    """Links event handling and variable steps: time of the next event, time of the members. `begin`, `step`: of ticks [ns]."""

    def __init__(self, events: Events, plan: Stages, state: Any, begin: clock.Time, step: clock.Time) -> None:
        self.events, self.plan, self.state = events, plan, state
        self.begin, self.step = begin, step
        events.steps = self
        state["events"] = events.address

    @property
    def is_part(self) -> bool:
        """Whether the current time is not a communication point."""
        return bool(self.state["off"]) or int(self.state["position"]) < int(self.state["divisions"])

    def time(self) -> clock.Time:
        """Return the time of the members [ns]; an event due at the same float is due now."""
        state = self.state
        if state["off"]:
            now, due = float(state["now"]), self.events.upcoming
            return due if due is not None and clock.seconds(due) == now else clock.nanoseconds(now)
        part = Fraction(int(state["position"]), int(state["divisions"]))
        return clock.to_time(self.begin + (int(state["tick"]) + part) * self.step)

    def check(self, now: clock.Time) -> None:
        """Set the next event or the end of the simulation; discard earlier points if values have jumped."""
        upcoming = [time for time in (self.events.upcoming,) if time is not None and time > now]
        self.state["due"] = clock.seconds(upcoming[0]) if upcoming else NEVER
        if name := self.events.ended:
            self.state["member"], self.state["finished"] = list(self.plan.members).index(name), 1
        if any(member.has_jumped for member in self.events.order):
            ctypes.memset(self.plan.past, 0, PAST * WORD)
