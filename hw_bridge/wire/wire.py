"""Any python-can interface as the bus of a simulated drive, paced by the wall clock."""

from __future__ import annotations

import random
import threading
import time
from typing import TYPE_CHECKING

import can

from hw_bridge.bus import BUS_OFF, Kind
from hw_bridge.wire.link import AnyLink
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Disturbance, Frame
    from hw_bridge.device import Slave
    from hw_bridge.wire.link import Link

MAX_WAIT = 0.05  # between checks of the request to stop [s]
RECOVERY = 2_000_000  # from bus-off to the return [ns]: 128 x 11 bits at 1 Mbit/s and a little more
OVERRUN = 10_000_000  # the wall clock this far ahead counts as an overrun [ns]


def noop() -> None:
    """No-op callback."""


class Wire:
    """Connection of one slave to a python-can bus until `stop` is set; then it is silent and the bus still open.

    Disturbances hit what the slave sends and receives as on the deterministic bus. The interface itself is not disturbed:
    there a destroyed frame appears once it gets through, or never.
    """

    def __init__(self, slave: Slave, link: Link | can.BusABC) -> None:
        self.slave = slave
        self.link = AnyLink(link, "") if isinstance(link, can.BusABC) else link
        self.stop = threading.Event()
        self.overruns = 0
        self.lost = 0  # frames that the interface did not take
        self.disturbances: list[Disturbance] = []
        self.look: Callable[[], None] = noop  # called between frames
        self._errors = 0  # transmit error counter
        self._chance = random.Random(1)  # noqa: S311 - which frames are hit
        slave.connect(self._wanted)

    @property
    def now(self) -> int:
        """Time of the slave [ns]."""
        return self.slave.port.event_queue.now

    def _disturbed(self, frame: Frame) -> Disturbance | None:
        return next(
            (disturbance for disturbance in self.disturbances if disturbance.hits(frame, self.now, self._chance)), None
        )

    def _later(self, hit: Disturbance, then: Callable[[], None]) -> None:
        self.slave.port.event_queue.at(self.now + hit.delay + round(self._chance.random() * hit.jitter), then)

    def _wanted(self, frame: Frame) -> None:
        """Process a frame that the slave sends."""
        hit = self._disturbed(frame) if self.disturbances else None
        if hit is None:
            self._errors = max(self._errors - 1, 0)
            self._send(frame)
        elif hit.kind is Kind.DELAY:
            self._later(hit, lambda: self._send(frame))
        elif hit.kind is Kind.CORRUPT:
            self._destroyed(frame, hit)

    def _destroyed(self, frame: Frame, hit: Disturbance) -> None:
        """Repeat until the frame gets through or the sender is bus-off; here all of that takes no time."""
        repeated = min(hit.count + 1, (BUS_OFF - self._errors + 7) // 8)
        hit.count -= repeated - 1
        self._errors += 8 * repeated
        if self._errors < BUS_OFF:
            self._send(frame)
            return
        self._errors = 0
        self.slave.bus_off()
        self.slave.port.event_queue.at(self.now + RECOVERY, self.slave.bus_on)

    def _send(self, frame: Frame) -> None:
        try:
            self.link.send(frame)
        except SimulationError:  # an unplugged adapter is detected by reading
            self.lost += 1

    def _deliver(self, frame: Frame) -> None:
        """Pass a frame to the slave."""
        hit = self._disturbed(frame) if self.disturbances else None
        if hit is None or hit.kind is Kind.CORRUPT:
            self.slave.receive(frame)
        elif hit.kind is Kind.DELAY:
            self._later(hit, lambda: self.slave.receive(frame))

    def run(self) -> None:
        """Let simulated time follow the monotonic clock.

        A frame acts at the time when it reached this machine. Otherwise a process that the system lets wait would find its
        timeouts expired before it has read the frames of that time, which no drive does; so do frames that arrived while it
        was stalled between a look and what follows from it.
        """
        slave, is_overrun = self.slave, False
        begin = time.monotonic_ns() - slave.port.event_queue.now
        while not self.stop.is_set():
            self.look()
            wait = (slave.next_time() - (time.monotonic_ns() - begin)) / 1e9
            arrivals = self.link.hear(min(max(wait, 0.0), MAX_WAIT))
            now, before = time.monotonic_ns() - begin, is_overrun
            is_overrun = now - slave.next_time() > OVERRUN
            self.overruns += is_overrun and not before
            looked = self.link.looked - begin
            for frame, waited, _ in arrivals:
                if frame is not None:
                    slave.advance(max(looked - waited, slave.port.event_queue.now))
                    self._deliver(frame)
            if not arrivals:
                slave.advance(max(min(now, looked), slave.port.event_queue.now))
