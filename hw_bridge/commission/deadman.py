"""Dead-man key of a terminal: terminals report no release, so that the key repeat is evaluated."""

from __future__ import annotations

import os
import select
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

KEYS = {
    b"\x1b[C": "right", b"\x1b[D": "left", b"\x1b[A": "up", b"\x1b[B": "down",
    b"\x1bOC": "right", b"\x1bOD": "left", b"\x1bOA": "up", b"\x1bOB": "down",
    b"q": "q", b"Q": "q", b"\x03": "quit", b"\x04": "quit", b" ": "space",
}  # fmt: skip
DIRECTIONS = {"right": 1, "up": 1, "left": -1, "down": -1}
BEGIN = 150_000_000  # a second key within this time is a key repeat [ns]; manual typing is slower
HOLD = 120_000_000  # so long after the last key the motion ends [ns]: the slowest common repeat is 90 ms (macOS)
LONG_AGO = -(10**18)


class Keyboard:
    """Key input of a terminal; `gone` when the terminal is closed."""

    def __init__(self, file: int) -> None:
        self.file = file
        self.gone = False

    @classmethod
    @contextmanager
    def open(cls) -> Iterator[Keyboard]:
        """Open the terminal unbuffered; restore it at the end. SimulationError without a terminal."""
        if find_spec("termios") is None:
            raise SimulationError("jog: this system has no POSIX terminal. Use twin hil move instead.")
        import termios
        import tty

        if not sys.stdin.isatty():
            raise SimulationError("jog: needs a terminal, whose key is held. Use twin hil move from scripts.")
        file = sys.stdin.fileno()
        before = termios.tcgetattr(file)
        try:
            tty.setcbreak(file)
            yield cls(file)
        finally:
            try:
                termios.tcflush(file, termios.TCIFLUSH)  # unread repeats are not for the shell
                termios.tcsetattr(file, termios.TCSANOW, before)  # without waiting for a reader that may be gone
            except termios.error:  # the terminal is gone
                pass

    @classmethod
    @contextmanager
    def open_if_terminal(cls) -> Iterator[Keyboard | None]:
        """The same, or None without a POSIX terminal."""
        if not sys.stdin.isatty() or find_spec("termios") is None:
            yield None
            return
        with cls.open() as keyboard:
            yield keyboard

    def pressed(self) -> list[str]:
        """Keys since the last call, in order; `quit` if the terminal is gone."""
        data = b""
        try:
            while select.select([self.file], [], [], 0)[0]:
                part = os.read(self.file, 1024)
                if not part:
                    self.gone = True
                    break
                data += part
        except OSError:  # hung up
            self.gone = True
        return [*split(data), *(["quit"] if self.gone else [])]


def split(data: bytes) -> list[str]:
    """Split terminal input into names of keys; any other key is `other`."""
    names = []
    while data:
        code = next((key for key in KEYS if data.startswith(key)), None)
        names.append(KEYS[code] if code is not None else "other")
        data = data[len(code) if code is not None else 1 :]
    return names


class DeadMan:
    """Direction of a held key: +1, -1, or 0. One key alone moves nothing; its repeat does, and any other key stops."""

    def __init__(self) -> None:
        self.direction = 0  # of the last key
        self.last = self.looked = LONG_AGO  # when it came, and time of the last look [ns]
        self.is_held = False

    def look(self, keys: list[str], now: int) -> int:
        """Return the direction, given the keys since the last call. After a stall their age is unknown: the last one counts as alone."""
        if now - self.looked > HOLD:
            self.direction, keys = 0, keys[-1:]
        self.looked = now
        for key in keys:
            direction = DIRECTIONS.get(key, 0)
            self.is_held = direction != 0 and direction == self.direction and now - self.last < BEGIN
            self.direction, self.last = direction, now
        if now - self.last > HOLD:
            self.is_held = False
        return self.direction if self.is_held else 0


class HeldKey:
    """Keyboard and dead-man of a terminal: direction in each cycle, and whether the operator has ended it."""

    def __init__(self, keyboard: Keyboard) -> None:
        self.keyboard, self.deadman = keyboard, DeadMan()
        self.over = False

    def deflection(self) -> float:
        """-1, 0 or 1."""
        pressed = self.keyboard.pressed()
        self.over = self.over or bool({"q", "quit"} & set(pressed))
        return 0.0 if self.over else float(self.deadman.look(pressed, time.monotonic_ns()))
