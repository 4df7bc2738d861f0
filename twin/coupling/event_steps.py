"""Communication steps that are cut where a clock ticks: all members step to the tick, have their event, and step on.

The loop makes whole steps, so it is told of each part as if it were one: another time, another length, no row.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import loop
from twin.coupling.plan import bits
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np

    from twin.coupling.events import Events
    from twin.coupling.member import Member

LENGTH = loop.OPERATION.index("h")
NEVER = 1 << 62  # communication points between two rows
TIMES = ("begin_ns", "step_ns", "per_second", "every")


class EventSteps:
    """Runs the loop to where it is told to go, or to the next tick. `operations`: the loop's, changed in place.

    `begin`, `step`: of the communication points [ns].
    """

    def __init__(
        self, events: Events, members: Mapping[str, Member], begin: clock.Time, step: clock.Time, periods: Any
    ) -> None:
        self.events, self.begin, self.step = events, begin, step
        self.now: clock.Time | None = None  # where a step was cut that is at work
        self.target: clock.Time | None = None
        self.rigid = [name for name, one in members.items() if one.period_ns or periods[name] != step]
        events.check = self.check

    def check(self, now: clock.Time) -> None:
        """SimulationError if the next tick cannot be met, with the communication step that would do."""
        due = self.events.due
        if not self.rigid or due is None or due <= now or (due - self.begin) % self.step == 0:
            return
        names = ", ".join(one.name for one in self.events.order if one.due == due)
        raise SimulationError(
            f"{names}: a clock ticks at t = {clock.text(due)}, between communication points of {clock.text(self.step)}, "
            f"and {', '.join(self.rigid)} cannot make a shorter step. "
            f"Use a communication step of {clock.text(clock.common_step([self.step, due - self.begin]))}."
        )

    def time(self, tick: int) -> clock.Time:
        """Where the loop is at the end of the step that begins at a tick [ns]."""
        return self.begin + (tick + 1) * self.step if self.target is None else self.target

    def go(self, run: Callable[[], int], state: Any, operations: np.ndarray[Any, Any]) -> int:
        """Until `stop`, or to the next tick that is no communication point; what the loop returned."""
        tick = int(state["tick"])
        start, end = self.begin + tick * self.step, self.begin + (tick + 1) * self.step
        due = self.events.due
        if self.now is None:
            whole = state["stop"] if due is None else -(-(due - self.begin) // self.step) - 1
            is_cut = due is not None and start < due < end
            if not is_cut:
                off = due is not None and (due - self.begin) % self.step != 0
                state["stop"] = min(int(state["stop"]), int(whole)) if off and due > start else state["stop"]
                return run()
        now = start if self.now is None else self.now
        self.target = due if due is not None and now < due < end else end
        kept = {name: int(state[name]) for name in TIMES}
        lengths = operations[:, LENGTH].copy()
        exact = Fraction(now) / clock.NANOSECONDS
        state["begin_ns"], state["step_ns"], state["per_second"] = exact.numerator, 0, exact.denominator
        state["every"] = kept["every"] if self.target == end else NEVER
        state["stop"] = tick + 1
        operations[lengths != 0, LENGTH] = bits(clock.seconds(self.target - now))
        try:
            result = run()
        finally:
            operations[:, LENGTH] = lengths
            for name, value in kept.items():
                state[name] = value
            reached, self.target = self.target, None
        if result in (loop.DONE, loop.NOTICED):
            self.now = reached if reached < end else None
            state["tick"] = tick if reached < end else tick + 1
        return result
