"""Any python-can interface as a master's network, on the monotonic clock."""

from __future__ import annotations

import time
from collections import Counter, deque
from time import sleep
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Condition, Network, never
from hw_bridge.wire.adapter import open_bus, shut_down
from hw_bridge.wire.direct import link
from hw_bridge.wire.realtime import MASTER, RealtimeScope
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Frame
    from hw_bridge.wire.link import Arrival

ALONE = 300_000  # nothing is received in this time before a frame is due: it would delay the frame [ns]
BACKLOG_TIME = 20_000_000  # longest time for receiving late frames [ns]


class WireNetwork(Network):
    """One python-can bus, received in the thread of the loop: a loop that hangs sends no heartbeat."""

    wall_clock = True

    def __init__(self, interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> None:
        super().__init__()
        self.bus = open_bus(interface, channel, bit_rate, options)
        self.link = link(self.bus, interface)
        self._echoes = interface == "udp_multicast"  # what is sent comes back
        self._sent: Counter[Frame] = Counter()  # what has not come back yet
        self._pending_notifications: deque[tuple[int, Frame | None]] = (
            deque()
        )  # for observers, as soon as no frame is due
        self._begin = time.monotonic_ns()
        self._realtime = RealtimeScope(MASTER)
        self.real_time = self._realtime.real_time

    def lock(self) -> bool:
        """Lock the memory until the bus is closed."""
        return self._realtime.lock()

    @property
    def now(self) -> int:
        """Time since the network was opened."""
        return time.monotonic_ns() - self._begin

    def send(self, frame: Frame) -> None:
        """Send a frame. Observers are notified in the next `advance`."""
        begin = time.monotonic_ns()
        self.link.send(frame)
        self.time_budget.send += time.monotonic_ns() - begin
        if self._echoes:
            self._sent[frame] += 1
        self._pending_notifications.append((self.now, frame))

    def send_at(self, frame: Frame, time: int) -> int:
        """Send as in simulated time, to some microseconds: the last wait is for the clock alone."""
        self._listen(time - ALONE, never)
        left = time - self.now
        if left > 0:
            sleep(left / 1e9)
            self.time_budget.wait += left
        now = self.now
        self.send(frame)
        return now

    def advance(self, until: int, done: Condition = never) -> None:
        """Receive frames until a time, or until a condition holds.

        Frames that arrived before that time are received too, however late, but for `BACKLOG_TIME` at most, or a bus full of
        foreign frames would block this program for ever.
        """
        self._notify_observers()
        self._listen(until, done, self._notify_observers)

    def _notify_observers(self) -> None:
        begin = time.monotonic_ns()
        while self._pending_notifications:
            self.notify(*self._pending_notifications.popleft())
        self.time_budget.decode += time.monotonic_ns() - begin

    def _listen(self, until: int, done: Condition, then: Callable[[], None] | None = None) -> None:
        """Receive frames; call `then` after those that arrived together."""
        budget, clock = self.time_budget, time.monotonic_ns
        end = max(until, self.now) + BACKLOG_TIME
        while True:
            begin, idle = clock(), self.link.idle
            left = until - (begin - self._begin)
            arrivals = self.link.hear(max(left / 1e9, 0.0))
            read = clock()
            idle = self.link.idle - idle
            for arrival in arrivals:
                self._take(arrival)
            budget.wait += idle
            budget.receive += read - begin - idle
            budget.decode += clock() - read
            if then is not None:
                then()
            if self.now > end or (not arrivals and left <= 0) or (done is not never and done()):
                return

    def _take(self, arrival: Arrival) -> None:
        if arrival.failure:
            raise SimulationError(f"bus: {arrival.failure}. Check bit rate, wiring and termination.")
        frame = arrival.frame
        if frame is None:
            self._pending_notifications.append((self.now, None))
        elif frame in self._sent:
            self._sent[frame] -= 1
            if not self._sent[frame]:
                del self._sent[frame]
        else:
            self._pending_notifications.append((self.now, frame))
            self.hear(frame)

    def close(self) -> None:
        """Leave the bus."""
        self._notify_observers()
        shut_down(self.bus)
        self._realtime.end()
