"""Communication steps that are cut where a clock ticks: all members step to the tick, have their event, and step on.

The loop makes whole steps, so it is told of each part as if it were one: another time, another length, no row.
"""

from __future__ import annotations

import ctypes
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling.execution import loop
from twin.coupling.execution.plan import bits
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.coupling.events import Events
    from twin.coupling.member import Member

NEVER = 1 << 62  # communication points between two rows
TIMES = ("begin_ns", "step_ns", "per_second", "every")


class EventSteps:
    """Runs the loop to where it is told to go, or to the next tick. `state`: the loop's record.

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
        self.now: clock.Time | None = None  # where the step was cut that is at work
        self.target: clock.Time | None = None  # where the part of it ends that is at work
        self.is_part = False
        self.rigid = [name for name, member in members.items() if member.period_ns or periods[name] != step]
        events.steps = self

    @property
    def _due(self) -> clock.Time | None:
        """When the next event is that a step is cut for [ns]; what is announced may come somewhat late, says the standard."""
        return self.events.due if self.rigid else self.events.upcoming

    def time(self) -> clock.Time:
        """Where the members are at the end of the step that is at work [ns]."""
        return self.begin + (int(self.state["tick"]) + 1) * self.step if self.target is None else self.target

    def check(self, now: clock.Time) -> None:
        """Let the loop stop before the next tick if that is no communication point; SimulationError if it cannot be met."""
        due = self._due
        if self.events.ended:
            self.state["stop"] = int(self.state["tick"]) + 1
            return
        if due is None or due <= now or (due - self.begin) % self.step == 0:
            return
        if not self.rigid:
            before = int((due - self.begin) // self.step)
            self.state["stop"] = min(int(self.state["stop"]), max(before, int(self.state["tick"]) + 1))
            return
        names = ", ".join(member.name for member in self.events.order if member.due == due)
        raise SimulationError(
            f"{names}: a clock ticks at t = {clock.text(due)}, between communication points of {clock.text(self.step)}, "
            f"and {', '.join(self.rigid)} cannot make a shorter step. "
            f"Use a communication step of {clock.text(clock.common_step([self.step, due - self.begin]))}."
        )

    def go(self, run: Callable[[], int]) -> int:
        """On to `stop`, or less far: what the loop returned."""
        start = self.begin + int(self.state["tick"]) * self.step
        due = self._due
        if self.now is None and (due is None or not start < due < start + self.step):
            self.check(start)
            return run()
        return self._part(run, start if self.now is None else self.now, start + self.step)

    def _part(self, run: Callable[[], int], now: clock.Time, end: clock.Time) -> int:
        """From where the members are to the next tick, or to the end of the communication step."""
        due, state = self._due, self.state
        self.target = due if due is not None and now < due < end else end
        is_last = self.target == end
        self.is_part = not is_last
        tick, saved = int(state["tick"]), {name: int(state[name]) for name in TIMES}
        lengths = self._lengths()
        saved_lengths, at = lengths.copy(), Fraction(now) / clock.NANOSECONDS
        state["begin_ns"], state["step_ns"], state["per_second"] = at.numerator, 0, at.denominator
        state["every"], state["stop"] = saved["every"] if is_last else NEVER, tick + 1
        lengths[lengths != 0] = bits(clock.seconds(self.target - now))
        try:
            result = run()
        finally:
            lengths[:] = saved_lengths
            for name, value in saved.items():
                state[name] = value
        if result in (loop.DONE, loop.NOTICED):
            self.now = None if is_last else self.target
            state["tick"] = tick + is_last
        self.target, self.is_part = None, False
        return result

    def _lengths(self) -> np.ndarray[Any, Any]:
        """Lengths of the steps in the loop's operations, Float64 bits, in place."""
        columns = len(loop.OPERATION)
        words = (ctypes.c_int64 * (int(self.state["operation_count"]) * columns)).from_address(
            int(self.state["operations"])
        )
        return np.ctypeslib.as_array(words).reshape(-1, columns)[:, loop.OPERATION.index("h")]
