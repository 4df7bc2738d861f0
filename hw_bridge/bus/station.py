"""What is on a bus: a drive, a master, a recorder."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus.frame import Frame


def unconnected(_frame: Frame) -> None:
    """Where frames go until a bus takes them."""


class Station(Protocol):
    """Anything on the bus. All times in ns."""

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Frames go to `send` from now on."""

    def next_time(self) -> int:
        """When it wants to be advanced at the latest."""

    def advance(self, time: int) -> None:
        """Do everything that is due until `time`."""

    def receive(self, frame: Frame) -> None:
        """A frame arrived, at the time of the last advance."""

    def error_passive(self) -> None:
        """Its transmit error counter has reached 128."""

    def bus_off(self) -> None:
        """It has been disconnected after too many errors."""

    def bus_on(self) -> None:
        """It is back after bus-off."""


class Device(Station, Protocol):
    """A simulated node, as far as faults concern all of them."""

    node: int

    @property
    def now(self) -> int:
        """Time reached [ns]."""

    def restart(self) -> None:
        """Begin anew, as after the NMT command Reset node."""
