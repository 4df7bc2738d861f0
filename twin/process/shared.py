"""Memory that two processes map, and what takes rows out of it into a file.

    head    words of both, the loop's record, what the process is at
    ring    rows of fixed size: written from its front to its end, then from its front again

One writes, one takes: `place`, which the loop's record holds, is where the next row goes; `tail` is what was taken. The
file has every byte once and in order, so it can be read at any length, and its length says where to go on.
"""

from __future__ import annotations

import mmap
import os
import struct
from typing import Any

HEAD = 8192
RING = 64 << 20  # more than 0.1 s of the fastest loops [byte]; only what is used is ever touched
TAIL, NOTES, TROUBLE = 0, 8, 16  # places of words in the head
RECORD = 1024  # of the loop's record
NOTE, LONGEST = 2048, 4096  # of the text that says what the process is at, and its length
MODE = os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0)


class Shared:
    """Words, a text and a ring of rows that a process shares with those it forks."""

    def __init__(self) -> None:
        self.memory = mmap.mmap(-1, HEAD + RING)

    def word(self, offset: int) -> int:
        """The 64-bit word at a place."""
        value: int = struct.unpack_from("q", self.memory, offset)[0]
        return value

    def put(self, offset: int, value: int) -> None:
        """Store a word."""
        struct.pack_into("q", self.memory, offset, value)

    def note(self, text: str) -> None:
        """Say what this process is at; the number of notes tells that it goes on."""
        data = text.encode()[: LONGEST - 1] + b"\0"
        self.memory[NOTE : NOTE + len(data)] = data
        self.put(NOTES, self.word(NOTES) + 1)

    @property
    def noted(self) -> str:
        """What the process is at, in its own words."""
        data: bytes = self.memory[NOTE : NOTE + LONGEST]
        return data.partition(b"\0")[0].decode(errors="replace")

    def clear(self) -> None:
        """Begin anew, for the next process."""
        self.memory[:HEAD] = bytes(HEAD)


class Drainer:
    """Takes rows out of a ring into an append-only file.

    `told`: file, position (another file), front (address of the ring in the writer), row and end [byte], and the
    places of the words `place`, `tick` and `at` in the memory.
    """

    def __init__(self, shared: Shared) -> None:
        self.shared = shared
        self.layout: dict[str, Any] = {}
        self.file = self.position = -1
        self.trouble: OSError | None = None

    def open(self, layout: dict[str, Any]) -> None:
        """Begin a file, or go on with one that another drainer has begun."""
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
        """Write what is new; what cannot be written is told in the word TROUBLE and stays in the ring."""
        if self.file < 0 or self.trouble is not None:
            return
        position = self.shared.word(self.layout["place"]) - self.layout["front"]
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
        """Append the ring's bytes from the tail on."""
        ring = memoryview(self.shared.memory)
        try:
            while (tail := self.shared.word(TAIL)) < until:
                self.shared.put(TAIL, tail + os.write(self.file, ring[HEAD + tail : HEAD + until]))
        finally:
            ring.release()

    def write_position(self) -> None:
        """Say in a file of its own where the process is, for the case that nobody is left to tell."""
        text = f"{self.shared.word(self.layout['tick'])} {self.shared.word(self.layout['at'])} {self.shared.noted}\n"
        os.lseek(self.position, 0, os.SEEK_SET)
        os.write(self.position, text.encode())

    def fail(self, error: OSError) -> None:
        """Keep the first trouble, and let the writer know."""
        self.trouble = error
        self.shared.put(TROUBLE, error.errno or 5)

    def close(self) -> None:
        """Close the files. Safe to call twice."""
        for file in (self.file, self.position):
            if file >= 0:
                os.close(file)
        self.file = self.position = -1
