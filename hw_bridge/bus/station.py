"""Interfaces of stations on a bus: a drive, a master, a recorder."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from hw_bridge.bus.event_queue import NEVER

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus.frame import Frame


def unconnected(_frame: Frame) -> None:
    """Discard frames until a bus is connected."""


class PassiveStation:
    """Station without actions of its own."""

    def __init__(self) -> None:
        self.send: Callable[[Frame], None] = unconnected

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Send frames with `send` from now on."""
        self.send = send

    def next_time(self) -> int:
        """Never: it has no actions."""
        return NEVER

    def advance(self, time: int) -> None:
        """No-op."""

    def error_passive(self) -> None:
        """No-op."""

    def bus_off(self) -> None:
        """No-op."""

    def bus_on(self) -> None:
        """No-op."""


class Station(Protocol):
    """A station on the bus. All times in ns."""

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Send frames with `send` from now on."""

    def next_time(self) -> int:
        """Latest time at which it has to be advanced."""

    def advance(self, time: int) -> None:
        """Execute everything that is due until `time`."""

    def receive(self, frame: Frame) -> None:
        """Process a frame, at the time of the last advance."""

    def error_passive(self) -> None:
        """React to a transmit error counter of 128."""

    def bus_off(self) -> None:
        """React to bus-off."""

    def bus_on(self) -> None:
        """React to recovery from bus-off."""


class Device(Station, Protocol):
    """A simulated node, as far as faults concern all of them."""

    node: int

    @property
    def now(self) -> int:
        """Time reached [ns]."""

    def restart(self) -> None:
        """Restart, as after the NMT command Reset node."""
