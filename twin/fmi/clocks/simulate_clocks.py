"""An FMU with clocks alone: its steps end where a clock ticks, a row of its inputs lets one tick, or it ends them itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.coupling import Events
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.fmi.clocks.clocked_member import ClockedMember
    from twin.fmi.csv_tables import Inputs
    from twin.fmi.sampling import Sampler
    from twin.fmi.simulation import Outcome, SimulationPlan

FLAGS = 5  # words that fmi3DoStep writes: event, terminate, early return, last successful time, spare


class Fed:
    """A table that sets a member's inputs; a clock ticks at the time of a row where its value is true, once."""

    def __init__(self, member: ClockedMember, inputs: Inputs) -> None:
        self.member, self.inputs = member, inputs
        is_clock = [column.variable.type == "Clock" for column in inputs.columns]
        self.values = [column for column, ticks in zip(inputs.columns, is_clock, strict=True) if not ticks]
        self.ticks = [
            (clock.nanoseconds(float(time)), column.variable.name)
            for column in (column for column, ticks in zip(inputs.columns, is_clock, strict=True) if ticks)
            for time in inputs.times[column.rows[:, 0]]
        ]
        self.ticks.sort(key=lambda tick: tick[0], reverse=True)

    @property
    def due(self) -> clock.Time | None:
        """When the next row lets a clock tick [ns]."""
        return self.ticks[-1][0] if self.ticks else None

    def __call__(self, t: float) -> None:
        """Set the inputs to their values at t [s]."""
        for column in self.values:
            value = self.inputs.at(column, t)
            self.member.set(column.variable.name, value if column.variable.shape else value[0])

    def let_tick(self, now: clock.Time) -> None:
        """Let the clocks tick whose rows have come."""
        while self.ticks and self.ticks[-1][0] <= now:
            time, name = self.ticks.pop()
            if time == now:
                self.member.set(name, value=True)


class Alone:
    """Run of one member, created after its initialization; includes the event at the start."""

    def __init__(self, member: ClockedMember, plan: SimulationPlan, feed: Any) -> None:
        self.member, self.plan = member, plan
        self.feed: Fed | None = feed
        self.now = plan.start
        self.events = Events({member.name: member}, [], [])
        self.events.steps, self.is_part = self, False
        if self.feed:
            self.feed.let_tick(self.now)
        self.events.react(self.now)
        self._note_end()
        self._flags = np.zeros(FLAGS, np.int64)
        self._flag_addresses = [self._flags.ctypes.data + 8 * i for i in range(4)]

    def loop(
        self,
        sampler: Sampler,
        outcome: Outcome,
        progress: Callable[[float], None] | None,
        beat: Callable[[], None],
    ) -> None:
        """Step from start to stop, or to where the FMU ends the simulation."""
        plan = self.plan
        for k in range(plan.steps):
            end = min(plan.start + (k + 1) * plan.step, plan.stop)
            while self.now < end and not self.reason:
                beat()
                sampler.last[1] = clock.seconds(self.now)
                self.step(end, is_row=(k + 1) % plan.every == 0 or end == plan.stop)
            is_row = self.reason or (k + 1) % plan.every == 0 or end == plan.stop
            if is_row and self.now > sampler.times[-1]:
                sampler(self.now)
            if self.reason:
                outcome.notes.append(f"ended the simulation at {clock.text(self.now)}: {self.reason}")
                return
            if progress and k % 64 == 0:
                progress(k / plan.steps)

    def step(self, end: clock.Time, is_row: bool) -> None:
        """One step, not beyond `end` or the next tick [ns], and the event that ends it."""
        member = self.member
        ticks = self.events.due, member.event_time, self.feed.due if self.feed else None
        target = min([end, *(due for due in ticks if due is not None and due > self.now)])
        t, h = clock.seconds(self.now), clock.seconds(target - self.now)
        status = machine.STEP(member.step_function)(member.instance, t, h, 1, *self._flag_addresses)
        member.check(status, member.step_name)
        _, terminate, early, reached = self._flag_addresses
        if machine.read8(early):
            target = min(target, clock.nanoseconds(machine.read_float(reached), f"{member.name}: early return"))
            if target <= self.now:
                raise SimulationError(f"{member.name}: returned early at {clock.text(target)}, where its step began.")
        self.now = target
        if machine.read8(terminate):
            self.reason = "its terminate flag is set"
            return
        if self.feed:
            self.feed(clock.seconds(self.now))
            self.feed.let_tick(self.now)
        self.is_part = self.now < end or not is_row
        self.events.look(self.now)
        self._note_end()

    def time(self) -> clock.Time:
        """Where the member is [ns]."""
        return self.now

    def check(self, now: clock.Time) -> None:
        """Every tick can be met."""

    def _note_end(self) -> None:
        self.reason = "it wished so at an event" if self.events.ended else ""


def may_end_steps(member: Any) -> None:
    """Allow early return at events, if the FMU declares it."""
    member.early = member.capabilities["mightReturnEarlyFromDoStep"]
