"""Passive station: records received frames and sends on request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus.event_queue import NEVER
from hw_bridge.bus.station import unconnected

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus.frame import Frame


class Recorder:
    """Passive station for scripts and tests. `received` is (time [ns], frame)."""

    def __init__(self) -> None:
        self.now = 0
        self.received: list[tuple[int, Frame]] = []
        self.send: Callable[[Frame], None] = unconnected

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Send frames with `send` from now on."""
        self.send = send

    def next_time(self) -> int:
        """Never: it has no actions of its own."""
        return NEVER

    def advance(self, time: int) -> None:
        """Advance the time."""
        self.now = time

    def receive(self, frame: Frame) -> None:
        """Record a frame."""
        self.received.append((self.now, frame))

    def error_passive(self) -> None:
        """No-op."""

    def bus_off(self) -> None:
        """No-op."""

    def bus_on(self) -> None:
        """No-op."""
