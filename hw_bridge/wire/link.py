"""Links to an interface: through python-can's messages, or direct ones where time matters."""

from __future__ import annotations

import errno
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import can

from hw_bridge.wire.adapter import BUS_OFF, cause, from_message, to_message
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.bus import Frame

UNREADABLE = 20, 0.05  # so many failed reads within this time [s] are the end of an interface; fewer are garbage
LONGER_QUEUE = " If the bus works, its queue is too short for the frames of a cycle: ip link set can0 txqueuelen 1000."
OLDEST = 1_000_000_000  # a frame cannot have waited longer: its time stamp is of another clock [ns]


class Arrival(NamedTuple):
    """A received frame, or an error frame where there is none.

    `waited`: its age on this machine at `Link.looked` [ns]. Not now: a process may be stalled in between.
    `failure`: why the adapter sends nothing any more, else empty.
    """

    frame: Frame | None
    waited: int = 0
    failure: str = ""


class Link(ABC):
    """Both directions of a python-can bus. Unreadable data are skipped; SimulationError where nothing can be read any more.

    `idle`: time spent waiting [ns]. `looked`: time of the last look, monotonic: frames that arrive while a process is stalled
    right after it are later [ns].
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.idle = 0
        self.looked = time.monotonic_ns()
        self._failed, self._since = 0, 0.0  # reads in a row, since when [s]

    @abstractmethod
    def take(self, timeout: float) -> list[Arrival]:
        """Return all available frames; if there are none, what arrives within `timeout` [s]."""

    @abstractmethod
    def put(self, frame: Frame) -> None:
        """Send a frame."""

    def hear(self, timeout: float) -> list[Arrival]:
        """Return what arrived, or nothing within `timeout` [s]."""
        try:
            arrivals = self.take(timeout)
        except Exception as error:  # garbage on a serial line, or what a driver meets when its adapter is unplugged
            number, time_span = UNREADABLE
            now = time.monotonic()
            if now - self._since > time_span:
                self._failed, self._since = 0, now
            self._failed += 1
            if self._failed > number:
                raise SimulationError(f"bus: cannot be read: {cause(error)}. Check the adapter.") from error
            if (flush := getattr(self.bus, "flush", None)) is not None:  # slcan would read the same bytes for ever
                with suppress(Exception):
                    flush()
            return []
        self._failed = 0
        return arrivals

    def send(self, frame: Frame) -> None:
        """Send a frame; SimulationError if the interface does not take it."""
        try:
            self.put(frame)
        except Exception as error:  # drivers of adapters raise whatever they meet, not least when one is unplugged
            full = getattr(error, "error_code", getattr(error, "errno", None)) == errno.ENOBUFS
            raise SimulationError(
                f"bus: does not take frames: {cause(error)}. Check the adapter, wiring, termination and power."
                f"{LONGER_QUEUE * full}"
            ) from error


class AnyLink(Link):
    """Link through python-can's messages, one at a time: 20 to 60 us for each, on any interface."""

    def __init__(self, bus: can.BusABC, interface: str) -> None:
        super().__init__(bus)
        self._error_classes = interface == "socketcan"

    def take(self, timeout: float) -> list[Arrival]:
        """Receive the next message."""
        begin = time.monotonic_ns()
        message = self.bus.recv(timeout)
        if message is None or timeout > 0.0:  # which part of it was waiting only the driver knows
            self.idle += time.monotonic_ns() - begin
        if message is None:
            self.looked = begin + round(max(timeout, 0.0) * 1e9)
            return []
        if message.is_error_frame:
            off = self.bus.state is can.BusState.ERROR or self._is_bus_off(message)
            return [Arrival(None, failure="bus-off" if off else "")]
        frame = from_message(message)
        waited, self.looked = age(round(message.timestamp * 1e9)), time.monotonic_ns()
        return [] if frame is None else [Arrival(frame, waited)]

    def put(self, frame: Frame) -> None:
        """Send as a message."""
        self.bus.send(to_message(frame))

    def _is_bus_off(self, message: can.Message) -> bool:
        """Whether an error frame reports bus-off: SocketCAN has no state, but classes in the identifier."""
        return self._error_classes and bool(message.arbitration_id & BUS_OFF)


def age(stamp: int) -> int:
    """Age of a wall-clock time [ns]; 0 where it is of another clock."""
    passed = time.time_ns() - stamp
    return passed if 0 < passed < OLDEST else 0
