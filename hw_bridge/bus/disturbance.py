"""Disturbances of frames in transmission."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

from hw_bridge.bus.event_queue import NEVER

if TYPE_CHECKING:
    import random

    from hw_bridge.bus.frame import Frame


class Kind(StrEnum):
    """Effect of a disturbance on a frame."""

    DROP = "drop"  # sent, but not received
    DELAY = "delay"  # delivered later
    CORRUPT = "corrupt"  # destroyed on the wire; the sender repeats it


@dataclass
class Disturbance:
    """Disturbance of frames with identifiers from `low` to `high` between two times [ns]; of these, `only` some.

    `share` of them is hit, chosen by the bus's own seed; at most `count`. `delay` [ns], and up to `jitter` more.
    """

    kind: Kind
    low: int = 0
    high: int = 0x7FF
    start: int = 0
    end: int = NEVER
    share: float = 1.0
    count: int = NEVER
    delay: int = 0
    jitter: int = 0
    only: frozenset[int] | None = None

    def hits(self, frame: Frame, now: int, chance: random.Random) -> bool:
        """Whether this frame is disturbed."""
        if not (self.low <= frame.id <= self.high and self.start <= now < self.end and self.count > 0):
            return False
        if self.only is not None and frame.id not in self.only:
            return False
        if self.share < 1.0 and chance.random() >= self.share:
            return False
        self.count -= 1
        return True


class Medium(Protocol):
    """Carrier of frames that can be disturbed: the deterministic bus, or the interface of `twin drive`."""

    disturbances: list[Disturbance]

    @property
    def now(self) -> int:
        """Time [ns]."""
