"""Communication steps that are split at clock ticks: all members step to the tick, process their event, and continue.

The loop only makes complete steps, so each part is passed to it as a step of another time and length, without a row.
"""

from __future__ import annotations

import ctypes
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.execution import loop
from twin.coupling.execution.value_memory import NEVER, bits
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.coupling.events import Events
    from twin.coupling.member import Member

CHANGED = ("begin_ns", "step_ns", "per_second", "every", "condition_count")  # fields of the record for a part of a step


class EventSteps:
    """Runs the loop to its `stop`, or to the next tick. `state`: the loop's record.

    `begin`, `step`: of the communication points [ns].
    """

    def __init__(
        self,
        events: Events,
        members: Mapping[str, Member],
        periods: Mapping[str, clock.Time],
        state: Any,
        begin: clock.Time,
        step: clock.Time,
    ) -> None:
        self.events, self.state, self.begin, self.step = events, state, begin, step
        self.now: clock.Time | None = None  # begin of the rest of a step that was split
        self.target: clock.Time | None = None  # end of the part in progress
        self.is_part = False
        self.fixed_step_members = [
            name for name, member in members.items() if member.period_ns or periods[name] != step
        ]
        events.steps = self

    @property
    def _due(self) -> clock.Time | None:
        """Time of the next event that splits a step [ns]; the standard allows announced events to come somewhat late."""
        return self.events.due if self.fixed_step_members else self.events.upcoming

    def time(self) -> clock.Time:
        """Return the time at the end of the step in progress [ns]."""
        return self.begin + (int(self.state["tick"]) + 1) * self.step if self.target is None else self.target

    def check(self, now: clock.Time) -> None:
        """Stop the loop before the next tick if that is no communication point; SimulationError if it cannot be reached."""
        due = self._due
        if self.events.ended:
            self.state["stop"] = int(self.state["tick"]) + 1
            return
        if due is None or due <= now or (due - self.begin) % self.step == 0:
            return
        if not self.fixed_step_members:
            before = int((due - self.begin) // self.step)
            self.state["stop"] = min(int(self.state["stop"]), max(before, int(self.state["tick"]) + 1))
            return
        names = ", ".join(member.name for member in self.events.order if member.due == due)
        raise SimulationError(
            f"{names}: a clock ticks at t = {clock.text(due)}, between communication points of {clock.text(self.step)}, "
            f"and {', '.join(self.fixed_step_members)} cannot make a shorter step. "
            f"Use a communication step of {clock.text(clock.common_step([self.step, due - self.begin]))}."
        )

    def go(self, run: Callable[[], int]) -> int:
        """Run the loop to `stop` or less far; return its result."""
        start = self.begin + int(self.state["tick"]) * self.step
        due = self._due
        if self.now is None and (due is None or not start < due < start + self.step):
            self.check(start)
            return run()
        return self._part(run, start if self.now is None else self.now, start + self.step)

    def _part(self, run: Callable[[], int], now: clock.Time, end: clock.Time) -> int:
        """Run from `now` to the next tick, or to the end of the communication step."""
        due, state = self._due, self.state
        self.target = due if due is not None and now < due < end else end
        is_last = self.target == end
        self.is_part = not is_last
        tick, saved = int(state["tick"]), {name: int(state[name]) for name in CHANGED}
        lengths = self._lengths()
        saved_lengths, at = lengths.copy(), Fraction(now) / clock.NANOSECONDS
        state["begin_ns"], state["step_ns"], state["per_second"] = at.numerator, 0, at.denominator
        state["every"], state["stop"] = saved["every"] if is_last else NEVER, tick + 1
        state["condition_count"] = saved["condition_count"] if is_last else 0
        lengths[lengths != 0] = bits(clock.seconds(self.target - now))
        try:
            result = run()
        finally:
            lengths[:] = saved_lengths
            for name, value in saved.items():
                state[name] = value
        if result in (loop.DONE, loop.NOTICED, loop.TRIGGERED):
            self.now = None if is_last else self.target
            state["tick"] = tick + is_last
        self.target, self.is_part = None, False
        return result

    def _lengths(self) -> np.ndarray[Any, Any]:
        """Return a view of the step lengths in the loop's operations (Float64 bits)."""
        columns = len(loop.OPERATION)
        words = (ctypes.c_int64 * (int(self.state["operation_count"]) * columns)).from_address(
            int(self.state["operations"])
        )
        return np.ctypeslib.as_array(words).reshape(-1, columns)[:, loop.OPERATION.index("h")]
