"""Main function of the variable-step master: periodic members, steps between two ticks, error control, recording."""

from __future__ import annotations

from typing import Any

from twin.compiler import call_access, read64, read_float, write_float
from twin.coupling.execution.loop import DONE, FAILED, FINISHED, FULL, ROUNDING, check, record
from twin.coupling.variable_step.explicit_step import (
    ACCEPTED,
    notify_logs,
    periodic,
    restore_state,
    save_state,
    transfer,
)
from twin.coupling.variable_step.implicit_step import attempt, size_of
from twin.coupling.variable_step.record_layout import COMPARED, DOUBLING, EARLY, FIXED, RESIDUAL, SCALE, UNSOLVED
from twin.coupling.variable_step.step_control import choose_step

SAFETY = 0.9
HUGE = 1e300
LARGEST = 2**62
ERROR = 3  # FMI's status


def run(self: Any) -> int:
    """Run until `stop`, a full recording buffer, a member that fails or ends the simulation, a violated limit, or a met condition."""
    self.outputs_current = 0
    if self.must_restore != 0:
        self.must_restore = 0
        if restore_state(self, 0) > 1:
            return FAILED
    while self.tick < self.stop:
        if self.next_row >= self.limit:
            return FULL
        if self.in_tick == 0:
            self.ending = 0
            if periodic(self, self.begins, self.begin_count, 0) > 1:
                return FAILED
            self.in_tick, self.position, self.off, self.over = 1, 0, 0, self.ending
        if advance_to_tick(self) > 1:
            return FAILED
        if self.position < self.divisions:
            return FINISHED
        if periodic(self, self.ends, self.end_count, 1) > 1:
            return FAILED
        if self.end_count > 0:
            self.outputs_current = 0
        if self.events != 0 and notify_events(self) > 1:
            return FAILED
        if self.over != 0:
            self.member, self.finished = self.over - 1, 1
        self.in_tick = 0
        self.tick += 1
        if self.every == 1 or self.tick % self.every == 0:
            record(self)
        if self.finished != 0:
            return FINISHED
        if self.limit_count > 0 or self.condition_count > 0:
            result = check(self, self.tick)
            if result != DONE:
                return result
    return DONE


def time_at(self: Any, position: int) -> float:
    """Return the time of a division of this tick [s]: one division of integers, unless these are too large."""
    ticks = self.begin_ns + self.tick * self.step_ns
    if position == 0:
        return float(ticks / self.per_second)
    if abs(ticks) > LARGEST // self.divisions:
        return float(ticks / self.per_second + self.tick_length * (position / self.divisions))
    return float((ticks * self.divisions + position * self.step_ns) / (self.per_second * self.divisions))


def advance_to_tick(self: Any) -> int:
    """Advance to the next tick in one step or several; return the status of a failure, else 0."""
    shortens = 0
    if self.control != FIXED and self.trial != 0:
        shortens = 1  # A failed step may be repeated with a shorter one.
    while self.position < self.divisions and self.finished == 0:
        stride = self.stride
        while self.position > 0 and self.position % stride != 0:
            stride = stride // 2
        t, h = time_at(self, self.position), self.tick_length
        if stride < self.divisions:
            h *= stride / self.divisions
        if self.off != 0:
            t = self.now
            h = time_at(self, self.position + stride) - t
        if self.limited == 0 and self.events != 0 and t < self.due < t + h - ROUNDING * h:
            self.limited, self.until = 2, self.due
        if self.limited != 0:
            h = self.until - t
        self.step_begin, self.span = t, h
        if self.has_scales == 0 and self.trial != 0 and learn_scales(self, t) > 1:
            return int(self.status)
        if self.trial != 0 and save_state(self, 0) > 1:
            return int(self.status)
        status = 0
        if self.control == DOUBLING:
            status = step_twice(self, t, h, stride <= self.least)
        else:
            status = attempt(self, t, h, 0)
        if status == UNSOLVED and (self.control == FIXED or stride <= self.least):
            if self.unsolved == 0:
                self.unsolved_tick = self.tick
            self.unsolved += 1
            if self.strict != 0:
                self.status = UNSOLVED
                return UNSOLVED
            status = 0
        if status == EARLY and self.trial != 0 and self.until > t:
            if restore_state(self, 0) > 1:
                return int(self.status)
            self.limited = 1
        elif status == ERROR and shortens != 0 and 0 < stride < self.passed:
            self.least, self.refused = self.passed, 1 + self.member  # The member has made longer steps.
            if shorten(self, self.passed) > 1:
                return int(self.status)
        elif status == UNSOLVED or (status == ERROR and shortens != 0 and stride > self.least):
            if shorten(self, stride // 2) > 1:
                return int(self.status)
        elif status > 1:
            return status
        elif self.control == FIXED or judge(self, stride) != 0:
            accept(self, stride)
            if self.events != 0 and (self.position < self.divisions or self.off != 0) and notify_events(self) > 1:
                return int(self.status)
        elif shorten(self, stride // 2) > 1:
            return int(self.status)
    return 0


def learn_scales(self: Any, t: float) -> int:
    """Determine the sizes of values from a trial step of the longest length, which is rolled back."""
    self.has_scales = 1
    if save_state(self, 0) > 1:
        return int(self.status)
    if attempt(self, t, self.tick_length, 0) <= 1:
        update_scales(self)
    self.sweeps = 0
    return restore_state(self, 0)


def update_scales(self: Any) -> None:
    """Update the largest values of the connections."""
    for j in range(self.moving_count):
        now = self.vectors + 8 * read64(self.moving + 8 * j)
        scale, size = now + 8 * SCALE * self.elements, abs(read_float(now))
        if size > read_float(scale) and size < HUGE:
            write_float(scale, size)


def shorten(self: Any, stride: int) -> int:
    """Roll back a step and set the stride of the next one."""
    self.rejected += 1
    self.limited = 0
    self.stride = max(1, stride)
    return restore_state(self, 0)


def notify_events(self: Any) -> int:
    """Call the event handling after an accepted step; return its status."""
    self.status = call_access(self.events, 0, 0, 0, 0, 0)
    self.outputs_current = 0
    return int(self.status)


def accept(self: Any, stride: int) -> None:
    """Accept a step and update the position in the tick."""
    self.accepted += 1
    if self.max_iterations > 0 or self.control != FIXED:
        update_scales(self)
    notify_logs(self, ACCEPTED, 0)
    if self.ending != 0:
        self.member, self.finished = self.ending - 1, 1
    if self.limited == 0:
        self.position += stride
        self.off = 0
        return
    self.limited = 0
    self.now, self.off = self.until, 1
    while self.position < self.divisions and time_at(self, self.position + 1) <= self.until:
        self.position += 1
    if time_at(self, self.position) == self.until:
        self.off = 0


def step_twice(self: Any, t: float, h: float, is_least: bool) -> int:
    """Make one step, then two halves, which are kept; the values at the end of both are compared.

    Steps that do not converge are kept if they cannot be shorter.
    """
    unsolved = 0
    for part in range(3):
        begin, length = t, h
        if part > 0:
            length = h / 2.0
        if part == 2:
            begin = t + length
        status = attempt(self, begin, length, 1)
        if status == UNSOLVED and is_least:
            unsolved = UNSOLVED
        elif status > 1:
            return status
        if part == 0:
            transfer(self.vectors, self.vectors + 8 * COMPARED * self.elements, self.elements)
            if restore_state(self, 0) > 1:
                return int(self.status)
    return unsolved


def judge(self: Any, stride: int) -> int:
    """Return 1 if the step is accurate enough or cannot be shorter, else 0; set the length of the next step."""
    if self.control == RESIDUAL:
        choose_step(self, stride)
        return 1
    largest, room = 0.0, 1.0
    divisor = 0.0
    for _ in range(self.order + 1):
        room *= 2.0 / SAFETY
        divisor = 2.0 * divisor + 1.0
    if self.control == DOUBLING:
        room *= 2.0 / SAFETY
    else:
        divisor = 1.0
    self.passed = stride
    for j in range(self.judged_count):
        i = read64(self.judged + 8 * j)
        now = self.vectors + 8 * i
        error = abs(read_float(now + 8 * COMPARED * self.elements) - read_float(now)) / divisor
        ratio = error / (self.tolerance * size_of(self, i))
        if not (ratio <= HUGE):  # NaN stays the largest, whatever follows
            ratio = HUGE
        largest = max(largest, ratio)
    if largest > 1.0:
        if stride > self.least and self.limited != 1:
            return 0
        if self.missed == 0:
            self.missed_tick = self.tick
        self.missed += 1
    if largest * room <= 1.0 and stride == self.stride and stride < self.divisions:
        self.stride = 2 * stride
    return 1
