"""The co-simulation: initialize, advance, terminate. Owns time and memory; the work is done by the compiled loop."""

from __future__ import annotations

import ctypes
import time as wall
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock, compiler
from twin.coupling import initialization, loop
from twin.coupling.isolated import IsolatedMember
from twin.coupling.member import RecordMember
from twin.coupling.overrides import Overrides
from twin.coupling.plan import Key, Plan, view
from twin.coupling.recorder import Layout, Memory, Recorder
from twin.coupling.system import Link, stepping_order
from twin.coupling.tables import Tables
from twin.coupling.watch import Watch
from twin.errors import CouplingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping
    from pathlib import Path

    from twin.coupling.member import Member

CHUNK_SECONDS = 0.05  # wall-clock length of one native call: how fast Ctrl-C and the progress bar react
FIRST_STEPS = 16  # length of the first one
LOG_LINES = 5

STATUS = {2: "DISCARD", 3: "ERROR", 4: "FATAL"}


class Algorithm(StrEnum):
    """How members see each other within one communication step."""

    jacobi = "jacobi"
    gauss_seidel = "gauss_seidel"


@lru_cache(maxsize=4)
def compiled_loop(build: Path) -> Callable[[int], int]:
    """The loop as a native function of its record's address."""
    address = compiler.load_record_function(loop.RECORD, "cosimulation", loop.run, "The co-simulation loop.", build)
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(address)


@dataclass
class Recording:
    """What was recorded: time [s], and per variable an array of rows (and elements)."""

    time: np.ndarray[Any, Any]
    signals: dict[str, np.ndarray[Any, Any]]


class CoSimulation:
    """Members coupled by links, from `initialize` over `advance` to `terminate`.

    `step`: communication step [ns]. A member's period must be a multiple of it: never a rounding. `record`: variables
    to record every `every` [ns] as (member, variable). `split`: variables of which elements will be overridden.
    `recorder`: where the rows go, by default into memory. `exempt`: members that may compute what is not finite.
    """

    def __init__(
        self,
        members: Mapping[str, Member],
        links: list[Link],
        step: int,
        algorithm: Algorithm = Algorithm.jacobi,
        *,
        record: list[Key] | None = None,
        every: int = 0,
        build: Path,
        periods: Mapping[str, int] | None = None,
        split: Iterable[Key] = (),
        recorder: Recorder | None = None,
        exempt: Collection[str] = (),
    ) -> None:
        self.members, self.links, self.step, self.algorithm = members, links, step, algorithm
        self.periods = {name: (periods or {}).get(name) or m.period_ns or step for name, m in members.items()}
        self.every = every or step
        self._check_periods()
        outputs = [
            (name, v.name)
            for name, m in members.items()
            for v in m.variables.values()
            if v.causality == "output" and v.connectable
        ]
        self.recorded = outputs if record is None else record
        self._loop = compiled_loop(build)
        self._isolated = [member for member in members.values() if isinstance(member, IsolatedMember)]
        self._ready = False  # whether the tables are filled
        self.failure: str = ""
        self.finished = False
        self.recorder: Recorder = recorder or Memory()
        self.watch = Watch(members, links, exempt)
        self.notes: list[str] = []
        self._last: int | None = None  # tick of the last row that is wanted
        self._looked = 0.0  # wall-clock time of the last look at all members [s]
        self._split = frozenset(split)
        self._begin = 0

    def _check_periods(self) -> None:
        problems = []
        for name, period in {**self.periods, "record": self.every}.items():
            if period % self.step:
                low = period // self.step * self.step
                choice = (
                    clock.text(low + self.step) if low == 0 else f"{clock.text(low)} or {clock.text(low + self.step)}"
                )
                problems.append(
                    f"{name}: period {clock.text(period)} is not a multiple of {clock.text(self.step)}. Use {choice}, "
                    f"or a communication step of {clock.text(clock.common_step([period, self.step]))}."
                )
        if problems:
            raise CouplingError(problems)

    def order(self) -> list[list[str]]:
        """The stages: all members at once, or one by one along their dependencies."""
        if self.algorithm is Algorithm.jacobi:
            return [list(self.members)]
        catalog = {name: member.variables for name, member in self.members.items()}
        return [[name] for name in stepping_order(list(self.members), self.links, catalog)]

    def delays(self) -> list[tuple[Link, int]]:
        """How late each connection's value is when it is used, beyond what the source's own step says [ns]."""
        place = {name: i for i, stage in enumerate(self.order()) for name in stage}
        found = []
        for link in self.links:
            fresh = (
                place[link.source.member] < place[link.target.member] and self.periods[link.source.member] == self.step
            )
            found.append((link, 0 if fresh else self.periods[link.target.member]))
        return found

    def initialize(self, start: int, stop: int | None = None) -> None:
        """Take all members through InitializationMode at `start` [ns] and record the first row."""
        self._begin = start
        for name, member in self.members.items():
            self._guard(name, "instantiation", member.instantiate)
        end = None if stop is None else clock.seconds(stop)
        for name, member in self.members.items():
            self._guard(name, "initialization", partial(member.enter_initialization, clock.seconds(start), end))
        try:
            initialization.solve(self.members, self.links)
        except SimulationError as error:
            self._blame(self.watch.bad(), f"at t = {clock.text(start)}", sure=True, cause=error)
            raise
        for name, member in self.members.items():
            self._guard(name, "initialization", member.exit_initialization)
        self._fill(stop)

    def _guard(self, name: str, phase: str, call: Callable[[], object]) -> None:
        self.recorder.note(f"{name}: {phase}")
        try:
            call()
        except SimulationError:
            raise
        except Exception as error:
            raise SimulationError(f"{name}: {phase} failed: {error}{self._log_text(self.members[name])}") from error

    def _fill(self, stop: int | None) -> None:
        """Build the tables, publish what the members hold, and record the first row."""
        plan = self.plan = Plan(self.members, self.step, self.periods, self._split)
        plan.build(self.order(), self.links, self.recorded, self.watch.published())
        self._tables = Tables(plan, self.members)
        self._tables.publish(self.periods, self.step)
        self._overrides = Overrides(self._tables, self.members)
        self._record = self.recorder.record
        self.state = self._record[0]
        self.state["begin_ns"], self.state["step_ns"] = self._begin, self.step
        self.state["every"] = self.every // self.step
        self._tables.tell(self.state)
        count = None if stop is None else (stop - self._begin) // self.every + 2
        columns = [(key, first, self.members[key[0]].variables[key[1]]) for key, first, _ in plan.columns]
        calls = plan.calls(self._tables.arrays)
        self.recorder.open(Layout(self._begin, self.step, plan.row_words, columns, calls, count))
        self._ready = True
        self.recorder.note("")
        self._limits, self._scalar = self.watch.rows(plan), np.zeros(1)
        self.state["limits"], self.state["limit_count"] = self._limits.ctypes.data, self.watch.row_count
        self.state["scalar"] = self._scalar.ctypes.data
        loop.record(self._record.view(np.recarray)[0])
        self._blame(self.watch.bad(), f"at t = {clock.text(self._begin)}")

    @property
    def last(self) -> int | None:
        """Tick of the last recorded row that counts; None: all do."""
        return self._last

    @property
    def time(self) -> int:
        """Communication point reached [ns]."""
        return self._begin + int(self.state["tick"]) * self.step

    def advance(self, until: int, progress: Callable[[int], object] | None = None) -> None:
        """Go to `until` [ns], a communication point; SimulationError if a member fails, with all that is known.

        Stops early, with `finished` set, when a member ends the simulation.
        """
        if (until - self._begin) % self.step:
            raise CouplingError(f"{clock.text(until)} is no communication point of {clock.text(self.step)}.")
        last = (until - self._begin) // self.step
        chunk = FIRST_STEPS
        if not self.watch.is_saved:
            self.watch.save(self._record, self.plan)
            self._looked = wall.perf_counter()
        while self.state["tick"] < last and not self.finished:
            self.state["stop"] = min(last, int(self.state["tick"]) + chunk)
            begin = wall.perf_counter()
            with IsolatedMember.together(self._isolated if self.state["tick"] >= FIRST_STEPS else []):
                result = self._loop(self._record.ctypes.data)
            took = wall.perf_counter() - begin
            if result == loop.FULL:
                self.recorder.make_room()
            elif result == loop.FINISHED:
                self.finished = True
                self.failure = f"{self._member_name()} ended the simulation at {clock.text(self.time)}"
            elif result == loop.FAILED:
                self._fail()
            elif result == loop.NOTICED:
                self._notice()
            is_over = self.finished or self.state["tick"] == last
            if result in (loop.DONE, loop.FINISHED) and (is_over or begin + took - self._looked > CHUNK_SECONDS):
                self._examine()
            chunk = max(1, min(chunk * 4, int(chunk * CHUNK_SECONDS / max(took, 1e-6))))
            self.state["at"] = 0
            self.recorder.look()
            if progress:
                progress(self.time)

    def _member_name(self) -> str:
        return list(self.members)[int(self.state["member"])]

    def _notice(self) -> None:
        """A value is beyond its limits: not finite, which is the end, or an input, which is noted once."""
        row = (int(self.state["beyond"]) - self._limits.ctypes.data) // self._limits.strides[0]
        self._examine(noticed=True)
        if (key := self.watch.row(row)) is not None:
            self.notes.append(self.watch.input_note(key, self.plan, self.time - self.step))
        self._limits[row, 2] = 0

    def _examine(self, noticed: bool = False, failed: str = "") -> None:
        """End the simulation if a value is not finite, and tell where that began; else remember that all is well."""
        bad = self.watch.bad(failed)
        tick = int(self.state["tick"]) + bool(failed)
        if not bad:
            if not noticed and not failed:
                self.watch.save(self._record, self.plan)
                self._looked = wall.perf_counter()
            return
        if self.watch.replays:
            tick = self._last = self.watch.began(tick, self._loop, self.plan)
            bad = self.watch.bad() or bad
        when = clock.text(self._begin + tick * self.step)
        exact = self.watch.replays or noticed or failed
        self._blame(bad, f"at t = {when}" if exact else f"at t = {when} or somewhat before")

    def _blame(self, bad: list[str], when: str, sure: bool = False, cause: Exception | None = None) -> None:
        """SimulationError if members hold values that are not finite; `sure`: only if one of them began it."""
        if bad and (not sure or self.watch.source(bad)[1]):
            raise SimulationError(self.watch.described(bad, when)) from cause

    def _fail(self) -> None:
        """Turn a member's failure into one line: name, time, status, last inputs, last log lines."""
        name = self._member_name()
        member = self.members[name]
        if isinstance(member, RecordMember) and isinstance(member.failure, KeyboardInterrupt):
            raise member.failure
        if death := member.lost(self.time):
            raise SimulationError(death)
        reason = member.finish_reason() if int(self.state["status"]) == 2 else ""
        if reason:
            self._finish(member, reason)
            return
        status = STATUS.get(int(self.state["status"]), "ERROR")
        member.failed(int(self.state["status"]))
        if status != "FATAL":
            self._examine(failed=name)
        inputs = ", ".join(
            f"{v}={np.array2string(view(address, self.members[m].variables[v]), threshold=6, precision=6)}"
            for (m, v), address in self.plan.staged.items()
            if m == name
        )
        raise SimulationError(
            f"{name}: failed with {status} in the step from t = {clock.text(self.time)}. "
            f"Last inputs: {inputs or 'none'}.{self._log_text(member)}"
        ) from (member.failure if isinstance(member, RecordMember) else None)

    def _finish(self, member: Member, reason: str) -> None:
        """A member discarded its step in order to end the simulation: keep how far it came."""
        self.finished = True
        came = member.last_successful_time(clock.seconds(self.time))
        if came is not None and abs(came - clock.seconds(self.time + self.step)) < 1e-9:
            for (owner, name), address in self.plan.published.items():
                if self.members[owner] is member:
                    self._tables.put(owner, name, address)
            self._overrides.hold()
            self.state["tick"] += 1
            if self.state["place"] >= self.state["limit"]:
                self.recorder.make_room()
            loop.record(self._record.view(np.recarray)[0])
        self.failure = f"{member.name} ended the simulation at {clock.text(self.time)}: {reason}"

    @staticmethod
    def _log_text(member: Member) -> str:
        return f" Last log: {' | '.join(member.log[-LOG_LINES:])}" if member.log else ""

    def value(self, key: Key) -> np.ndarray[Any, Any]:
        """A variable at the communication point that was reached, as others see it: a slow member is not ahead of it."""
        variable = self.members[key[0]].variables[key[1]]
        if key in self.plan.published:
            return view(self.plan.published[key], variable).copy().reshape(variable.shape)
        return np.asarray(self.members[key[0]].get(key[1]))

    def set(self, key: Key, value: Any) -> None:
        """Set a parameter or an unconnected input, or element of one, of a member, from now on."""
        self.watch.forget()
        self.members[key[0]].set(key[1], value)
        if key in self.plan.buffers:
            view(self.plan.buffers[key], self.members[key[0]].variables[key[1]])[:] = np.ravel(value)

    def override(self, key: Key, value: Any, element: int | None = None) -> None:
        """From now on all who read this output, or the member that has this input, see `value` instead.

        `element`: of an output in `split` only this one, counted from 0.
        """
        self.watch.forget()
        if element is not None:
            self._overrides.set_element(key, element, value)
            return
        self._overrides.set(key, value)
        self._tables.merge_records(self.state)

    def release(self, key: Key, element: int | None = None) -> None:
        """End an override."""
        self.watch.forget()
        if element is not None:
            self._overrides.set_element(key, element, None)
            return
        self._overrides.release(key)
        self._tables.merge_records(self.state)

    def recording(self) -> Recording:
        """All that was recorded until now, decoded."""
        if not self._ready:
            return Recording(np.zeros(0), {})
        words = self.recorder.words()
        if self._last is not None:
            words = words[words[:, 0] <= self._last]
        time = (self._begin + words[:, 0] * self.step) / clock.NANOSECONDS
        signals = {}
        for (member, name), first, size in self.plan.columns:
            variable = self.members[member].variables[name]
            block = np.ascontiguousarray(words[:, first : first + size])
            if variable.dtype.kind == "f":
                values = block.view(np.float64)
            elif variable.type == "Boolean":
                values = block != 0
            else:
                values = block.view(np.uint64) if variable.dtype.kind == "u" else block
            signals[f"{member}.{name}"] = values.reshape(len(words), *variable.shape)
        return Recording(time, signals)

    def terminate(self) -> None:
        """Close all members, whatever state they are in."""
        for name, member in self.members.items():
            self.recorder.note(f"{name}: termination")
            member.close()
        self.recorder.note("")
