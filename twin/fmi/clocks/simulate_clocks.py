"""An FMU with clocks alone: its steps end where a clock ticks, a row of its inputs lets one tick, or it ends them itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin import clock
from twin.compiler import machine
from twin.coupling import Events
from twin.errors import SimulationError
from twin.fmi.simulation import Stepping

if TYPE_CHECKING:
    from twin.fmi.clocks.clocked_member import ClockedMember
    from twin.fmi.csv_tables import Inputs
    from twin.fmi.simulation import SimulationPlan


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
            self.member.set(column.variable.name, self.inputs.value(column, t))

    def let_tick(self, now: clock.Time) -> None:
        """Let the clocks tick whose rows have come."""
        while self.ticks and self.ticks[-1][0] <= now:
            time, name = self.ticks.pop()
            if time == now:
                self.member.set(name, value=True)


class Alone(Stepping):
    """Run of one member, created after its initialization; includes the event at the start."""

    feed: Fed | None

    def __init__(self, member: ClockedMember, plan: SimulationPlan, feed: Any) -> None:
        super().__init__(member, plan, feed)
        self.events = Events({member.name: member}, [], [])
        self.events.steps, self.is_part = self, False
        if self.feed:
            self.feed.let_tick(self.now)
        self.events.react(self.now)
        self._note_end()

    def step(self, end: clock.Time, is_row: bool) -> None:
        """One step, not beyond `end` or the next tick [ns], and the event that ends it."""
        member: Any = self.member
        ticks = self.events.due, member.event_time, self.feed.due if self.feed else None
        target = min([end, *(due for due in ticks if due is not None and due > self.now)])
        t, h = clock.seconds(self.now), clock.seconds(target - self.now)
        member.check(self._do_step(member.instance, t, h, True, self._address), member.step_name)
        terminate, early, reached = (self._address + 8 * i for i in range(1, 4))
        if machine.read8(early):
            target = min(target, clock.nanoseconds(machine.read_float(reached), f"{member.name}: early return"))
            if target <= self.now:
                raise SimulationError(f"{member.name}: returned early at {clock.text(target)}, where its step began.")
        self.now = target
        if machine.read8(terminate):
            self.ending = f"at {clock.text(self.now)}: its terminate flag is set"
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
        if self.events.ended:
            self.ending = f"at {clock.text(self.now)}: it wished so at an event"


def may_end_steps(member: Any) -> None:
    """Allow early return at events, if the FMU declares it."""
    member.early = member.capabilities["mightReturnEarlyFromDoStep"]
