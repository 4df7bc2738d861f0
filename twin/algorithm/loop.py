"""The loop: one function that walks tables of addresses. Topology is data; a new system compiles nothing.

`run` is plain Python over a record, like a component: compiled it costs what a hand-written C loop costs, interpreted
it can be stepped through. It allocates nothing and calls no Python but Python-side members.

From communication point k to k + 1, stage by stage (Jacobi: one stage; Gauss-Seidel: one per member):

1. every member of the stage that is due takes its inputs: copies, conversions, fmiSetXXX
2. every member that is due steps, over its own period
3. every member whose period ends at k + 1 publishes: fmiGetXXX, copies

so a slow member's outputs appear when its step is due, and within a stage nobody sees another's future.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.machine import (
    call_access,
    call_step,
    read8,
    read16,
    read32,
    read64,
    read_float,
    read_float32,
    write8,
    write16,
    write32,
    write64,
    write_float,
    write_float32,
)

# what `run` returns
DONE, FAILED, FINISHED, FULL = 0, 1, 2, 3

# columns of the tables: int64 words unless said otherwise
STAGE = ("slot_begin", "slot_end")
SLOT = (
    "divider", "h",  # communication points per step; h [s] as the bits of a Float64
    "copy_begin", "copy_end", "convert_begin", "convert_end", "set_begin", "set_end",
    "step_begin", "step_end",
    "get_begin", "get_end", "publish_begin", "publish_end",
)  # fmt: skip
COPY = ("source", "target", "words")
CONVERT = ("source", "source_kind", "target", "target_kind", "count", "factor", "offset")  # the last two Float64 bits
ACCESS = ("function", "instance", "references", "count", "values", "size", "member")
STEP = ("function", "instance", "flags", "member")

# how a scalar lies in memory, for conversions
KINDS = {"f8": 0, "f4": 1, "i1": 2, "u1": 3, "i2": 4, "u2": 5, "i4": 6, "u4": 7, "i8": 8, "u8": 9, "b1": 10}
WIDTHS = (8, 4, 1, 1, 2, 2, 4, 4, 8, 8, 1)

RECORD = np.dtype(
    [
        (name, np.int64)
        for name in (
            "tick", "stop", "begin_ns", "step_ns",
            "stages", "stage_count", "slots", "copies", "converts", "accesses", "steps",
            "rows", "row", "row_limit", "row_words", "every",
            "records", "record_count", "record_convert_begin", "record_convert_end",
            "member", "status", "finished",
        )
    ],
    align=True,
)  # fmt: skip


def convert_one(source: int, source_kind: int, target: int, target_kind: int, factor: float, offset: float) -> None:
    """Move one scalar to another representation; whole numbers go as integers, so that none is rounded."""
    if source_kind < 2:
        value = read_float(source) if source_kind == 0 else read_float32(source)
        value = value * factor + offset
        whole = 0
    else:
        if source_kind >= 8 and source_kind < 10:
            whole = read64(source)
        elif source_kind >= 6 and source_kind < 8:
            whole = read32(source)
            if source_kind == 7:
                whole = whole & 0xFFFFFFFF
        elif source_kind >= 4 and source_kind < 6:
            whole = read16(source)
            if source_kind == 5:
                whole = whole & 0xFFFF
        else:
            whole = read8(source)
            if source_kind != 2:
                whole = whole & 0xFF
        value = whole * factor + offset
    if target_kind == 0:
        write_float(target, value)
    elif target_kind == 1:
        write_float32(target, value)
    elif target_kind >= 8 and target_kind < 10:
        write64(target, whole)
    elif target_kind >= 6 and target_kind < 8:
        write32(target, whole)
    elif target_kind >= 4 and target_kind < 6:
        write16(target, whole)
    else:
        write8(target, whole)


def copy(copies: int, begin: int, end: int) -> None:
    """Runs of 64-bit words from source to target."""
    for i in range(begin, end):
        row = copies + 24 * i
        source = read64(row)
        target = read64(row + 8)
        for j in range(read64(row + 16)):
            write64(target + 8 * j, read64(source + 8 * j))


def convert(converts: int, begin: int, end: int, shift: int) -> None:
    """Conversions of type or unit; `shift` moves the target (the row being recorded)."""
    for i in range(begin, end):
        row = converts + 56 * i
        source = read64(row)
        source_kind = read64(row + 8)
        target = read64(row + 16) + shift
        target_kind = read64(row + 24)
        factor = read_float(row + 40)
        offset = read_float(row + 48)
        for j in range(read64(row + 32)):
            at = source + j * width(source_kind)
            convert_one(at, source_kind, target + j * width(target_kind), target_kind, factor, offset)


def width(kind: int) -> int:
    """Size of a scalar of a kind [byte]."""
    if kind == 0 or kind == 8 or kind == 9:
        return 8
    if kind == 1 or kind == 6 or kind == 7:
        return 4
    return 2 if kind == 4 or kind == 5 else 1


def access(accesses: int, begin: int, end: int) -> int:
    """Call fmiGetXXX or fmiSetXXX; -1, or the row that failed."""
    for i in range(begin, end):
        row = accesses + 56 * i
        status = call_access(
            read64(row), read64(row + 8), read64(row + 16), read64(row + 24), read64(row + 32), read64(row + 40)
        )
        if status > 1:
            return i
    return -1


def record(self: Any) -> None:
    """Write one row: the tick, then the recorded values."""
    row = self.rows + self.row * self.row_words * 8
    write64(row, self.tick)
    for i in range(self.record_count):
        entry = self.records + 24 * i
        source = read64(entry)
        target = row + read64(entry + 8)
        for j in range(read64(entry + 16)):
            write64(target + 8 * j, read64(source + 8 * j))
    if self.record_convert_begin < self.record_convert_end:
        convert(self.converts, self.record_convert_begin, self.record_convert_end, row)
    self.row += 1


def run(self: Any) -> int:
    """Go on until `stop`, a full recording buffer, a member that fails, or one that finishes the simulation."""
    stages, stage_count, slots, steps = self.stages, self.stage_count, self.slots, self.steps
    copies, converts, accesses = self.copies, self.converts, self.accesses
    while self.tick < self.stop:
        if self.row >= self.row_limit:
            return FULL
        tick = self.tick
        t = (self.begin_ns + tick * self.step_ns) / 1e9
        for stage in range(stage_count):
            slot_begin = read64(stages + 16 * stage)
            slot_end = read64(stages + 16 * stage + 8)
            for i in range(slot_begin, slot_end):
                slot = slots + 112 * i
                divider = read64(slot)
                if divider == 1 or tick % divider == 0:
                    copy_begin, copy_end = read64(slot + 16), read64(slot + 24)
                    if copy_begin < copy_end:
                        copy(copies, copy_begin, copy_end)
                    convert_begin, convert_end = read64(slot + 32), read64(slot + 40)
                    if convert_begin < convert_end:
                        convert(converts, convert_begin, convert_end, 0)
                    failed = access(accesses, read64(slot + 48), read64(slot + 56))
                    if failed >= 0:
                        self.member = read64(accesses + 56 * failed + 48)
                        self.status = 3
                        return FAILED
            for i in range(slot_begin, slot_end):
                slot = slots + 112 * i
                divider = read64(slot)
                if divider == 1 or tick % divider == 0:
                    h = read_float(slot + 8)
                    for j in range(read64(slot + 64), read64(slot + 72)):
                        row = steps + 32 * j
                        flags = read64(row + 16)
                        status = call_step(read64(row), read64(row + 8), t, h, flags)
                        if status > 1:
                            self.member = read64(row + 24)
                            self.status = status
                            return FAILED
                        if read8(flags + 8) != 0:
                            self.member = read64(row + 24)
                            self.finished = 1
            for i in range(slot_begin, slot_end):
                slot = slots + 112 * i
                divider = read64(slot)
                if divider == 1 or (tick + 1) % divider == 0:
                    failed = access(accesses, read64(slot + 80), read64(slot + 88))
                    if failed >= 0:
                        self.member = read64(accesses + 56 * failed + 48)
                        self.status = 3
                        return FAILED
                    copy_begin, copy_end = read64(slot + 96), read64(slot + 104)
                    if copy_begin < copy_end:
                        copy(copies, copy_begin, copy_end)
        self.tick = tick + 1
        if self.every == 1 or (tick + 1) % self.every == 0:
            record(self)
        if self.finished != 0:
            return FINISHED
    return DONE
