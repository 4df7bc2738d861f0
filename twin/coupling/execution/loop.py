"""The fixed-step loop: one function over tables of addresses. Topology is data; a new system needs no compilation.

`run` is plain Python over a record, like a component: compiled it costs what a hand-written C loop costs, interpreted
it can be stepped through. It allocates nothing and calls no Python but Python-side members.

From communication point k to k + 1 it executes a list of operations, each with its own divider: it is due at every n-th
communication point, counted at k, or at k + 1 for operations that publish. An operation moves values (copies, conversions,
fmiGetXXX or fmiSetXXX), then steps members. Stage by stage (Jacobi: one stage; Gauss-Seidel: one per member) they are:

1. members that are due take their inputs
2. members that are due step, over their own period
3. members whose period ends at k + 1 publish

so a slow member's outputs appear when its step is due, and within a stage no member sees outputs of the same step. Where
all members of a stage are due at every point, each publishes right after its step, while its data is in the cache: all
inputs have been taken by then.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.compiler import (
    call_access,
    call_step,
    read8,
    read64,
    read_float,
    write64,
)
from twin.coupling.execution.condition_loop import is_met
from twin.coupling.execution.scalars import convert_scalar, width
from twin.coupling.variable_step import record_layout

ROUNDING = 1e-12  # tolerance of the end of a step, relative to its length

# return values of `run`
DONE, FAILED, FINISHED, FULL, NOTICED, TRIGGERED = 0, 1, 2, 3, 4, 5

# columns of the tables: int64 words unless said otherwise
OPERATION = (
    "divider",
    "shift",
    "h",  # due if (k + shift) % divider == 0; h: step of its members [s], Float64 bits
    "copies",
    "copy_count",
    "converts",
    "convert_count",
    "accesses",
    "access_count",
    "steps",
    "step_count",
)
COPY = ("source", "target", "words")
CONVERT = ("source", "source_kind", "target", "target_kind", "count", "factor", "offset")  # the last two Float64 bits
ACCESS = ("function", "instance", "references", "count", "values", "size", "member")
# `signature`: as in compiler.machine; `gets`: rows of accesses that publish at once
STEP = ("function", "signature", "instance", "flags", "gets", "get_count", "member")
LIMIT = ("address", "kind", "count", "low", "high")  # the last two Float64 bits; NaN violates any limit
# representation of a scalar in memory, for conversions
KINDS = {"f8": 0, "f4": 1, "i1": 2, "u1": 3, "i2": 4, "u2": 5, "i4": 6, "u4": 7, "i8": 8, "u8": 9, "b1": 10}

RECORD = np.dtype(
    [
        (name, np.int64)
        for name in (
            "tick",
            "stop",
            "begin_ns",
            "step_ns",
            "per_second",
            "operations",
            "operation_count",
            "next_row",
            "limit",
            "row_bytes",
            "every",  # recording: address of the next row, and of the end
            "records",
            "record_count",
            "record_converts",
            "record_convert_count",
            "member",
            "status",
            "finished",
            "limits",
            "limit_count",
            "beyond",  # monitored values, and the row of a violated limit
            "scalar",  # address of a word for converting a value to Float64
            "conditions",
            "condition_count",
            "stack",  # memory of the stack machine
            "at",  # address of the row of the call in progress: crash reports derive the member from it
            *record_layout.INTEGERS,
        )
    ]
    + [(name, np.float64) for name in record_layout.FLOATS],
    align=True,
)


def copy(row: int, count: int, shift: int) -> None:
    """Copy blocks of 64-bit words; `shift` is added to the target address (the row being recorded)."""
    for _ in range(count):
        source, target = read64(row), read64(row + 8) + shift
        for j in range(read64(row + 16)):
            write64(target + 8 * j, read64(source + 8 * j))
        row += 24


def convert(row: int, count: int, shift: int) -> None:
    """Convert types and units; `shift` as in `copy`."""
    for _ in range(count):
        source, source_kind = read64(row), read64(row + 8)
        target, target_kind = read64(row + 16) + shift, read64(row + 24)
        factor, offset = read_float(row + 40), read_float(row + 48)
        source_width, target_width = width(source_kind), width(target_kind)
        for j in range(read64(row + 32)):
            at, to = source + j * source_width, target + j * target_width
            convert_scalar(at, source_kind, to, target_kind, factor, offset)
        row += 56


def move(operation: int) -> None:
    """Run the copies and conversions of an operation."""
    copy(read64(operation + 24), read64(operation + 32), 0)
    convert(read64(operation + 40), read64(operation + 48), 0)


def record(self: Any) -> None:
    """Write a row: the tick, then the recorded values."""
    write64(self.next_row, self.tick)
    copy(self.records, self.record_count, self.next_row)
    convert(self.record_converts, self.record_convert_count, self.next_row)
    self.next_row += self.row_bytes


def beyond(row: int, count: int, scalar: int) -> int:
    """Return the address of the first row with a value outside its limits, or 0."""
    for _ in range(count):
        at, value_kind = read64(row), read64(row + 8)
        low, high = read_float(row + 24), read_float(row + 32)
        size = width(value_kind)
        for _ in range(read64(row + 16)):
            value = 0.0
            if value_kind == 0:
                value = read_float(at)
            else:
                convert_scalar(at, value_kind, scalar, 0, 1.0, 0.0)
                value = read_float(scalar)
            if not (value >= low and value <= high):
                return row
            at += size
        row += 40
    return 0


def has_returned_early(self: Any, t: float) -> int:
    """Return 1 if a member returned early from its step from t, else 0."""
    row = self.early_returns
    for _ in range(self.early_return_count):
        flags, h = read64(row), read_float(row + 8)
        if read8(flags + 16) != 0 and read_float(flags + 24) < t + h - ROUNDING * h:
            self.member, self.status, self.until = read64(row + 16), record_layout.EARLY, read_float(flags + 24)
            return 1
        row += 24
    return 0


def access(self: Any, row: int, count: int) -> int:
    """Set inputs or get outputs, a call per row; 1 if a member fails."""
    for _ in range(count):
        references, values = read64(row + 16), read64(row + 32)
        self.at = row
        status = call_access(read64(row), read64(row + 8), references, read64(row + 24), values, read64(row + 40))
        if status > 1:
            self.member, self.status = read64(row + 48), status
            return 1
        row += 56
    return 0


def run(self: Any) -> int:
    """Run until `stop`, a full recording buffer, a member that fails or ends the simulation, a violated limit, or a met condition."""
    operations, operation_count, every = self.operations, self.operation_count, self.every
    begin_ns, step_ns, per_second = self.begin_ns, self.step_ns, self.per_second
    is_checked = self.limit_count > 0 or self.condition_count > 0
    early_return_count, tick = self.early_return_count, self.tick
    while tick < self.stop:
        if self.next_row >= self.limit:
            return FULL
        t = (begin_ns + tick * step_ns) / per_second
        operation = operations
        for _ in range(operation_count):
            divider = read64(operation)
            if divider == 1 or (tick + read64(operation + 8)) % divider == 0:
                move(operation)
                if access(self, read64(operation + 56), read64(operation + 64)) != 0:
                    return FAILED
                h = read_float(operation + 16)
                row = read64(operation + 72)
                for _ in range(read64(operation + 80)):
                    flags = read64(row + 24)
                    self.at = row
                    status = call_step(read64(row), read64(row + 8), read64(row + 16), t, h, flags)
                    if status > 1:
                        self.member, self.status = read64(row + 48), status
                        return FAILED
                    if read8(flags + 8) != 0:
                        self.member, self.finished = read64(row + 48), 1
                    if access(self, read64(row + 32), read64(row + 40)) != 0:
                        return FAILED
                    row += 56
            operation += 88
        if early_return_count > 0 and has_returned_early(self, t) != 0:
            return FAILED
        tick += 1
        self.tick = tick
        if every == 1 or tick % every == 0:
            record(self)
        if self.finished != 0:
            return FINISHED
        if is_checked:
            result = check(self, tick)
            if result != DONE:
                return result
    return DONE


def check(self: Any, tick: int) -> int:
    """Check conditions and limits at a communication point. Conditions come first: a violated limit does not hide them."""
    result = DONE
    if self.condition_count > 0 and is_met(self, tick) != 0:
        result = TRIGGERED
    if self.limit_count > 0:
        self.beyond = beyond(self.limits, self.limit_count, self.scalar)
        if self.beyond != 0:
            result = NOTICED
    return result
