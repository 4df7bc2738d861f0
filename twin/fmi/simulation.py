"""One FMU alone: inputs from a table, outputs into a table.

At each communication point: set the inputs of `t`, step to `t + h`, record the outputs. Time is k * h,
exactly, so nothing accumulates.
"""

from __future__ import annotations

import fnmatch
import math
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.errors import CouplingError, FMUError, SimulationError, nearest
from twin.fmi.importing import binary
from twin.fmi.sampling import Feeder, Sampler
from twin.process import LogLines

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling import MemberVariable
    from twin.fmi.csv_tables import Inputs, Results
    from twin.fmi.importing.fmu_member import FMUMember
    from twin.process import SupervisorChannel

POINTS = 500  # steps where the FMU suggests no step size
FLAGS = 5  # words that fmi3DoStep writes: event, terminate, early return, last successful time, spare


@dataclass(frozen=True, slots=True)
class SimulationPlan:
    """When to step and what to record; times in ns. `every`: steps between two recorded rows."""

    start: clock.Time
    stop: clock.Time
    step: clock.Time
    every: int
    record: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def steps(self) -> int:
        """Number of steps; the last one may be shorter."""
        return -(-(self.stop - self.start) // self.step)


@dataclass
class Outcome:
    """Results, remarks for the user, and the error message (or "")."""

    results: Results
    notes: list[str] = field(default_factory=list)
    failure: str = ""
    interrupted: bool = False


def plan(
    member: FMUMember,
    *,
    start: float | str | None = None,
    stop: float | str | None = None,
    step: float | str | None = None,
    interval: float | str | None = None,
    record: tuple[str, ...] = (),
) -> SimulationPlan:
    """Times from the arguments, else from the FMU's DefaultExperiment, else (stop - start) / 500; times in s."""
    suggested, name = member.default_experiment, member.identity["file"]
    notes: list[str] = []
    begin = exact(start, suggested.start, 0, f"{name}: start time")
    end = exact(stop, suggested.stop, begin + clock.NANOSECONDS, f"{name}: stop time")
    if end <= begin:
        raise FMUError(f"{name}: stops at {clock.text(end)}, not after its start {clock.text(begin)}. Use --stop-time.")
    spacing = exact(interval, None, 0, f"{name}: output interval")
    default = member.period_ns or spacing or decimal_step(end - begin)
    own = None if member.period_ns else suggested.step_size or member.fixed_step
    size = exact(step, own, default, f"{name}: step size")
    if size <= 0:
        raise FMUError(f"{name}: step size {clock.text(size)} is not positive. Use --step-size.")
    if interval is not None and spacing <= 0:
        raise FMUError(f"{name}: output interval {clock.text(spacing)} is not positive. Use --output-interval.")
    if spacing % size and step is None and not member.period_ns:
        size = dividing_step(spacing, size)
        notes.append(f"step size {clock.text(size)}, of which the output interval is a multiple")
    check_step(member, begin, end, size)
    spacing = spacing or size
    if spacing % size:
        raise FMUError(
            f"{name}: output interval {clock.text(spacing)} is not a multiple of the step {clock.text(size)}. "
            f"Use --step-size {clock.seconds(dividing_step(spacing, size))} or another interval."
        )
    clock.to_ticks(begin, size, end)
    return SimulationPlan(begin, end, size, spacing // size, choose(member, record, notes), tuple(notes))


def exact(given: float | str | None, suggested: float | None, default: clock.Time, what: str) -> clock.Time:
    """A time [ns]: the user's, or else the FMU's, if it is valid."""
    if given is not None:
        return clock.nanoseconds(given, what)
    if suggested is None or not math.isfinite(suggested):
        return default
    try:
        return clock.nanoseconds(suggested, what)
    except CouplingError:
        return default


def decimal_step(duration: clock.Time) -> int:
    """The largest 1, 2 or 5 times a power of ten [ns] that makes at least 500 steps."""
    wanted = max(int(duration // POINTS), 1)
    power: int = 10 ** (len(str(wanted)) - 1)
    return max(factor * power for factor in (1, 2, 5) if factor * power <= wanted)


def dividing_step(interval: clock.Time, longest: clock.Time) -> clock.Time:
    """The longest step [ns] that divides an interval and is not above `longest`; of whole nanoseconds if that is."""
    count = int(-(-interval // longest))
    while isinstance(interval, int) and interval % count:
        count += 1
    return clock.to_time(Fraction(interval) / count)


def check_step(member: FMUMember, begin: clock.Time, end: clock.Time, step: clock.Time) -> None:
    """Refuse steps that a fixed-step FMU does not support."""
    if member.capabilities["canHandleVariableCommunicationStepSize"]:
        return
    name, period = member.identity["file"], member.period_ns
    if member.fixed_step is not None and step % period:
        low, high = step // period * period or period, -(-step // period) * period
        advice = clock.text(low) if low == high else f"{clock.text(low)} or {clock.text(high)}"
        raise FMUError(
            f"{name}: steps of {clock.text(step)} are no multiple of its {clock.text(period)}. Use {advice}."
        )
    if (end - begin) % step:
        last = begin + (end - begin) // step * step
        advice = f"{clock.text(last)} or {clock.text(last + step)}"
        raise FMUError(
            f"{name}: cannot shorten its last step of {clock.text(step)} to stop at {clock.text(end)}. "
            f"Use --stop-time {advice}."
        )


def choose(member: FMUMember, wanted: tuple[str, ...], notes: list[str]) -> tuple[str, ...]:
    """Names to record: those requested (`*` and `?` match any text), else the outputs, else the local variables."""
    if not wanted:
        for causality in ("output", "local"):
            matches = [
                each.name for each in member.variables.values() if each.causality == causality and can_record(each)
            ]
            if matches:
                if causality == "local":
                    notes.append("has no outputs: its local variables are recorded")
                return tuple(matches)
        notes.append("has no outputs and no local variables: only time is recorded; --record names more")
        return ()
    where = member.identity["file"]
    names: dict[str, None] = {}
    for pattern in wanted:
        matched = (
            [pattern]
            if pattern in member.variables
            else fnmatch.filter(
                [name for name, each in member.variables.items() if can_record(each)], pattern.replace("[", "[[]")
            )
        )
        if not matched:
            raise FMUError(
                f"{where}: has no variable {pattern!r} to record. {nearest(pattern, list(member.variables))}"
            )
        names.update(dict.fromkeys(matched))
    return tuple(names)


def can_record(variable: MemberVariable) -> bool:
    """Whether a variable has a value to record: all but clocks that are not connectable."""
    return variable.type != "Clock" or variable.connectable


def simulate(
    member: FMUMember,
    plan: SimulationPlan,
    inputs: Inputs | None = None,
    *,
    progress: Callable[[float], None] | None = None,
    link: SupervisorChannel | None = None,
) -> Outcome:
    """Run a member that is not instantiated yet; after a failure the results until then are returned. Closes it.

    `link`: to the process that watches this one, which gives what was recorded to `left` if this one dies.
    """
    sampler: Sampler | None = None
    note = link.note if link else silent
    member.log = LogLines(member.log, partial(link.log, member.name)) if link else member.log
    try:
        note(f"{member.name}: instantiation")
        clocks = load_simulate_clocks(member)
        member.instantiate()
        sampler = Sampler(member, plan.record, plan.steps // plan.every + 3, link.temporary if link else "")
        note(f"{member.name}: initialization")
        outcome = Outcome(sampler.results(), [*member.notes, *plan.notes])
        table = inputs.on_steps(plan.start, plan.step, plan.steps) if inputs else None
        feed = (member.follow(table) or Feeder(member, table)) if table else None
        begin = clock.seconds(plan.start)
        member.enter_initialization(begin, clock.seconds(plan.stop))
        if feed:
            feed(begin)
        member.exit_initialization()
        steps = (clocks.Alone if clocks else Stepping)(member, plan, feed)
        sampler(plan.start)
        if link:
            link.keep(resume=True)
        note(f"{member.name}: {member.step_name}")
        steps.run(sampler, outcome, progress, link.beat if link else silent)
    except SimulationError as error:
        if sampler is None or not sampler.times:
            raise
        outcome.failure = str(error)
    except KeyboardInterrupt:
        if sampler is None or not sampler.times:
            raise
        outcome.interrupted = True
    finally:
        note(f"{member.name}: termination")
        member.close()
        note("")
    outcome.results = sampler.results()
    return outcome


def load_simulate_clocks(member: FMUMember) -> Any:
    """What runs a member with clocks, None if it has none."""
    if not member.clocked:
        return None
    from twin.fmi.clocks import simulate_clocks

    simulate_clocks.may_end_steps(member)
    return simulate_clocks


def silent(*_: object) -> None:
    """No-op callback."""


def left(member: FMUMember, plan: SimulationPlan, link: SupervisorChannel) -> Outcome:
    """What a process recorded that died, and how it died."""
    assert link.crash_report is not None
    sampler = Sampler(member, plan.record, plan.steps // plan.every + 3, link.temporary, again=True)
    crash = link.crash_report
    crash.member, _, crash.function = crash.note.partition(": ")
    crash.at, crash.time_ns = 1, clock.nanoseconds(float(sampler.last[1]))
    return Outcome(sampler.results(), [*member.notes, *plan.notes], crash.text(), crash.from_outside)


class Stepping:
    """Steps of an initialized FMU from start to stop, and their rows. `ending`: how the FMU ended the simulation, or empty."""

    def __init__(self, member: FMUMember, plan: SimulationPlan, feed: Callable[[float], None] | None) -> None:
        self.member, self.plan, self.feed = member, plan, feed
        self.now, self.ending = plan.start, ""
        self._flags = np.zeros(FLAGS, np.int64)
        self._address = self._flags.ctypes.data
        self._do_step = machine.stepper(member.step_function, member.step_signature)

    def run(
        self,
        sampler: Sampler,
        outcome: Outcome,
        progress: Callable[[float], None] | None = None,
        beat: Callable[[], None] = silent,
    ) -> None:
        """Step from start to stop, or to where the FMU ends the simulation."""
        plan = self.plan
        for k in range(plan.steps):
            end = min(plan.start + (k + 1) * plan.step, plan.stop)
            is_row = (k + 1) % plan.every == 0 or end == plan.stop
            while self.now < end and not self.ending:
                beat()
                sampler.last[1] = clock.seconds(self.now)
                self.step(end, is_row)
            if (is_row or self.ending) and self.now > sampler.times[-1]:
                sampler(self.now)
            if self.ending:
                outcome.notes.append(f"ended the simulation {self.ending}")
                return
            if progress and k % 64 == 0:
                progress(k / plan.steps)

    def step(self, end: clock.Time, is_row: bool) -> None:  # noqa: ARG002 - whether a row follows matters to events
        """Step to `end` [ns]."""
        member, begin = self.member, self.now
        t, h = clock.seconds(begin), clock.seconds(end - begin)
        if self.feed:
            self.feed(t)
        status = self._do_step(member.instance, t, h, True, self._address)
        terminate, early, reached = (self._address + 8 * i for i in range(1, 4))
        self.now = end
        if machine.read8(terminate) or status > binary.WARNING:
            reason = "its terminate flag is set" if machine.read8(terminate) else member.finish_reason()
            if not reason:
                member.check(status, "doStep")
            self.ending = f"in the step from {clock.text(begin)}: {reason}"
            last = member.last_successful_time(machine.read_float(reached))
            stopped = end + 1 if last is None else round(last * clock.NANOSECONDS)
            self.now = stopped if stopped <= end else self.plan.start  # at an unknown time there is no row
        elif machine.read8(early):
            raise SimulationError(
                f"{member.name}: returned early at {machine.read_float(reached)} s, though not allowed to."
            )
