"""operated.yaml: a scenario that repeats all commands of a session, valid at any moment.

stop_time: 12.345 s             updated in place: the time to which the loop advances next
members: ...                    one variant with one seed
events:
- {at: 1.2 s, set: {command.pressed: true}}     appended before the loop advances
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import yaml

from twin import clock
from twin.scenario import Dumper, EventSpec, FaultSpec

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from twin.scenario import ConditionSpec

NAME = "operated.yaml"
STOP_TIME_WIDTH = 32  # characters for the stop time
LINE_WIDTH = 1 << 20  # no line is wrapped
MAX_BYTES, MAX_VALUES = 18_000_000, 900_000  # below the limits of a scenario file


class OperationLog:
    """Writer of operated.yaml. Commands at a communication point are in the file before the loop advances."""

    def __init__(self, path: Path, head: str, stop: clock.Time) -> None:
        self.path = path
        text = f"stop_time: {time_text(stop):<{STOP_TIME_WIDTH}}\n{head}events:\n"
        path.write_text(text, encoding="utf-8")
        self._stop_time_offset = len("stop_time: ")
        self._file = os.open(path, os.O_WRONLY)
        self._end = os.lseek(self._file, 0, os.SEEK_END)
        self._waiting: list[str] = []
        self._values = text.count("\n")

    def add(self, event: EventSpec | FaultSpec | ConditionSpec) -> str:
        """Add an event at the current communication point, or one with a condition; return its line."""
        text = event_line(event)
        self._waiting.append(text)
        self._values += 3 + text.count(",")
        return text

    @property
    def is_full(self) -> bool:
        """Whether the file, apart from released holds, would exceed the limits of a scenario."""
        return self._end > MAX_BYTES or self._values > MAX_VALUES

    def commit(self, time: clock.Time) -> None:
        """Write the queued events, and the time to which the loop advances."""
        os.pwrite(self._file, f"{time_text(time):<{STOP_TIME_WIDTH}}".encode(), self._stop_time_offset)
        if self._waiting:
            data = "".join(f"{line}\n" for line in self._waiting).encode()
            self._end += os.pwrite(self._file, data, self._end)
            self._waiting.clear()

    def close(self) -> None:
        """Close the file without the queued events: they had no effect."""
        os.close(self._file)


def event_lines(events: Iterable[EventSpec | FaultSpec | ConditionSpec]) -> str:
    """Return events as lines of YAML."""
    return "".join(f"{event_line(event)}\n" for event in events)


def event_line(event: EventSpec | FaultSpec | ConditionSpec) -> str:
    """Return an event as one line of YAML."""
    if isinstance(event, EventSpec):
        what = {event.kind: [event.variable] if event.kind == "release" else {event.variable: event.value}}
        items = [{"at": time_text(event.time_ns), **what}]
    elif isinstance(event, FaultSpec):
        what = {key: value for key, value in event.tree.plain().items() if key != "at"}
        items = [{"at": time_text(event.time_ns), **what}]
    else:
        items = [event.tree.plain()]
    text = str(
        yaml.dump(items, Dumper=Dumper, default_flow_style=True, sort_keys=False, allow_unicode=True, width=LINE_WIDTH)
    )
    return f"- {text.strip().removeprefix('[').removesuffix(']')}"


def time_text(time: clock.Time) -> str:
    """Return a time [ns] as exact text of a scenario: `12.345 s`, `301/30 s`."""
    if not isinstance(time, int):
        return f"{time / clock.NANOSECONDS} s"
    seconds, part = divmod(abs(time), clock.NANOSECONDS)
    return f"{'-' * (time < 0)}{seconds}.{part:09d}".rstrip("0").rstrip(".") + " s"
