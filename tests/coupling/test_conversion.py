"""Values that the loop moves: conversions between all types, copies, rows of a recording, limits."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling.execution import loop
from twin.coupling.execution.loop import KINDS, beyond, convert, copy, record
from twin.coupling.execution.loop_tables import merge_rows
from twin.coupling.execution.scalars import convert_scalar, width
from twin.coupling.execution.value_memory import ValueMemory, bits

GUARD = 0x5A  # content of the bytes around a target, which must stay


def boundaries(code):
    """Smallest and largest value of a type, those around zero, and some between."""
    dtype = np.dtype(code)
    if dtype.kind == "f":
        return np.array([-1.5, 0.0, 2.0**-20, 3e4 + 0.1], dtype)
    if dtype.kind == "b":
        return np.array([False, True])
    info = np.iinfo(dtype)
    return np.array([info.min, min(0, info.min + 1), 0, 1, 77, info.max - 1, info.max], dtype)


def fits(source, target):
    """Whether a connection may convert the types: real numbers to real ones, whole numbers where none overflows."""
    a, b = np.dtype(source), np.dtype(target)
    if b.kind == "f":
        return True
    if a.kind == "f" or (b.kind == "b" and a.kind != "b"):
        return False
    return a.kind == "b" or (np.iinfo(a).min >= np.iinfo(b).min and np.iinfo(a).max <= np.iinfo(b).max)


PAIRS = [(a, b) for a in KINDS for b in KINDS if fits(a, b)]


@every_case(("source", "target"), PAIRS)
def test_a_scalar_is_converted_as_numpy_converts_it(source, target):
    dtype, is_real = np.dtype(target), np.dtype(target).kind == "f"
    factor, offset = (-2.5, 0.75) if is_real else (1.0, 0.0)
    for value in boundaries(source):
        memory = np.full(24, GUARD, np.uint8)
        given = np.array([value])
        convert_scalar(given.ctypes.data, KINDS[source], memory.ctypes.data + 8, KINDS[target], factor, offset)
        number = float(value) * factor + offset if is_real else value
        assert memory[8 : 8 + dtype.itemsize].view(dtype)[0] == np.asarray(number).astype(dtype), value
        assert (np.delete(memory, np.s_[8 : 8 + dtype.itemsize]) == GUARD).all(), "nothing beside the target is written"


@every_case("code", list(KINDS))
def test_the_width_of_a_scalar_is_that_of_its_type(code):
    assert width(KINDS[code]) == np.dtype(code).itemsize


def test_rows_convert_arrays_with_factor_and_offset_to_a_shifted_target():
    small, wide = np.array([1, -2, 3], np.int16), np.array([0.5, 1.5], np.float32)
    target = np.zeros(8)
    at = target.ctypes.data - 16
    rows = np.array(
        [
            [small.ctypes.data, KINDS["i2"], at, KINDS["f8"], 3, bits(10.0), bits(1.0)],
            [wide.ctypes.data, KINDS["f4"], at + 32, KINDS["f8"], 2, bits(-1.0), bits(0.25)],
        ],
        np.int64,
    )
    convert(rows.ctypes.data, 2, 16)
    assert target.tolist() == [11.0, -19.0, 31.0, 0.0, -0.25, -1.25, 0.0, 0.0]
    convert(rows.ctypes.data, 1, 56)
    assert target.tolist() == [11.0, -19.0, 31.0, 0.0, -0.25, 11.0, -19.0, 31.0]


def test_rows_copy_blocks_of_words():
    source, target = np.arange(1, 6), np.zeros(6, np.int64)
    rows = np.array(
        [[source.ctypes.data + 8, target.ctypes.data, 2], [source.ctypes.data, target.ctypes.data + 32, 1]], np.int64
    )
    copy(rows.ctypes.data, 2, 0)
    assert target.tolist() == [2, 3, 0, 0, 1, 0]


def test_a_recorded_row_has_the_tick_the_copies_and_the_conversions():
    values, flag = np.array([1.5, 2.5, 3.5]), np.array([True])
    rows = np.zeros((2, 5), np.int64)
    copies = np.array([[values.ctypes.data + 8, 8, 2], [values.ctypes.data, 24, 1]], np.int64)
    converts = np.array([[flag.ctypes.data, KINDS["b1"], 32, KINDS["i8"], 1, bits(1.0), bits(0.0)]], np.int64)
    state = SimpleNamespace(
        next_row=rows.ctypes.data,
        row_bytes=40,
        records=copies.ctypes.data,
        record_count=2,
        record_converts=converts.ctypes.data,
        record_convert_count=1,
    )
    for state.tick in (7, 9):
        record(state)
        flag[0], values[1] = False, -1.0
    assert rows[:, 0].tolist() == [7, 9]
    assert rows.view(np.float64)[:, 1:4].tolist() == [[2.5, 3.5, 1.5], [-1.0, 3.5, 1.5]]
    assert rows[:, 4].tolist() == [1, 0]
    assert state.next_row == rows.ctypes.data + rows.nbytes


@pytest.mark.parametrize("code", ["f8", "f4", "i4", "u1"])
def test_a_limit_holds_up_to_its_ends_for_every_element(code):
    """The address of the first row with a value outside is returned, whichever of its elements it is."""
    inside, low, high = np.array([2, 3, 4], code), np.array([4, 3, 2], code), np.array([2, 4, 3], code)
    scalar = np.zeros(1)

    def first(*arrays):
        rows = np.array([[a.ctypes.data, KINDS[code], 3, bits(2.0), bits(4.0)] for a in arrays], np.int64)
        found = beyond(rows.ctypes.data, len(arrays), scalar.ctypes.data)
        return (found - rows.ctypes.data) // 40 if found else None

    assert first(inside, low, high) is None
    low[2], high[1] = 1, 5
    assert (first(inside, low, high), first(high, inside), first(inside)) == (1, 0, None)
    if inside.dtype.kind == "f":
        inside[0] = np.nan
        assert first(low, inside) == 0
        assert first(inside) == 0, "no number lies between two"


@every_case(
    ("rows", "expected"),
    [
        ([], []),
        ([[0, 100, 2]], [[0, 100, 2]]),
        ([[0, 100, 2], [16, 116, 1], [24, 124, 3]], [[0, 100, 6]]),
        ([[0, 100, 2], [16, 124, 1]], [[0, 100, 2], [16, 124, 1]]),
        ([[0, 100, 2], [24, 116, 1]], [[0, 100, 2], [24, 116, 1]]),
        ([[16, 116, 1], [0, 100, 2]], [[16, 116, 1], [0, 100, 2]]),
        ([[0, 100, 1], [16, 116, 1], [24, 124, 1]], [[0, 100, 1], [16, 116, 2]]),
    ],
)
def test_copies_are_merged_where_sources_and_targets_are_adjacent(rows, expected):
    assert merge_rows(np.array(rows, np.int64).reshape(-1, 3)).tolist() == expected


def test_memory_grows_by_blocks_that_never_move():
    memory = ValueMemory()
    sizes = (0, 1, 8, 9, 8 * 4091, 8, 8 * 5000, 8)  # [byte]
    addresses = [memory.take(size) for size in sizes]
    first, second, third, fourth = (int(block.ctypes.data) for block in memory.blocks)
    assert [len(block) for block in memory.blocks] == [4096, 4096, 5000, 4096]
    assert addresses == [first, first + 8, first + 16, first + 24, first + 40, second, third, fourth]
    assert (bits(1.0), bits(-0.0)) == (0x3FF0000000000000, -(2**63))


@every_case(
    ("steps", "expected"),
    [
        ([], (0, 0, 0)),
        ([(False, 2.5)], (0, 0, 0)),
        ([(True, 3.0)], (0, 0, 0)),  # it says so at the end of its step, too
        ([(True, 3.0 - 1e-9)], (1, 5, 3.0 - 1e-9)),
        ([(True, 3.0), (True, 2.5)], (1, 6, 2.5)),
        ([(True, 2.75), (True, 2.5)], (1, 5, 2.75)),
    ],
)
def test_a_member_that_returned_before_the_end_of_its_step_is_noticed(steps, expected):
    """Steps from 2 s by 1 s."""
    flags = np.zeros((max(1, len(steps)), 4))
    for flag, (returned, time) in zip(flags, steps, strict=False):
        flag.view(np.uint8)[16], flag[3] = returned, time
    rows = np.array([[flags.ctypes.data + 32 * i, bits(1.0), 5 + i] for i in range(len(steps))], np.int64)
    state = SimpleNamespace(
        early_returns=rows.ctypes.data, early_return_count=len(steps), member=0, until=0.0, status=0
    )
    assert loop.has_returned_early(state, 2.0) == expected[0]
    assert (state.member, state.until) == expected[1:]
    assert state.status == (loop.record_layout.EARLY if expected[0] else 0)
