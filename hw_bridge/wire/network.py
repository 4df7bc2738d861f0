"""Any python-can interface as a master's network, on the monotonic clock."""

from __future__ import annotations

import time
from collections import Counter, deque
from time import sleep
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Condition, Network, never
from hw_bridge.wire.adapter import left, opened
from hw_bridge.wire.direct import link
from hw_bridge.wire.haste import MASTER, Haste
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Frame
    from hw_bridge.wire.link import Arrival

ALONE = 300_000  # so long before a frame is due nothing is heard any more: it would delay the frame [ns]
PATIENCE = 20_000_000  # longest time that frames which came late are heard [ns]


class WireNetwork(Network):
    """One python-can bus, heard in the thread that runs the loop: a loop that hangs tells no heartbeat."""

    wall_clock = True

    def __init__(self, interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> None:
        super().__init__()
        self.bus = opened(interface, channel, bit_rate, options)
        self.link = link(self.bus, interface)
        self._echoes = interface == "udp_multicast"  # what is sent comes back
        self._sent: Counter[Frame] = Counter()  # what has not come back yet
        self._untold: deque[tuple[int, Frame | None]] = deque()  # for observers, as soon as no frame is due
        self._begin = time.monotonic_ns()
        self._haste = Haste(MASTER)
        self.real_time = self._haste.real_time

    def lock(self) -> bool:
        """Until the bus is closed."""
        return self._haste.lock()

    @property
    def now(self) -> int:
        """Time since the network was opened."""
        return time.monotonic_ns() - self._begin

    def send(self, frame: Frame) -> None:
        """Hand a frame to the interface. Observers hear of it in the next `advance`."""
        begin = time.monotonic_ns()
        self.link.send(frame)
        self.spent.send += time.monotonic_ns() - begin
        if self._echoes:
            self._sent[frame] += 1
        self._untold.append((self.now, frame))

    def send_at(self, frame: Frame, time: int) -> int:
        """The same as in simulated time, to some microseconds: the last wait is for the clock alone."""
        self._listen(time - ALONE, never)
        left = time - self.now
        if left > 0:
            sleep(left / 1e9)
            self.spent.wait += left
        now = self.now
        self.send(frame)
        return now

    def advance(self, until: int, done: Condition = never) -> None:
        """Hear frames until a time, or until a condition holds.

        What came before that time is heard too, however late it is: but not for longer than `PATIENCE`, or a bus full of
        foreign frames would keep this program for ever.
        """
        self._tell_observers()
        self._listen(until, done, self._tell_observers)

    def _tell_observers(self) -> None:
        begin = time.monotonic_ns()
        while self._untold:
            self.tell(*self._untold.popleft())
        self.spent.decode += time.monotonic_ns() - begin

    def _listen(self, until: int, done: Condition, then: Callable[[], None] | None = None) -> None:
        """Hear frames; `then` after those that came together."""
        spent, clock = self.spent, time.monotonic_ns
        end = max(until, self.now) + PATIENCE
        while True:
            begin, idle = clock(), self.link.idle
            left = until - (begin - self._begin)
            arrivals = self.link.hear(max(left / 1e9, 0.0))
            read = clock()
            idle = self.link.idle - idle
            for arrival in arrivals:
                self._take(arrival)
            spent.wait += idle
            spent.receive += read - begin - idle
            spent.decode += clock() - read
            if then is not None:
                then()
            if self.now > end or (not arrivals and left <= 0) or (done is not never and done()):
                return

    def _take(self, arrival: Arrival) -> None:
        if arrival.bus_off:
            raise SimulationError("bus: bus-off. Check bit rate, wiring and termination.")
        frame = arrival.frame
        if frame is None:
            self._untold.append((self.now, None))
        elif frame in self._sent:
            self._sent[frame] -= 1
            if not self._sent[frame]:
                del self._sent[frame]
        else:
            self._untold.append((self.now, frame))
            self.hear(frame)

    def close(self) -> None:
        """Leave the bus."""
        self._tell_observers()
        left(self.bus)
        self._haste.end()
