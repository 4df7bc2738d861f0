"""One step of all members, stage by stage, and its rollback."""

from __future__ import annotations

from typing import Any

from twin.compiler import (
    call_access,
    call_state,
    call_step,
    call_trial,
    read8,
    read64,
    read_float,
    write64,
    write_float,
)
from twin.coupling.execution.loop import access, move
from twin.coupling.variable_step.input_extrapolation import USE, feed, value
from twin.coupling.variable_step.record_layout import BEFORE, BEGIN, EARLY, FINAL, LAST, LEFT

SAVED, RESTORED, ACCEPTED = range(3)  # outcomes of a step that are reported to the logs
ROUNDING = 1e-12  # tolerance of the end of a step, relative to its length


def perform(self: Any, operation: int, t: float, h: float) -> int:
    """Run an operation: move values, call accesses, step from t by h [s]; return the status."""
    move(operation)
    if access(self, read64(operation + 56), read64(operation + 64)) != 0:
        return int(self.status)
    row = read64(operation + 72)
    for _ in range(read64(operation + 80)):
        flags = read64(row + 24)
        self.at = row
        if self.trial != 0:
            status = call_trial(read64(row), read64(row + 8), read64(row + 16), t, h, flags)
        else:
            status = call_step(read64(row), read64(row + 8), read64(row + 16), t, h, flags)
        if status > 1:
            self.member, self.status = read64(row + 48), status
            return status
        if read8(flags + 8) != 0:
            self.ending = 1 + read64(row + 48)
        if read8(flags + 16) != 0 or (self.trial != 0 and read8(flags + 8) != 0):
            if read_float(flags + 24) < t + h - ROUNDING * h:
                self.member, self.status, self.until = read64(row + 48), EARLY, read_float(flags + 24)
                return EARLY
        row += 56
    return 0


def read_connections(self: Any) -> None:
    """Update the current values of all connections."""
    stage = self.stages
    for _ in range(self.stage_count):
        move(read64(stage))
        stage += 40


def sweep(self: Any, t: float, h: float) -> int:
    """Step the members without their own period from t by h [s]; return the status of a failure, else 0."""
    self.sweeps += 1
    self.ending = 0
    stage = self.stages
    for _ in range(self.stage_count):
        if self.stage_count > 1:
            move(read64(stage))
        direct, gets = read64(stage + 8), read64(stage + 16)
        if direct != 0:
            move(direct)
        part = read64(stage + 24)
        for _ in range(read64(stage + 32)):
            feed(self, read64(part), read64(part + 8))
            status = perform(self, read64(part + 16), t + read_float(part + 24) * h, read_float(part + 32) * h)
            if status > 1:
                return status
            part += 40
        if gets != 0:
            status = perform(self, gets, t, h)
            if status > 1:
                return status
        stage += 40
    return 0


def periodic(self: Any, operation: int, count: int, shift: int) -> int:
    """Run the operations of periodic members that are due at this tick or, with a shift of 1, at the next."""
    t = (self.begin_ns + self.tick * self.step_ns) / self.per_second
    for _ in range(count):
        divider = read64(operation)
        if (self.tick + shift) % divider == 0:
            status = perform(self, operation, t, read_float(operation + 16))
            if status > 1:
                return status
        operation += 88
    return 0


def transfer(source: int, target: int, words: int) -> None:
    """Copy 64-bit words."""
    for i in range(words):
        write64(target + 8 * i, read64(source + 8 * i))


def save_state(self: Any, slot: int) -> int:
    """Save all memory and states that a step changes."""
    row = self.regions
    for _ in range(self.region_count):
        transfer(read64(row), read64(row + 16 + 8 * slot), read64(row + 8))
        row += 32
    row = self.states
    for _ in range(self.state_count):
        self.at = row
        status = call_state(read64(row), read64(row + 16), read64(row + 24 + 8 * slot))
        if status > 1:
            self.member, self.status = read64(row + 40), status
            return status
        row += 48
    notify_logs(self, SAVED, slot)
    return 0


def restore_state(self: Any, slot: int) -> int:
    """Restore the saved memory and states, also after a failure."""
    self.outputs_current = 0
    row = self.regions
    for _ in range(self.region_count):
        transfer(read64(row + 16 + 8 * slot), read64(row), read64(row + 8))
        row += 32
    row = self.states
    for _ in range(self.state_count):
        self.at = row
        status = call_state(read64(row + 8), read64(row + 16), read64(read64(row + 24 + 8 * slot)))
        if status > 1:
            self.member, self.status = read64(row + 40), status
            return status
        row += 48
    notify_logs(self, RESTORED, slot)
    return 0


def notify_logs(self: Any, what: int, slot: int) -> None:
    """Report the outcome of a step to the logs, if lines are buffered."""
    if self.pending != 0 and read64(self.pending) != 0:
        call_access(self.log_callback, 0, 0, what, 0, slot)


def begin(self: Any) -> None:
    """Begin a step at the current values of the connections."""
    vectors, span = self.vectors, 8 * self.elements
    transfer(vectors, vectors + BEGIN * span, self.elements)


def end(self: Any, h: float) -> None:
    """End a step of h [s]: its begin becomes an earlier point."""
    vectors, course, past, span = self.vectors, self.course, self.past, 8 * self.elements
    mean, final = self.weights, self.weights + FINAL * USE
    if self.smoothing > 0.0:
        for i in range(self.elements):
            at, own = vectors + 8 * i + BEGIN * span, course + 8 * i
            write_float(own + LAST * span, value(final, at, own, own + BEFORE * span, own + LAST * span))
    for j in range(self.bond_count):
        now, own = vectors + 8 * read64(self.bonds + 8 * j), course + 8 * read64(self.bonds + 8 * j)
        at = now + BEGIN * span
        residual = (read_float(at) + read_float(now)) / 2.0 - value(
            mean, at, own, own + BEFORE * span, own + LAST * span
        )
        write_float(own + LEFT * span, self.correction * residual)
    transfer(course, course + BEFORE * span, self.elements)
    transfer(vectors + BEGIN * span, course, self.elements)
    write_float(past + 16, read_float(past + 8))
    write_float(past + 8, h)
    write64(past, min(2, read64(past) + 1))
