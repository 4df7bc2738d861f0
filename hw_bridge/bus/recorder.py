"""The simplest station: keeps what it hears and sends what it is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus.agenda import NEVER
from hw_bridge.bus.station import unconnected

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus.frame import Frame


class Recorder:
    """A station with no will of its own: for scripts and tests. `heard` is (time [ns], frame)."""

    def __init__(self) -> None:
        self.now = 0
        self.heard: list[tuple[int, Frame]] = []
        self.send: Callable[[Frame], None] = unconnected

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Frames go there from now on."""
        self.send = send

    def next_time(self) -> int:
        """It waits for nothing."""
        return NEVER

    def advance(self, time: int) -> None:
        """Only the time passes."""
        self.now = time

    def receive(self, frame: Frame) -> None:
        """Keep the frame."""
        self.heard.append((self.now, frame))

    def error_passive(self) -> None:
        """Of no consequence."""

    def bus_off(self) -> None:
        """Of no consequence."""

    def bus_on(self) -> None:
        """Of no consequence."""
