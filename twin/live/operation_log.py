"""operated.yaml: what happens in a session, as a scenario that does it again, readable at any time_text and at any length.

stop_time: 12.345 s             written in place: how far the loop goes next
members: ...                    one variant with one seed
events:
- {at: 1.2 s, set: {command.pressed: true}}     appended before the loop goes on
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import yaml

from twin import clock
from twin.scenario import Dumper, EventSpec

if TYPE_CHECKING:
    from collections.abc import Iterable
    from fractions import Fraction
    from pathlib import Path

    from twin.scenario import FaultSpec

NAME = "operated.yaml"
STOP_TIME_WIDTH = 32  # letters for the stop time
LINE_WIDTH = 1 << 20  # no line is broken
MAX_BYTES, MAX_VALUES = 18_000_000, 900_000  # bytes, and values: below what a scenario may have


class OperationLog:
    """The file, while it is written. What is done at a communication point is in it before the loop goes on from there."""

    def __init__(self, path: Path, head: str, stop: clock.Time) -> None:
        self.path = path
        text = f"stop_time: {time_text(stop):<{STOP_TIME_WIDTH}}\n{head}events:\n"
        path.write_text(text, encoding="utf-8")
        self._stop_time_offset = len("stop_time: ")
        self._file = os.open(path, os.O_WRONLY)
        self._end = os.lseek(self._file, 0, os.SEEK_END)
        self._waiting: list[str] = []
        self._values = text.count("\n")

    def add(self, event: EventSpec | FaultSpec) -> str:
        """What happens at the communication point that was reached; the line."""
        text = event_line(event)
        self._waiting.append(text)
        self._values += 3 + text.count(",")
        return text

    @property
    def is_full(self) -> bool:
        """Whether more than letting go would make it larger than a scenario may be."""
        return self._end > MAX_BYTES or self._values > MAX_VALUES

    def commit(self, time: clock.Time) -> None:
        """The loop goes on to a time, with all that was done before."""
        os.pwrite(self._file, f"{time_text(time):<{STOP_TIME_WIDTH}}".encode(), self._stop_time_offset)
        if self._waiting:
            data = "".join(f"{one}\n" for one in self._waiting).encode()
            self._end += os.pwrite(self._file, data, self._end)
            self._waiting.clear()

    def close(self) -> None:
        """What was done behind the last step is left out: nothing came of it."""
        os.close(self._file)


def event_lines(events: Iterable[EventSpec | FaultSpec]) -> str:
    """Events, a line each."""
    return "".join(f"{event_line(one)}\n" for one in events)


def event_line(event: EventSpec | FaultSpec) -> str:
    """An event as one line of YAML."""
    if isinstance(event, EventSpec):
        what = {event.kind: [event.variable] if event.kind == "release" else {event.variable: event.value}}
    else:
        what = {key: one for key, one in event.tree.plain().items() if key != "at"}
    items = [{"at": time_text(event.time_ns), **what}]
    text = str(
        yaml.dump(items, Dumper=Dumper, default_flow_style=True, sort_keys=False, allow_unicode=True, width=LINE_WIDTH)
    )
    return f"- {text.strip().removeprefix('[').removesuffix(']')}"


def time_text(time: clock.Time) -> str:
    """A time [ns] exactly, as a scenario takes it: `12.345 s`, `301/30 s`."""
    if not isinstance(time, int):
        return f"{to_seconds(time)} s"
    seconds, part = divmod(abs(time), clock.NANOSECONDS)
    return f"{'-' * (time < 0)}{seconds}.{part:09d}".rstrip("0").rstrip(".") + " s"


def to_seconds(time: Fraction) -> Fraction:
    """In seconds."""
    return time / clock.NANOSECONDS
