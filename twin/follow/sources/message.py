"""Messages of sources, and what a source is."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping


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
