"""Messages for steps that did not succeed: failed or discarded steps, early termination, values that are not finite."""

from __future__ import annotations

import time as wall
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.compiler import machine
from twin.coupling.algorithms import Algorithm
from twin.coupling.execution import loop
from twin.coupling.execution.plan import LoopPlan
from twin.coupling.execution.value_memory import view
from twin.coupling.variable_step.record_layout import ASKING, DOUBLING, EARLY, UNSOLVED
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.coupling.execution.finite_value_monitor import FiniteValueMonitor
    from twin.coupling.execution.loop_tables import Tables
    from twin.coupling.execution.recorder import Recorder
    from twin.coupling.member import Member
    from twin.coupling.overrides import Overrides
    from twin.coupling.variable_step.state import VariableStepState

LOG_LINES = 5
SHOWN = 3  # largest number of variables in a message

STATUS = {2: "DISCARD", 3: "ERROR", 4: "FATAL"}
DISCARD = 2
ROUNDING = 1e-12  # tolerance of the end of a step, relative to its length


def log_text(member: Member) -> str:
    """Return the last log lines of a member, for a message."""
    return f" Last log: {' | '.join(member.log[-LOG_LINES:])}" if member.log else ""


def time_text(time: float) -> str:
    """Format a time [s] for a message."""
    return clock.text(round(time * clock.NANOSECONDS))


class StepFailures:
    """Mixin of `CoSimulation`: handles and describes steps that did not succeed."""

    members: Mapping[str, Member]
    algorithm: Algorithm
    plan: LoopPlan
    watch: FiniteValueMonitor
    recorder: Recorder
    state: Any
    step: clock.Time
    finished: bool
    failure: str
    notes: list[str]
    _begin: clock.Time
    _last: int | None
    _last_check: float
    _loop: Callable[[int], int]
    _record: np.ndarray[Any, Any]
    _limits: np.ndarray[Any, Any]
    _slow: list[str]
    _tables: Tables
    _overrides: Overrides
    _variable_step: VariableStepState | None

    @property
    def time(self) -> clock.Time:
        """Communication point reached [ns]."""
        raise NotImplementedError

    def _member_name(self) -> str:
        return list(self.members)[int(self.state["member"])]

    def _report_limit(self) -> None:
        """Handle a violated limit: raise SimulationError if a value is not finite; note an input's bounds once."""
        row = (int(self.state["beyond"]) - self._limits.ctypes.data) // self._limits.strides[0]
        self._check_finite(noticed=True)
        if (key := self.watch.row(row)) is not None:
            self.notes.append(self.watch.input_note(key, self.plan, self.time - self.step))
        self._limits[row, 2] = 0

    def _check_finite(self, noticed: bool = False, failed: str = "") -> None:
        """Raise SimulationError with its origin if a value is not finite; else save the valid state."""
        bad = self.watch.non_finite_members(failed)
        tick = int(self.state["tick"]) + bool(failed)
        if not bad:
            if not noticed and not failed:
                self.watch.save(self._record, self.plan)
                self._last_check = wall.perf_counter()
            return
        if self.watch.replays:
            tick = self.watch.find_first_tick(tick, self._loop, self.plan)
            repeated = self.watch.non_finite_members()
            if failed and not repeated:
                return  # only an iteration that was rolled back was not finite
            self._last, bad = tick, repeated or bad
        time = self._begin + tick * self.step
        exact = self.watch.replays or noticed or failed
        when = f"at t = {clock.text(time)}" + ("" if exact else " or somewhat before")
        self._raise_if_not_finite(bad, when, time=time if exact else 0)

    def _raise_if_not_finite(
        self, bad: list[str], when: str, sure: bool = False, cause: Exception | None = None, time: clock.Time = 0
    ) -> None:
        """Raise SimulationError if members have values that are not finite; `sure`: only if the origin is among them."""
        if bad and (not sure or self.watch.find_source(bad)[1]):
            raise SimulationError(self.watch.described(bad, when, time)) from cause

    def _handle_failure(self) -> None:
        """Raise SimulationError with name, time, status, last inputs and log of a failed member, unless it can continue."""
        if int(self.state["status"]) == ASKING:
            self._roll_back()
            self._variable_step.derive()  # type: ignore[union-attr]
            return
        if int(self.state["status"]) == UNSOLVED:
            raise SimulationError(self._disagreement_text())
        if self.plan.events is not None and self.plan.events.failure is not None:
            raise self.plan.events.failure
        name = self._member_name()
        member = self.members[name]
        if isinstance(member.failure, KeyboardInterrupt):
            raise member.failure
        if loss := member.lost(self.time):
            raise SimulationError(loss)
        reason = member.finish_reason() if int(self.state["status"]) == DISCARD else ""
        if int(self.state["status"]) in (DISCARD, EARLY) and self._accept_shorter_step(member, reason):
            return
        if reason:
            self._finish_discarded(member, reason)
            return
        status = STATUS.get(int(self.state["status"]), "ERROR")
        member.failed(int(self.state["status"]))
        if status != "FATAL":
            self._check_finite(failed=name)
        inputs = ", ".join(
            f"{v}={np.array2string(view(address, self.members[m].variables[v]), threshold=6, precision=6)}"
            for (m, v), address in self.plan.staged.items()
            if m == name
        )
        raise SimulationError(
            f"{name}: failed with {status} in the step from t = {clock.text(self.time)}.{self._refused_access()} "
            f"Last inputs: {inputs or 'none'}.{log_text(member)}"
        ) from member.failure

    def _refused_access(self) -> str:
        """Describe the refused access, if a getter or setter failed rather than a step."""
        rows = self._tables.arrays["accesses"]
        index, rest = divmod(int(self.state["at"]) - rows.ctypes.data, rows.strides[0])
        if rest or not 0 <= index < len(self.plan.accesses):
            return ""
        function, instance, references, *_ = self.plan.accesses[index]
        names = self.plan.access_names.get((function, instance, references), ())
        if not names:
            return ""
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        return f" It refused {self.plan.functions[function]} of {', '.join(names[:SHOWN])}{more}."

    def _accept_shorter_step(self, member: Member, reason: str) -> bool:
        """Repeat an incomplete step up to the time the member reached, or shorter; return whether that is possible."""
        state = self.state
        goes_back = state["trial"] and member.name not in self._slow
        step_begin = float(state["step_begin"]) if goes_back else clock.seconds(self.time)
        end_time = float(state["until"])
        if int(state["status"]) == DISCARD:
            last_time = member.last_successful_time(self._reported_time(step_begin))
            end_time = step_begin if last_time is None else last_time
        if not goes_back:
            if reason or (int(state["status"]) == DISCARD and end_time == step_begin):
                return False
            alternatives = ", ".join(candidate.name for candidate in Algorithm if candidate.rolls_back)
            why = f"{self.algorithm} makes whole steps. Use one that goes to that time: {alternatives}."
            if state["trial"]:
                why = "its period is to be made in whole. Leave `communication_step` out."
            raise SimulationError(
                f"{member.name}: went to t = {time_text(end_time)} only in the step from t = {time_text(step_begin)}, and {why}{log_text(member)}"
            )
        if step_begin < end_time < step_begin + float(state["span"]) * (1 - ROUNDING):
            state["until"], state["limited"], state["must_restore"] = end_time, 1, 1
            return True
        if state["control"] and state["stride"] > 1 and not reason:
            state["stride"] //= 2
            state["rejected"] += 1
            state["limited"], state["must_restore"] = 0, 1
            return True
        return False

    def _roll_back(self) -> None:
        """Roll all members back to the begin of the step in progress."""
        state, stop = self.state, int(self.state["stop"])
        state["must_restore"], state["stop"] = 1, state["tick"]
        if self._loop(self._record.ctypes.data) == loop.FAILED:
            self._handle_failure()
        state["stop"] = stop

    def _disagreement_text(self) -> str:
        """Describe the connections that did not converge."""
        assert self._variable_step is not None
        inputs = self._variable_step.disagreements()
        return (
            f"{self.algorithm}: {', '.join(inputs[:3])}{' and others' if len(inputs) > 3 else ''} do not agree after "
            f"{self.algorithm.iterations} iterations in the step from t = {time_text(float(self.state['step_begin']))}. "
            f"Allow more `iterations`, take another `acceleration` or a smaller step."
        )

    def _reported_time(self, step_begin: float) -> float:
        """Return the last successful time [s] that the terminating member's step from `step_begin` wrote (FMI 3.0)."""
        rows = [row for row in self._tables.arrays["steps"].tolist() if row[-1] == int(self.state["member"])]
        column = loop.STEP.index("flags")
        return max([step_begin, *(machine.read_float(row[column] + 24) for row in rows)])

    def _end_time_text(self) -> str:
        """Format the time at which the simulation ended; invalidates a later row."""
        state = self.state
        if not state["in_tick"]:
            step_begin, step = clock.seconds(self.time - self.step), clock.seconds(self.step)
            end_time = self._reported_time(step_begin)
            if step_begin < end_time < step_begin + step * (1 - ROUNDING):
                self._last = int(state["tick"]) - 1
                return time_text(end_time)
            return clock.text(self.time)
        return time_text(float(state["now"] if state["off"] else state["step_begin"] + state["span"]))

    def _note_step_problems(self) -> None:
        """Add notes on steps that missed tolerance, convergence or the smallest length."""
        if self._variable_step is None:
            return
        state = self.state
        # With inputs held, the error is the change of a value in a step: 1e-5 needs some 4e5 steps for a cycle of a sine.
        remedy = "Give a smaller one" if state["order"] else "Set `order: 1`, or give a smaller one"
        for count, first, problem in (
            ("missed", "missed_tick", f"steps of the smallest size were not as exact as asked for. {remedy}"),
            (
                "unsolved",
                "unsolved_tick",
                "steps did not agree after the last iteration. Allow more, or a smaller step",
            ),
        ):
            if state[count]:
                at = clock.text(self._begin + int(state[first]) * self.step)
                self.notes.append(
                    f"{self.algorithm}: {int(state[count])} {problem}; the first began at t = {at} or soon after."
                )
                state[count] = 0
        if state["refused"]:
            name, least = list(self.members)[int(state["refused"]) - 1], self.step * int(state["least"])
            half = 2 if state["control"] == DOUBLING else 1
            shortest = clock.text(round(least / int(state["divisions"]) / half))
            self.notes.append(f"{self.algorithm}: {name} makes no steps shorter than {shortest}; no step was shorter.")
            state["refused"] = 0

    def _finish_discarded(self, member: Member, reason: str) -> None:
        """End the simulation at a step that a member discarded to terminate; keep the time it reached."""
        self.finished = True
        step_begin = clock.seconds(self.time) if self._variable_step is None else float(self.state["step_begin"])
        end_time = member.last_successful_time(step_begin)
        if (
            self._variable_step is None
            and end_time is not None
            and abs(end_time - clock.seconds(self.time + self.step)) < 1e-9
        ):
            for (owner, name), address in self.plan.published.items():
                if self.members[owner] is member:
                    self._tables.put(owner, name, address)
            self._overrides.hold()
            self.state["tick"] += 1
            if self.state["next_row"] >= self.state["limit"]:
                self.recorder.make_room()
            loop.record(self._record.view(np.recarray)[0])
        end = step_begin + clock.seconds(self.step) * (1 + ROUNDING)
        when = clock.text(self.time) if self._variable_step is None else time_text(step_begin)
        if end_time is not None and step_begin < end_time <= end:
            when = time_text(end_time)
        self.failure = f"{member.name} ended the simulation at {when}: {reason}"
