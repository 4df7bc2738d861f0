"""The ring of rows and its drainer: every byte reaches the file once and in order, and an error is told to the writer."""

import errno
import os

import pytest

from twin.process.shared import HEAD, LONGEST, NOTES, RECORD, TAIL, TROUBLE, Drainer, Shared

ROW, END = 24, 96  # bytes of a row and of the ring that is used
NEXT_ROW, TICK, AT = RECORD, RECORD + 8, RECORD + 16


class Ring:
    """A writer of numbered rows beside its drainer."""

    def __init__(self, folder):
        self.shared, self.file, self.position = Shared(), folder / "rows", folder / "position"
        self.drainer = Drainer(self.shared)
        self.count = 0
        self.shared.put(NEXT_ROW, 1_000)

    @property
    def layout(self):
        return {
            "file": str(self.file),
            "position": str(self.position),
            "front": 1_000,
            "row": ROW,
            "end": END,
            "next_row": NEXT_ROW,
            "tick": TICK,
            "at": AT,
        }

    def write(self, rows):
        for _ in range(rows):
            place = (self.shared.word(NEXT_ROW) - 1_000) % END
            self.shared.memory[HEAD + place : HEAD + place + ROW] = self.row(self.count)
            self.shared.put(NEXT_ROW, 1_000 + place + ROW)
            self.count += 1

    @staticmethod
    def row(number):
        return bytes([65 + number]) * ROW

    def written(self):
        return b"".join(self.row(number) for number in range(self.count))


@pytest.fixture
def ring(tmp_path):
    made = Ring(tmp_path)
    yield made
    made.drainer.close()


@pytest.mark.parametrize("steps", [(1, 2, 1), (4,), (3, 3, 3, 3, 3), (4, 3, 1), (2, 2, 2, 2, 2, 2, 1)])
def test_rows_reach_the_file_once_and_in_order(ring, steps):
    ring.drainer.open(ring.layout)
    for rows in steps:
        ring.write(rows)
        ring.drainer.drain()
        assert ring.file.read_bytes() == ring.written()
    ring.drainer.drain()
    assert ring.file.read_bytes() == ring.written()


def test_another_drainer_goes_on_where_the_file_ends(ring):
    ring.drainer.open(ring.layout)
    ring.write(3)
    ring.drainer.drain()
    ring.drainer.close()
    ring.write(2)
    ring.shared.put(TAIL, 0)  # what the drainer had counted is lost with it
    other = Drainer(ring.shared)
    other.open(ring.layout)
    other.drain()
    other.close()
    assert ring.file.read_bytes() == ring.written()


def test_the_position_is_beside_the_rows(ring):
    ring.drainer.open(ring.layout)
    ring.shared.put(TICK, 7)
    ring.shared.put(AT, 9)
    ring.shared.note("running PI")
    ring.write(1)
    ring.drainer.drain()
    assert ring.position.read_text() == "7 9 running PI\n"


def test_nothing_is_written_before_a_file_is_open_and_after_it_is_closed(ring):
    ring.write(1)
    ring.drainer.drain()
    assert not ring.file.exists()
    ring.drainer.open(ring.layout)
    files = ring.drainer.file, ring.drainer.position
    assert min(files) > 2
    for _ in range(2):
        ring.drainer.close()
    for file in files:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(file)
    ring.drainer.drain()
    assert ring.file.read_bytes() == b""


def test_an_error_is_told_and_keeps_the_rows(ring):
    ring.drainer.open(ring.layout)
    ring.file.unlink()
    ring.write(1)
    ring.drainer.drain()
    assert ring.shared.word(TROUBLE) == errno.ENOENT
    assert ring.drainer.trouble.filename == str(ring.file)
    assert ring.shared.word(TAIL) == 0
    ring.drainer.open(ring.layout)
    assert ring.drainer.trouble is None


def test_a_file_that_cannot_be_opened(ring):
    ring.drainer.open(ring.layout | {"file": str(ring.file / "below")})
    assert ring.drainer.trouble is not None
    assert ring.shared.word(TROUBLE) == errno.ENOENT


def test_notes_are_counted_and_cut(ring):
    for text in ("a", "é" * LONGEST, "end"):
        ring.shared.note(text)
        assert ring.shared.noted.rstrip("\ufffd") == text[: (LONGEST - 1) // 2]
    assert ring.shared.word(NOTES) == 3
    ring.shared.clear()
    assert (ring.shared.noted, ring.shared.word(NOTES)) == ("", 0)
