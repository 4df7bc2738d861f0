"""Passive station: records received frames and sends on request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus.station import PassiveStation

if TYPE_CHECKING:
    from hw_bridge.bus.frame import Frame


class Recorder(PassiveStation):
    """Passive station for scripts and tests. `received` is (time [ns], frame)."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0
        self.received: list[tuple[int, Frame]] = []

    def advance(self, time: int) -> None:
        """Advance the time."""
        self.now = time

    def receive(self, frame: Frame) -> None:
        """Record a frame."""
        self.received.append((self.now, frame))
