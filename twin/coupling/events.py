"""Events of members with clocks, processed for all of them at one instant between two communication steps.

At a communication point all members have reached that time and published. If a clock ticks there, or a member has an event,
all members with clocks enter Event Mode. Clocks tick; values and ticks propagate along the connections in the order of the
members until nothing changes: that is one instant of super-dense time. Another instant follows if a member needs it, or a
clock ticks once more at the same time. Then the next communication step begins.

The loop calls this like `fmiNGetXXX`, by a row at the end of its operations; a system without clocks has no such row.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from twin import clock
from twin.compiler import machine
from twin.coupling.execution import loop
from twin.coupling.system import stepping_order
from twin.errors import CouplingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.algorithms import Algorithm
    from twin.coupling.execution.plan import LoopPlan
    from twin.coupling.member import Member, MemberVariable
    from twin.coupling.system import ResolvedConnection

OK, ERROR = 0, 3
INSTANTS = 100  # largest number of instants of super-dense time at one communication point
SWEEPS = 100  # largest number of sweeps over all members in one instant


class Clocked(Protocol):
    """Interface of a member with clocks."""

    name: str
    variables: Mapping[str, MemberVariable]
    ended: bool
    has_jumped: bool  # whether its continuous values changed in the last event
    event_time: clock.Time | None  # time of an event that the member announced [ns]

    def slot(self, name: str) -> Any:
        """Return the memory of a variable's values."""

    @property
    def due(self) -> clock.Time | None:
        """Time of the next tick of a time-based clock [ns]; None if unknown."""

    def due_clocks(self, now: clock.Time) -> list[str]:
        """Return the clocks that tick now."""

    def has_news(self, now: clock.Time) -> bool:
        """Whether the member has an event now, regardless of its clocks."""

    def enter_events(self, now: clock.Time) -> None:
        """Enter Event Mode."""

    def tick(self, name: str, now: clock.Time) -> bool:
        """Activate an input clock in this instant; return whether it was inactive."""

    def evaluate(self, now: clock.Time) -> bool:
        """Set the member's clocks and inputs, then read its outputs; return whether anything was set."""

    def ticked_clocks(self) -> list[str]:
        """Return the output clocks that have ticked since the last call."""

    def finish(self, now: clock.Time) -> bool:
        """End the instant; return whether another one is needed."""

    def leave_events(self) -> None:
        """Leave Event Mode for Step Mode."""

    def rest(self) -> None:
        """Begin a new communication step: all clocks are inactive."""


class Steps(Protocol):
    """Interface of the stepping between events."""

    @property
    def is_part(self) -> bool:
        """Whether the communication step in progress continues after the event."""

    def time(self) -> clock.Time:
        """Return the time at the end of the step in progress [ns]."""

    def check(self, now: clock.Time) -> None:
        """Plan the steps to the next event, after an event."""


def split_links(links: list[ResolvedConnection]) -> tuple[list[ResolvedConnection], list[ResolvedConnection]]:
    """Split connections into those of values and those of clocks."""
    wires = [link for link in links if link.source.variable.type == "Clock"]
    return [link for link in links if link.source.variable.type != "Clock"], wires


def check_supported(
    members: Mapping[str, Member],
    wires: list[ResolvedConnection],
    algorithm: Algorithm,
    periods: Mapping[str, clock.Time],
    step: clock.Time,
) -> None:
    """Raise CouplingError where members or the algorithm cannot process clocks."""
    for wire in wires:
        if not all(members[end.member].clocked for end in (wire.source, wire.target)):
            source, target = (f"{end.member}.{end.variable.name}" for end in (wire.source, wire.target))
            raise CouplingError(
                f"{source} -> {target}: clocks are connected in Co-Simulation and in Scheduled Execution only, not in Model "
                "Exchange or without Event Mode. Use `interface: co_simulation`, if the FMU has it."
            )
    clocked = [name for name, member in members.items() if member.clocked]
    for name in clocked if not algorithm.is_plain else ():
        reason = ""
        if algorithm.rolls_back and not members[name].has_fmu_state:
            reason = "cannot save its state (canGetAndSetFMUState), which is needed to take a step back"
        elif members[name].period_ns:
            reason = "makes steps of one length only, which an event between two communication points would cut"
        if reason:
            raise CouplingError(
                f"{name}: has clocks and {reason}, with algorithm {algorithm}. Use jacobi or gauss_seidel, of order 0."
            )
    for name in clocked:
        if periods[name] != step:
            raise CouplingError(
                f"{name}: has clocks, so it steps with every communication step of {clock.text(step)}, not every "
                f"{clock.text(periods[name])}. Leave out its period, or use that step."
            )


class Events:
    """Event iteration over the members with clocks of a co-simulation.

    `links`: connections of values, `wires`: connections of clocks. `steps`: the stepping that asks for events.
    """

    def __init__(
        self, members: Mapping[str, Member], links: list[ResolvedConnection], wires: list[ResolvedConnection]
    ) -> None:
        self.members: dict[str, Clocked] = {name: member for name, member in members.items() if member.clocked}  # type: ignore[misc]
        self.index = list(members).index(next(iter(self.members))) if self.members else 0
        self.links = [link for link in links if link.target.member in self.members]
        inside = [link for link in self.links + wires if link.source.member in self.members]
        catalog = {name: member.variables for name, member in members.items() if name in self.members}
        self.order = [self.members[name] for name in stepping_order(list(self.members), inside, catalog)]
        self.wires: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for link in wires:
            self.wires.setdefault(link.source.key, []).append(link.target.key)
        self._rows: dict[str, list[tuple[str, int]]] = {}
        self._objects = [link for link in inside if not link.source.variable.connectable]
        self._callback = machine.ACCESS(self._call)
        self.address = machine.address_of(self._callback)
        self.failure: BaseException | None = None
        self.now: clock.Time = 0  # time of the last event [ns]
        self.goes_on = False  # whether the step in progress was split before
        self.steps: Steps

    def connect(self, plan: LoopPlan, arrays: Mapping[str, Any]) -> None:
        """Store the rows by which the loop moves values to the members, with overrides."""
        self._arrays = arrays
        self._rows = {name: [] for name in self.members}
        for link in self.links:
            rows = plan.rows_at_events(link.target.key)
            member_rows = self._rows[link.target.member]
            member_rows += [row for row in rows if row not in member_rows]

    @property
    def due(self) -> clock.Time | None:
        """Time of the next clock tick [ns]; None if unknown."""
        return min((due for member in self.order if (due := member.due) is not None), default=None)

    @property
    def upcoming(self) -> clock.Time | None:
        """Time of the next event [ns]: a tick, or an event announced by a member."""
        announced = (member.event_time for member in self.order)
        return min((time for time in (self.due, *announced) if time is not None), default=None)

    @property
    def ended(self) -> str:
        """Name of the member that terminates the simulation, or empty."""
        return next((member.name for member in self.order if member.ended), "")

    def _call(self, *_: int) -> int:
        try:
            self.look(self.steps.time())
        except BaseException as error:  # also KeyboardInterrupt: no exception may pass through native frames
            self.failure = error
            return ERROR
        return OK

    def look(self, now: clock.Time) -> None:
        """Process an event at `now`, the time of all members, if there is one."""
        for member in self.order:
            if not self.goes_on:
                member.rest()
            self._move(member)
        self.goes_on = self.steps.is_part
        due = self.due
        if (due is not None and due <= now) or any(member.has_news(now) for member in self.order):
            self.react(now)

    def interfere(self, now: clock.Time) -> None:
        """Process an external event after a communication point; its ticks belong to the next step."""
        if not self.goes_on:
            for member in self.order:
                member.rest()
        self.goes_on = True
        self.react(now)

    def react(self, now: clock.Time) -> None:
        """Run the event iteration over all members with clocks."""
        self.now = now
        try:
            self._iterate(now)
        except SimulationError as error:
            if f"t = {clock.text(now)}" in str(error):
                raise
            raise SimulationError(f"{error} That was in the event at t = {clock.text(now)}.") from error
        self.steps.check(now)

    def _iterate(self, now: clock.Time) -> None:
        for member in self.order:
            member.enter_events(now)
        needed = True  # fmi3UpdateDiscreteStates must be called at least once
        for _ in range(INSTANTS):
            has_ticked = self._tick(now)
            if not (self._settle(now) or has_ticked or needed):
                break
            requests = [member.finish(now) for member in self.order]
            needed = any(requests)
            if self.ended:
                break
        else:
            raise SimulationError(
                f"{', '.join(self.members)}: the event at t = {clock.text(now)} has no end after {INSTANTS} instants. "
                "Look for clocks that let each other tick, and values that switch each other."
            )
        for member in self.order:
            member.leave_events()

    def _tick(self, now: clock.Time) -> bool:
        """Tick the clocks that are due, and those connected to them."""
        ticked = [self._tick_clock(member, name, now) for member in self.order for name in member.due_clocks(now)]
        return any(ticked)

    def _tick_clock(self, member: Clocked, name: str, now: clock.Time) -> bool:
        return member.tick(name, now) | self._wire(member, name, now)

    def _wire(self, member: Clocked, name: str, now: clock.Time) -> bool:
        ticked = [self._tick_clock(self.members[to], own, now) for to, own in self.wires.get((member.name, name), ())]
        return any(ticked)

    def _settle(self, now: clock.Time) -> bool:
        """Iterate one instant to a fixed point; return whether anything changed."""
        any_changed = False
        for _ in range(SWEEPS):
            has_changed = False
            for member in self.order:
                self._move(member)
                has_changed = member.evaluate(now) or has_changed
                for name in member.ticked_clocks():
                    has_changed = self._wire(member, name, now) or has_changed
            if not has_changed:
                return any_changed
            any_changed = True
        raise SimulationError(
            f"{', '.join(self.members)}: values and clocks at t = {clock.text(now)} change each other without end, "
            f"{SWEEPS} times. Break the loop."
        )

    def _move(self, member: Clocked) -> None:
        """Move the values of all connections to a member into its inputs."""
        for table, row in self._rows.get(member.name, ()):
            array = self._arrays[table]
            move = loop.copy if table == "copies" else loop.convert
            move(int(array.ctypes.data) + row * array.strides[0], 1, 0)
        for link in self._objects:
            if link.target.member == member.name:
                source, target = link.source, link.target
                source_values = self.members[source.member].slot(source.variable.name).values
                target_values = member.slot(target.variable.name).values
                target_values[target.first : target.first + target.size] = source_values[
                    source.first : source.first + source.size
                ]
