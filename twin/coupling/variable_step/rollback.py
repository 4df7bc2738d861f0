"""Rollback of members: verification by trial, and logs that discard the lines of rolled-back steps."""

from __future__ import annotations

import ctypes
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.coupling.variable_step.explicit_step import ACCEPTED, RESTORED, SAVED
from twin.errors import CouplingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from twin.coupling.algorithms import Algorithm
    from twin.coupling.member import Member, MemberVariable

LINES = 20  # largest number of log lines


def alternatives(algorithm: Algorithm) -> str:
    """Return the names of the algorithms without rollback."""
    return ", ".join(candidate.name for candidate in algorithm.every() if not candidate.rolls_back)


def check_rollback(algorithm: Algorithm, members: Mapping[str, Member], slow: Collection[str]) -> None:
    """Raise CouplingError if the algorithm needs rollback and a member lacks it; members in `slow` need none."""
    if not algorithm.rolls_back:
        return
    unsupported = [name for name, member in members.items() if name not in slow and not member.has_fmu_state]
    if unsupported:
        raise CouplingError([cannot_go_back(name, algorithm) for name in unsupported])


def cannot_go_back(name: str, algorithm: Algorithm) -> str:
    """Return the message for a member without rollback."""
    names = alternatives(algorithm)
    return f"{name}: cannot go back to the begin of a step, which {algorithm} needs. Use {names}, or give it a longer `communication_step`."


def unfaithful(name: str, wrong: str, algorithm: Algorithm) -> str:
    """Return the message for a member whose declared rollback does not work."""
    names = alternatives(algorithm)
    return f"{name}: says that it can go back to the begin of a step, and cannot: {wrong}. Use {names}."


def verify_rollback(member: Member, t: float, h: float, moved: bool = False) -> str:
    """Verify by trial that a member supports rollback of a step from t by h [s].

    Returns the problem; empty if rollback works, and then the member is at t again.

    `moved`: increase the inputs by 1, which is a stronger test of a member that starts at rest.
    """
    access = member.state_access(1)
    names = [v.name for v in member.variables.values() if v.causality == "output" and v.connectable]
    flags = np.zeros(5, np.int64)
    pointer = access.pointer_addresses[0]

    def outputs() -> list[Any]:
        return [np.array(member.get(name)) for name in names]

    def step() -> list[Any]:
        status = member.try_step(t, h, flags)
        if status > 1:
            raise SimulationError(f"its step by {h:g} s returns {status}")
        return outputs()

    def move(function: int, state: int, refusal: str) -> None:
        if machine.call_state(function, member.instance, state) > 1:
            raise SimulationError(refusal)

    def restore() -> None:
        move(access.set, ctypes.c_int64.from_address(pointer).value, "it refuses to go back")

    def take_inputs() -> None:
        for name, value in inputs.items():
            member.set(name, value)

    try:
        inputs = {v.name: member.get(v.name) + 1.0 for v in member.variables.values() if moved and is_free(v)}
        move(access.get, pointer, "it does not give its state")
        before = outputs()
        take_inputs()
        first = step()
        restore()
        restored = outputs()
        take_inputs()
        for name, expected, actual in (
            *zip(names, before, restored, strict=True),
            *zip(names, first, step(), strict=True),
        ):
            if expected.tobytes() != actual.tobytes():
                return f"{name} is {expected} at first and {actual} after going back"
        restore()
    except SimulationError as error:
        return str(error)
    return ""


def is_free(variable: MemberVariable) -> bool:
    """Whether a variable is a real input without bounds."""
    return variable.causality == "input" and variable.dtype.kind == "f" and not variable.is_bounded


class BufferedLog(list[str]):
    """Log of a member that forwards lines when their step is accepted."""

    def __init__(self, outer: list[str], logs: StepLogs) -> None:
        super().__init__(outer)
        self.outer, self._logs = outer, logs

    def append(self, line: str) -> None:
        """Append a line; forward it at once outside of steps."""
        super().append(line)
        if self._logs.is_stepping:
            self._logs.buffer(self, line)
        else:
            self.forward(line)

    def forward(self, line: str) -> None:
        """Forward a line to the outer log."""
        self.outer.append(line)
        del self.outer[:-LINES]


class StepLogs:
    """Logs of members with rollback; must outlive the native loop."""

    def __init__(self, members: Iterable[Member]) -> None:
        self.pending = np.zeros(1, np.int64)  # whether lines are buffered; read by the compiled code
        self.is_stepping = False
        self._lines: list[tuple[BufferedLog, str]] = []
        self._marks: dict[int, int] = {}
        self._callback = machine.ACCESS(self._on_step_outcome)
        for member in members:
            outer = member.log.outer if isinstance(member.log, BufferedLog) else member.log  # of an earlier run
            member.log = BufferedLog(outer, self)

    def connect(self, state: Any) -> None:
        """Write the callback to the loop's record."""
        state["pending"] = self.pending.ctypes.data
        state["log_callback"] = machine.address_of(self._callback)

    def stepping(self) -> AbstractContextManager[None]:
        """Buffer log lines in the block; at its end the remaining lines are forwarded: no rollback follows."""
        return self._buffering(ACCEPTED)

    def discarding(self) -> AbstractContextManager[None]:
        """Discard the log lines of the block, for trial steps."""
        return self._buffering(RESTORED)

    @contextmanager
    def _buffering(self, outcome: int) -> Iterator[None]:
        self.is_stepping = True
        try:
            yield
        finally:
            self.is_stepping = False
            self._on_step_outcome(0, 0, outcome, 0, 0)

    def buffer(self, log: BufferedLog, line: str) -> None:
        """Buffer a line until its step is accepted."""
        self._lines.append((log, line))
        self.pending[0] = 1

    def _on_step_outcome(self, _instance: int, _references: int, what: int, _values: int, slot: int) -> int:
        if what == SAVED:
            self._marks[slot] = len(self._lines)
        elif what == RESTORED:
            mark = self._marks.get(slot, 0)
            for log, line in reversed(self._lines[mark:]):
                if log and log[-1] == line:
                    log.pop()
            del self._lines[mark:]
        else:
            for log, line in self._lines:
                log.forward(line)
            self._lines.clear()
            self._marks.clear()
            self.pending[0] = 0
        return 0
