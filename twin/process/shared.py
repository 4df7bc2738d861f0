"""Shared memory of the worker and its supervisor, and the drainer that appends its rows to a file.

    head    words of both processes, the loop's record, the current activity
    ring    rows of fixed size: written from front to end, then from the front again

One process writes, one drains: `next_row` in the loop's record is the address of the next row, `tail` the end of the drained
bytes. The file has every byte once and in order, so it can be read at any length; its length is the position to resume at.
"""

from __future__ import annotations

import mmap
import os
import struct
from typing import Any

HEAD = 8192
RING = 64 << 20  # more than 0.1 s of the fastest loops [byte]; unused pages are never touched
TAIL, NOTES, TROUBLE = 0, 8, 16  # offsets of words in the head [byte]
RECORD = 1024  # offset of the loop's record [byte]
NOTE, LONGEST = 2048, 4096  # offset and largest size of the text of the current activity [byte]
MODE = os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0)


class Shared:
    """Memory shared with forked processes: words, a text and a ring of rows."""

    def __init__(self) -> None:
        self.memory = mmap.mmap(-1, HEAD + RING)

    def word(self, offset: int) -> int:
        """Return the 64-bit word at an offset [byte]."""
        value: int = struct.unpack_from("q", self.memory, offset)[0]
        return value

    def put(self, offset: int, value: int) -> None:
        """Store a 64-bit word at an offset [byte]."""
        struct.pack_into("q", self.memory, offset, value)

    def note(self, text: str) -> None:
        """Publish the current activity of this process; the count of notes shows its progress."""
        data = text.encode()[: LONGEST - 1] + b"\0"
        self.memory[NOTE : NOTE + len(data)] = data
        self.put(NOTES, self.word(NOTES) + 1)

    @property
    def noted(self) -> str:
        """Current activity of the process."""
        data: bytes = self.memory[NOTE : NOTE + LONGEST]
        return data.partition(b"\0")[0].decode(errors="replace")

    def clear(self) -> None:
        """Reset the head for the next process."""
        self.memory[:HEAD] = bytes(HEAD)


class Drainer:
    """Moves rows from the ring to an append-only file.

    `layout`: file, position (another file), front (address of the ring in the writer), row and end [byte], and the
    offsets of the words `next_row`, `tick` and `at` in the memory.
    """

    def __init__(self, shared: Shared) -> None:
        self.shared = shared
        self.layout: dict[str, Any] = {}
        self.file = self.position = -1
        self.trouble: OSError | None = None

    def open(self, layout: dict[str, Any]) -> None:
        """Open a file, or resume one that another drainer has started."""
        self.close()
        self.layout, self.trouble = layout, None
        try:
            self.file = os.open(layout["file"], MODE | os.O_APPEND, 0o666)
            self.position = os.open(layout["position"], MODE, 0o666)
        except OSError as error:
            self.fail(error)
            return
        size, end = os.fstat(self.file).st_size, layout["end"]
        if size % end != self.shared.word(TAIL) % end:
            self.shared.put(TAIL, size % end)

    def drain(self) -> None:
        """Append the new rows; on an error the rows stay in the ring and TROUBLE holds the errno."""
        if self.file < 0 or self.trouble is not None:
            return
        position = self.shared.word(self.layout["next_row"]) - self.layout["front"]
        try:
            if os.fstat(self.file).st_nlink == 0:
                raise FileNotFoundError(2, "The folder has disappeared", self.layout["file"])
            if position < self.shared.word(TAIL):
                self.write(self.layout["end"])
                self.shared.put(TAIL, 0)
            self.write(position)
            self.write_position()
        except OSError as error:
            error.filename = self.layout["file"]
            self.fail(error)

    def write(self, until: int) -> None:
        """Append the ring's bytes from the tail to an offset."""
        ring = memoryview(self.shared.memory)
        try:
            while (tail := self.shared.word(TAIL)) < until:
                self.shared.put(TAIL, tail + os.write(self.file, ring[HEAD + tail : HEAD + until]))
        finally:
            ring.release()

    def write_position(self) -> None:
        """Write the current position to a file, for the case that all processes are killed."""
        text = f"{self.shared.word(self.layout['tick'])} {self.shared.word(self.layout['at'])} {self.shared.noted}\n"
        os.lseek(self.position, 0, os.SEEK_SET)
        os.write(self.position, text.encode())

    def fail(self, error: OSError) -> None:
        """Keep the error and publish its errno to the writer."""
        self.trouble = error
        self.shared.put(TROUBLE, error.errno or 5)

    def close(self) -> None:
        """Close the files. Safe to call twice."""
        for file in (self.file, self.position):
            if file >= 0:
                os.close(file)
        self.file = self.position = -1
