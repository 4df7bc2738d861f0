"""Messages of sources, from JSON or a bus, and the queue in which they arrive: each source is read by a thread of its own."""

from __future__ import annotations

import json
import math
import queue
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

from twin.errors import SimulationError

POLL = 0.1  # longest wait of a thread, after which it sees that it has to end [s]
UNITS = "units"  # object of units in a JSON message, by the names of the values


@dataclass(frozen=True)
class Message:
    """Values that a source has sent together. `arrival`: time on this machine's monotonic clock [s].

    `stamp`: time on the clock of the source [s], None if the message has none. `units`: of the values, where the source states them.
    `problem`: why the message cannot be used, else empty. `connection`: what has happened to the source's connection, else empty;
    such a message was not sent by the source.
    """

    source: str
    arrival: float
    stamp: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    problem: str = ""
    connection: str = ""


class Source(Protocol):
    """An open source. Nothing is ever sent to it."""

    def receive(self, timeout: float) -> list[Message]:
        """Return what has arrived, in order; wait up to `timeout` [s]. SimulationError if the source cannot be read any more."""

    def close(self) -> None:
        """Close it."""


def now() -> float:
    """Return the host's time, which all arrivals are measured in [s]."""
    return time.monotonic()


class Inbox:
    """Messages of several sources in the order of their arrival. Use it with `with`: the sources are closed at the end."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self.sources = sources
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._end = threading.Event()
        self._threads = [
            threading.Thread(target=self._read, args=item, name=item[0], daemon=True) for item in sources.items()
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        for thread in self._threads:
            thread.join()
        for source in self.sources.values():
            source.close()

    def _read(self, name: str, source: Source) -> None:
        while not self._end.is_set():
            try:
                for message in source.receive(POLL):
                    self._messages.put(message)
            except SimulationError as error:
                self._messages.put(Message(name, now(), problem=str(error)))
                return

    def take(self, timeout: float) -> list[Message]:
        """Return all messages that have arrived; wait up to `timeout` [s] for the first one."""
        return drained(self._messages, timeout)


def drained(messages: queue.SimpleQueue[Message], timeout: float) -> list[Message]:
    """Return all messages of a queue; wait up to `timeout` [s] for the first one."""
    taken: list[Message] = []
    try:
        taken.append(messages.get(timeout=timeout))
        while True:
            taken.append(messages.get_nowait())
    except queue.Empty:
        return taken


def parse(source: str, data: bytes, arrival: float, time_name: str) -> Message:
    """Parse a JSON object; a message with its `problem` if it is none. null is no value."""
    try:
        content = json.loads(data, parse_int=float)  # a whole number may be larger than any float
        if not isinstance(content, dict):
            return Message(source, arrival, problem="a message is no JSON object such as {'time': 1.25, 'tip': 0.1}")
        units, stamp = content.pop(UNITS, {}), content.pop(time_name, None)
        entries = list(flatten(content, ""))
    except (ValueError, RecursionError) as error:
        return Message(source, arrival, problem=f"a message is no JSON ({str(error).partition(':')[0]})")
    if stamp is not None and not (is_number(stamp) and math.isfinite(stamp)):
        return Message(source, arrival, problem=f"`{time_name}` of a message is no number of seconds")
    values: dict[str, float] = {}
    for name, value in entries:
        if is_number(value):
            values[name] = float(value)
        elif value is not None:
            return Message(source, arrival, problem=f"`{name}` of a message is no number")
    units = {name: str(text) for name, text in units.items()} if isinstance(units, dict) else {}
    return Message(source, arrival, None if stamp is None else float(stamp), values, units)


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a number; a Boolean counts as 0 or 1."""
    return isinstance(value, int | float)


def flatten(content: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the values of nested objects with their names."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
