"""Rows on their way from the loop to a file."""

import contextlib
import ctypes
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.coupling.parts import Clock, couple
from twin.coupling import MemberVariable, Ring
from twin.coupling.execution import loop
from twin.coupling.execution.recorder import MemoryRecorder, RowLayout, decode_rows
from twin.errors import CouplingError, SimulationError
from twin.process import SupervisorChannel, shared

MS = 1_000_000


@pytest.fixture
def ring():
    """Makes rings into the file `rows` of a folder, or another; who drains them ends with the test."""
    with contextlib.ExitStack() as links:

        def made(folder, file=None):
            link = links.enter_context(contextlib.closing(SupervisorChannel()))
            return Ring(link, lambda _layout: (file or folder / "rows", folder / "position"))

        yield made


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("rows", [4, 5, 64, 1000])
def test_a_ring_gives_what_memory_gives(build, tmp_path, ring, monkeypatch, rows):
    monkeypatch.setattr(shared, "RING", 16 * rows)
    words = []
    for recorder in (None, ring(tmp_path)):
        chain = couple(build, {"clock": Clock()}, [], recorder=recorder)
        chain.initialize(0)
        chain.advance(300 * MS)
        words.append(np.array(chain.recorder.words()))
    assert np.array_equal(*words)
    assert (tmp_path / "rows").stat().st_size == 301 * 16


def test_a_row_that_does_not_fit(build, tmp_path, ring, monkeypatch):
    monkeypatch.setattr(shared, "RING", 48)
    with pytest.raises(CouplingError, match="record: 2 values in a row do not fit into 48 byte"):
        couple(build, {"clock": Clock()}, [], recorder=ring(tmp_path)).initialize(0)


def test_a_full_disk(build, tmp_path, ring):
    chain = couple(build, {"clock": Clock()}, [], recorder=ring(tmp_path, Path("/dev/full")))
    chain.initialize(0)
    with pytest.raises(SimulationError, match=r"the recording /dev/full cannot go on .No space left on device"):
        chain.advance(10**15)


def test_a_folder_that_disappears(build, tmp_path, ring):
    folder = tmp_path / "run"
    folder.mkdir()
    chain = couple(build, {"clock": Clock()}, [], recorder=ring(folder))
    chain.initialize(0)
    chain.advance(10 * MS)
    shutil.rmtree(folder)
    with pytest.raises(SimulationError, match=r"cannot go on .its folder has disappeared"):
        chain.advance(10**15)


ROW = 16  # tick and a value [byte]


class Link:
    """The drainer's side of a ring of some rows; `tails`: how far it has drained [byte], one wait after the other."""

    stopped, trouble, tail = False, None, 0

    def __init__(self, size, tails=()):
        self.record_offset, self.ring_offset = 0, loop.RECORD.itemsize
        self.shared = SimpleNamespace(memory=bytearray(self.ring_offset + size))
        self.tails, self.waits, self.notes = list(tails), 0, []

    def wait(self):
        self.waits += 1
        self.tail = self.tails.pop(0)

    def open(self, where):
        self.where = where

    def look(self):
        self.looked = True

    def sync(self):
        pass

    def note(self, text):
        self.notes.append(text)


def opened(tmp_path, rows, tails=(), restored=0, count=None, words=2):
    """A ring of some rows, of which a file has the first ones already."""
    (tmp_path / "rows").write_bytes(bytes(restored))
    ring = Ring(Link(ROW * rows + 8, tails), lambda _: (tmp_path / "rows", tmp_path / "position"))
    ring.open(RowLayout(0, 1, 1, words, [], count=count))
    return ring


def room(ring):
    """Next row and limit, in rows of the ring."""
    front = ring._front
    return tuple((int(ring.record[0][name]) - front) / ROW for name in ("next_row", "limit"))


@pytest.mark.parametrize(
    ("rows", "restored", "count", "expected"),
    [
        (8, 0, None, (0, 8)),
        (8, 3, None, (3, 8)),
        (8, 19, None, (3, 8)),  # before a checkpoint it went around
        (8, 0, 6, (0, 6)),  # no larger than needed
        (8, 0, 2, (0, 4)),
        (8, 0, 99, (0, 8)),
    ],
)
def test_a_ring_begins_where_the_file_ends(rows, restored, count, expected, tmp_path):
    ring = opened(tmp_path, rows, restored=ROW * restored, count=count)
    assert room(ring) == expected
    fields = loop.RECORD.fields
    assert ring.link.where == {
        "file": str(tmp_path / "rows"),
        "position": str(tmp_path / "position"),
        "front": ring._front,
        "row": ROW,
        "end": ROW * expected[1],
        **{name: fields[name][1] for name in ("next_row", "tick", "at")},
    }


@pytest.mark.parametrize(
    ("position", "tails", "expected", "waits"),
    [  # of 8 rows: where the loop is, how far the drainer is, next row and limit
        (8, [4], (0, 3), 1),
        (8, [0, 1, 2], (0, 1), 3),  # one row stays between them
        (8, [8], (0, 7), 1),
        (3, [3], (3, 8), 0),
        (3, [5], (3, 4), 0),
        (3, [4, 6], (3, 5), 1),
        (3, [0], (3, 8), 0),
    ],
)
def test_the_loop_may_write_up_to_the_row_before_the_drainer(position, tails, expected, waits, tmp_path):
    first = 0 if position == 8 else ROW * tails.pop(0)
    ring = opened(tmp_path, 8, [ROW * tail + 8 for tail in tails])
    ring.link.tail = first
    ring.record[0]["next_row"] = ring._front + ROW * position
    ring.make_room()
    assert (room(ring), ring.link.waits) == (expected, waits)


def test_rows_in_the_file_are_those_that_are_whole(tmp_path):
    ring = opened(tmp_path, 8)
    assert ring.words().shape == (0, 2)
    (tmp_path / "rows").write_bytes(np.arange(6).tobytes() + b"half")
    assert ring.words().tolist() == [[0, 1], [2, 3], [4, 5]]


def test_what_keeps_rows_from_being_written_is_told(tmp_path):
    ring = opened(tmp_path, 8)
    ring.link.trouble = SimpleNamespace(filename="x/rows", strerror="no space")
    with pytest.raises(SimulationError, match=r"^the recording x/rows cannot go on \(no space\)\.$"):
        ring.look()
    ring.link.stopped = True
    with pytest.raises(KeyboardInterrupt):
        ring.words()
    ring.record[0]["at"] = 5
    ring.note("close")
    assert (ring.link.notes, int(ring.record[0]["at"])) == (["close"], 0)
    with pytest.raises(CouplingError, match=r"record: 2 values in a row do not fit into 56 byte\. Use fewer\."):
        opened(tmp_path, 3)


@pytest.mark.parametrize(
    ("size", "count", "capacity"),
    [(16 * 100, None, 100), (16 * 100, 20, 20), (16, None, 16), (16, 3, 3), (16 * 100, 200, 100)],
)
def test_memory_for_rows_is_no_larger_than_needed(size, count, capacity, monkeypatch):
    recorder = MemoryRecorder(size)
    recorder.open(RowLayout(0, 1, 1, 2, [], count=count))
    state = recorder.record[0]
    assert (state["limit"] - state["next_row"]) == 16 * capacity
    assert recorder.words().shape == (0, 2)
    for block in (2, 1):
        rows = np.ctypeslib.as_array((ctypes.c_int64 * 4).from_address(int(state["next_row"]))).reshape(2, 2)
        rows[:] = [[block, 10 * block], [block + 1, 11 * block]]
        state["next_row"] += 16 * block
        recorder.make_room()
        assert (state["limit"] - state["next_row"]) == 16 * capacity
    assert recorder.words().tolist() == [[2, 20], [3, 22], [1, 10]]


def column(kind, name, code, shape=()):
    return MemberVariable(name, "output", "continuous", kind, np.dtype(code), shape)


def test_rows_are_decoded_by_the_types_of_their_columns():
    words = np.zeros((2, 9), np.int64)
    words[:, 1:3].view(np.float64)[:] = [[1.5, 2.5], [3.5, 4.5]]
    words[:, 3], words[:, 4], words[:, 5] = [-1, 7], [0, 1], [2, 0]
    words[:, 6:9] = [[-1, 0, 1], [1, 2, 3]]
    variables = [
        (column("Float32", "f", "f4", (1, 2)), 1),
        (column("Int32", "i", "i4"), 3),
        (column("Boolean", "b", "?"), 4),
        (column("Clock", "c", "i1"), 5),
        (column("UInt64", "u", "u8", (3,)), 6),
    ]
    signals = decode_rows(words, [(("m", one.name), first, one) for one, first in variables])
    assert {name: values.tolist() for name, values in signals.items()} == {
        "m.f": [[[1.5, 2.5]], [[3.5, 4.5]]],
        "m.i": [-1, 7],
        "m.b": [False, True],
        "m.c": [True, False],
        "m.u": [[2**64 - 1, 0, 1], [1, 2, 3]],
    }
