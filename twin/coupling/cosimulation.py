"""Co-simulation master: initialize, advance, terminate. Owns time and memory; the compiled loop does the steps."""

from __future__ import annotations

import time as wall
from contextlib import nullcontext
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, compiler
from twin.coupling import events, initialization, model_exchange_groups
from twin.coupling.algorithms import Algorithm
from twin.coupling.conditions import Condition, Conditions
from twin.coupling.event_steps import EventSteps
from twin.coupling.execution import loop
from twin.coupling.execution.finite_value_monitor import FiniteValueMonitor
from twin.coupling.execution.loop_tables import Tables
from twin.coupling.execution.plan import Key, LoopPlan
from twin.coupling.execution.recorder import MemoryRecorder, RecordedSignals, Recorder, RowLayout, decode_rows
from twin.coupling.execution.step_failures import StepFailures, log_text
from twin.coupling.execution.string_binary_links import StringBinaryLinks
from twin.coupling.execution.value_memory import view
from twin.coupling.isolation.isolated_member import IsolatedMember
from twin.coupling.overrides import Overrides
from twin.coupling.system import ResolvedConnection, check_periods
from twin.coupling.threads import step_threads
from twin.coupling.variable_step import stepping
from twin.coupling.variable_step.events import VariableStepEvents
from twin.coupling.variable_step.rollback import StepLogs, check_rollback, unfaithful, verify_rollback
from twin.coupling.variable_step.stage_tables import Stages
from twin.coupling.variable_step.state import VariableStepState
from twin.errors import CouplingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    from twin.coupling.execution.recorder import Columns
    from twin.coupling.member import Member

CHUNK_SECONDS = 0.1  # wall-clock length of one native call [s]: latency of Ctrl-C and of the progress bar
CHECK_SECONDS = 0.5  # wall-clock time between two checks for finite values [s]: most of what is computed in vain
FIRST_STEPS = 4  # communication steps of the first native call


def compiled_loop(build: Path, plain: bool = True) -> Callable[[int], int]:
    """Compile the fixed-step loop, or the variable-step master for algorithms that are not plain.

    Returns a native function of the record's address.
    """
    name, function = ("cosimulation", loop.run) if plain else ("walk", stepping.run)
    return compiler.load_record_function(loop.RECORD, name, function, f"The {name} loop.", build)


class CoSimulation(StepFailures):
    """Co-simulation of members coupled by links: `initialize`, `advance`, `terminate`.

    `step`: communication step [ns]. A member's period must be an exact multiple of it. `record`: variables to record
    every `every` [ns] as (member, variable). `split`: variables of which elements will be overridden. `recorder`:
    destination of the rows, by default memory. `exempt`: members that may compute values that are not finite.
    `threads`: largest number of threads that step members; None: from their measured cost. Results do not depend on it.
    `conditions`: evaluated at each communication point; they act there when they are met.
    """

    def __init__(
        self,
        members: Mapping[str, Member],
        links: list[ResolvedConnection],
        step: clock.Time,
        algorithm: Algorithm | str = Algorithm.jacobi,
        *,
        record: list[Key] | None = None,
        every: clock.Time = 0,
        build: Path,
        periods: Mapping[str, clock.Time] | None = None,
        split: Iterable[Key] = (),
        recorder: Recorder | None = None,
        exempt: Collection[str] = (),
        threads: int | None = 1,
        conditions: Sequence[Condition] = (),
    ) -> None:
        self.members, self.step = members, step
        self.links, self._wires = events.split_links(links)
        links = self.links
        self.algorithm: Algorithm = Algorithm(algorithm)
        self.periods = {name: (periods or {}).get(name) or m.period_ns or step for name, m in members.items()}
        self.every = every or step
        check_periods({**self.periods, "record": self.every}, step)
        self._slow = [name for name, period in self.periods.items() if period != step or members[name].period_ns]
        events.check_supported(members, self._wires, self.algorithm, self.periods, step)
        check_rollback(self.algorithm, members, self._slow)
        self._corrected = self.algorithm.corrected(links)
        model_exchange_groups.join(members, links, self.periods)
        outputs = [
            (name, v.name)
            for name, m in members.items()
            for v in m.variables.values()
            if v.causality == "output" and v.connectable
        ]
        self.recorded = outputs if record is None else record
        self._build, self._loop = build, compiled_loop(build, self.algorithm.is_plain)
        self._variable_step: VariableStepState | None = None
        self._logs: StepLogs | None = None
        self._event_steps: EventSteps | None = None
        self._isolated = [member for member in members.values() if isinstance(member, IsolatedMember)]
        self._thread_limit, self._threads = threads, step_threads.SerialSteps()
        self._ready = False  # whether the tables are filled
        self.failure: str = ""
        self.finished = False
        self.recorder: Recorder = recorder or MemoryRecorder()
        self.watch = FiniteValueMonitor(members, links, exempt)
        self.watch.periods = {name: self.periods[name] for name in self._slow}
        self.notes = self.algorithm.remarks(self._corrected)
        self._last: int | None = None  # tick of the last valid row
        self._last_check = 0.0  # wall-clock time of the last check for finite values [s]
        self._split = frozenset(split)
        self._begin: clock.Time = 0
        self.conditions = Conditions(conditions)

    def order(self) -> list[list[str]]:
        """Return the stages: all members at once, or one by one along their dependencies."""
        return self.algorithm.order_of(self.members, self.links)

    def delays(self) -> list[tuple[ResolvedConnection, clock.Time]]:
        """Return each connection with the age of its value when it is used, beyond the source's own step [ns]."""
        stage_index = {name: i for i, stage in enumerate(self.order()) for name in stage}
        inside = model_exchange_groups.between(self.members, self.links)
        delays = []
        for link in self.links:
            source, target = link.source.member, link.target.member
            # a slow source publishes at its end: of targets in later stages those that step then see it
            periods = self.periods[source], self.periods[target]
            fresh = stage_index[source] < stage_index[target] and self.step in periods
            if not self.algorithm.is_plain:
                fresh = (fresh or self.algorithm.iterations > 0) and not {source, target} & set(self._slow)
            at_event = self.members[target].clocked and link.target.variable.variability != "continuous"
            delays.append((link, 0 if link in inside or at_event else self.periods[target] - fresh * self.step))
        return [*delays, *((wire, 0) for wire in self._wires)]

    def initialize(self, start: clock.Time, stop: clock.Time | None = None, *, first_row: bool = True) -> None:
        """Take all members through InitializationMode at `start` [ns] and record the first row, unless it is recorded."""
        self._begin = start
        if self.algorithm.rolls_back:
            # Isolated members log asynchronously, so their lines cannot be assigned to steps.
            self._logs = StepLogs(member for member in self.members.values() if member not in self._isolated)
            for name, member in self.members.items():
                member.early = member.early or name not in self._slow
        for name, member in self.members.items():
            self._guard(name, "instantiation", member.instantiate)
        for name, member in self.members.items():
            end = initialization.end_of_last_step(start, stop, self.periods[name])
            self._guard(name, "initialization", partial(member.enter_initialization, clock.seconds(start), end))
        try:
            initialization.solve_initialization(self.members, self.links)
        except SimulationError as error:
            self._raise_if_not_finite(
                self.watch.non_finite_members(), f"at t = {clock.text(start)}", sure=True, cause=error
            )
            raise
        for name, member in self.members.items():
            self._guard(name, "initialization", member.exit_initialization)
        self._build_tables(stop, first_row)

    def with_members(self, members: Mapping[str, Member]) -> CoSimulation:
        """Return the same coupling of other, initialized members from the time reached; their state changes with its steps."""
        other = self.renewed(members=members, record=[], every=0, split=(), conditions=())
        other._begin, other._logs = self.time, self._logs
        other._build_tables(None)
        return other

    def renewed(self, **changes: Any) -> CoSimulation:
        """Return the same coupling before initialization, with changed arguments of `CoSimulation`."""
        arguments: dict[str, Any] = {
            "members": self.members,
            "links": [*self.links, *self._wires],
            "step": self.step,
            "algorithm": self.algorithm,
            "record": self.recorded,
            "every": self.every,
            "build": self._build,
            "periods": self.periods,
            "split": self._split,
            "threads": self._thread_limit,
            "conditions": self.conditions.conditions,
        }
        return CoSimulation(**arguments | changes)

    def _guard(self, name: str, phase: str, call: Callable[[], object]) -> None:
        self.recorder.note(f"{name}: {phase}")
        try:
            call()
        except SimulationError:
            raise
        except Exception as error:
            raise SimulationError(f"{name}: {phase} failed: {error}{log_text(self.members[name])}") from error

    def _build_tables(self, stop: clock.Time | None, first_row: bool = True) -> None:
        """Build the tables, publish the members' values, and record the first row if required."""
        parts = self.members, self.step, self.periods, self._split
        plan = self.plan = LoopPlan(*parts) if self.algorithm.is_plain else Stages(*parts, algorithm=self.algorithm)
        plan.objects = StringBinaryLinks(self.members, self.links)
        if any(member.clocked for member in self.members.values()):
            plan.events = events.Events(self.members, self.links, self._wires)
        plan.build(
            step_threads.stages(self.order(), self.links, self.members, self._thread_limit),
            plan.objects.numbers,
            self.recorded,
            [*self.watch.published(), *self.conditions.keys()],
        )
        self.conditions.add_rows(plan)
        self._tables = Tables(plan, self.members)
        self._tables.publish()
        if plan.events is not None:
            self._begin_events(plan.events)
        self._overrides = Overrides(self._tables, self.members)
        self._record = self.recorder.record
        self.state = self._record[0]
        self.state["begin_ns"], self.state["step_ns"], self.state["per_second"] = counted = clock.to_ticks(
            self._begin, self.step, stop
        )
        self.state["every"] = self.every // self.step
        self._tables.write_addresses(self.state)
        if isinstance(plan, Stages):
            self._verify_rollback()
            self._variable_step = VariableStepState(plan, self._tables, self.state, self.step, self._corrected)
            if self._logs is not None:
                self._logs.connect(self.state)
        count = None if stop is None else (stop - self._begin) // self.every + 2
        self._threads = step_threads.start(
            plan, self._tables, self.members, self._record, self._thread_limit, self._build
        )
        calls = plan.calls(self._tables.arrays) | self._threads.calls
        self.recorder.open(RowLayout(*counted, plan.row_words, self._columns(), calls, count))
        self._ready = True
        self.recorder.note("")
        self._limits, self._scalar = self.watch.rows(plan), np.zeros(1)
        self.state["limits"], self.state["limit_count"] = self._limits.ctypes.data, self.watch.row_count
        self.state["scalar"] = self._scalar.ctypes.data
        self.conditions.connect(self._tables, self.state, self._begin, self.step, stop)
        if first_row:
            loop.record(self._record.view(np.recarray)[0])
        self._raise_if_not_finite(self.watch.non_finite_members(), f"at t = {clock.text(self._begin)}")
        if first_row:
            self.conditions.start(self, self._record, self._build)

    def _begin_events(self, clock_events: events.Events) -> None:
        """Process the event in which members with clocks are after initialization."""
        clock_events.connect(self.plan, self._tables.arrays)
        record = self.recorder.record[0]
        if isinstance(self.plan, Stages):
            VariableStepEvents(clock_events, self.plan, record, self._begin, self.step)
        else:
            self._event_steps = EventSteps(clock_events, self.members, self.periods, record, self._begin, self.step)
        clock_events.react(self._begin)
        self._tables.publish()

    def _verify_rollback(self) -> None:
        """Verify by trial that members support rollback, except our own."""
        if not self.algorithm.rolls_back:
            return
        for name, member in self.members.items():
            if name in self._slow or member.has_cheap_fmu_state:
                continue
            assert self._logs is not None
            with self._logs.discarding():
                problem = verify_rollback(member, clock.seconds(self._begin), clock.seconds(self.step))
            if problem:
                raise CouplingError(unfaithful(name, problem, self.algorithm))

    @property
    def last(self) -> int | None:
        """Tick of the last valid recorded row; None: all rows are valid."""
        return self._last

    @property
    def time(self) -> clock.Time:
        """Communication point reached [ns]."""
        return self._begin + int(self.state["tick"]) * self.step

    def advance(self, until: clock.Time, progress: Callable[[clock.Time], object] | None = None) -> None:
        """Advance to `until` [ns], a communication point; SimulationError if a member fails.

        Stops early, with `finished` set, when a member ends the simulation.
        """
        if (until - self._begin) % self.step:
            raise CouplingError(f"{clock.text(until)} is no communication point. Give n times {clock.text(self.step)}.")
        last = (until - self._begin) // self.step
        chunk = 1 if self._threads.is_measuring else FIRST_STEPS
        run = partial(self._loop, self._record.ctypes.data)
        while self.state["tick"] < last and not self.finished:
            if not self.watch.is_saved:
                self.watch.save(self._record, self.plan)
                self._last_check = wall.perf_counter()
            self.state["stop"] = min(last, int(self.state["tick"]) + chunk)
            begin = wall.perf_counter()
            is_past_first_steps = self.state["tick"] >= FIRST_STEPS
            if self._threads.is_measuring:
                self._threads.decide()
            with (
                IsolatedMember.together(
                    self._isolated if is_past_first_steps and not self._threads.overlaps_isolated else []
                ),
                self._logs.stepping() if self._logs is not None else nullcontext(),
            ):
                result = run() if self._event_steps is None else self._event_steps.go(run)
            took = wall.perf_counter() - begin
            if self.plan.events is not None and (name := self.plan.events.ended):
                self.finished = True
                when = clock.text(self.plan.events.now)
                self.failure = f"{name} ended the simulation at {when}: it wished so at an event"
            if result == loop.FULL:
                self.recorder.make_room()
            elif result == loop.FINISHED:
                self.finished = True
                self.failure = f"{self._member_name()} ended the simulation at {self._end_time_text()}"
            elif result == loop.FAILED:
                self._handle_failure()
            elif result == loop.NOTICED:
                self._report_limit()
            is_over = self.finished or self.state["tick"] == last or result == loop.TRIGGERED
            if result in (loop.DONE, loop.FINISHED, loop.TRIGGERED) and (
                is_over or begin + took - self._last_check > CHECK_SECONDS
            ):
                self._check_finite()
            if result in (loop.TRIGGERED, loop.NOTICED):
                self.conditions.act(self)
            else:
                chunk = max(1, min(chunk * 4, int(chunk * CHUNK_SECONDS / max(took, 1e-6))))
            self.state["at"] = 0
            self.recorder.look()
            if progress:
                progress(self.time)

    def value(self, key: Key) -> np.ndarray[Any, Any]:
        """Return what readers get at the communication point reached: never ahead of it, also for slow members."""
        variable = self.members[key[0]].variables[key[1]]
        if address := self._overrides.active.get(key) or self.plan.published.get(key) or self.plan.staged.get(key):
            return view(address, variable).copy().reshape(variable.shape)
        return np.asarray(self.members[key[0]].get(key[1]))

    def set(self, key: Key, value: Any) -> None:
        """Set a parameter or an unconnected input of a member from now on."""
        self._forget()
        self.members[key[0]].set(key[1], value)
        if self.plan.events is not None and self.members[key[0]].clocked:
            self.plan.events.interfere(self.time)
        if key in self.plan.buffers:
            view(self.plan.buffers[key], self.members[key[0]].variables[key[1]])[:] = np.ravel(value)

    def _forget(self) -> None:
        self.watch.forget()
        if self._variable_step is not None:
            self._variable_step.forget()

    def override(self, key: Key, value: Any, element: int | None = None) -> None:
        """Replace an output for all its readers, or an input for its member, by `value` from now on; None: no longer.

        `element`: only this element of an output in `split`, counted from 0.
        """
        self._forget()
        self.members[key[0]].override(key[1], value, element)
        if element is not None:
            self._overrides.set_element(key, element, value)
            return
        if value is None:
            self._overrides.release(key)
        else:
            self._overrides.set(key, value)
        self._tables.merge_records(self.state)

    @property
    def overridden(self) -> tuple[Key, ...]:
        """Variables whose readers get another value."""
        return tuple(self._overrides.active)

    def release(self, key: Key, element: int | None = None) -> None:
        """End an override."""
        self.override(key, None, element)

    def recording(self) -> RecordedSignals:
        """Return the decoded recording until now."""
        if not self._ready:
            return RecordedSignals(np.zeros(0), {})
        words = self.recorder.words()
        if self._last is not None:
            words = words[words[:, 0] <= self._last]
        time = (self.state["begin_ns"] + words[:, 0] * self.state["step_ns"]) / self.state["per_second"]
        return RecordedSignals(time, decode_rows(words, self._columns()))

    def _columns(self) -> Columns:
        """Return the columns of a row."""
        return [(key, first, self.members[key[0]].variables[key[1]]) for key, first, _ in self.plan.columns]

    def terminate(self) -> None:
        """Close all members, in any state."""
        self._note_step_problems()
        self._threads.close()
        for name, member in self.members.items():
            self.recorder.note(f"{name}: termination")
            member.close()
        self.recorder.note("")
