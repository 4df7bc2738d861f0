"""A CAN bus in simulated time: bit rate, arbitration, latency, errors; the same run every time."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hw_bridge.bus.disturbance import Disturbance, Kind
from hw_bridge.bus.event_queue import EventQueue
from hw_bridge.bus.frame import Frame, bit_count
from hw_bridge.bus.station import Station
from twin.errors import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Callable

BIT_RATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
ERROR_FRAME = 23  # longest error frame and the pause after it [bits]
RECOVERY = 128 * 11  # bits that a node in bus-off has to see before it returns
PASSIVE, BUS_OFF = 128, 256  # transmit error counter


@dataclass
class _Port:
    """A station with the frames it wants to send, in the order of identifier and age."""

    station: Station
    queue: list[tuple[int, int, int, Frame]] = field(default_factory=list)  # identifier, count, time, frame
    errors: int = 0
    online: bool = True


class Bus:
    """CAN bus in simulated time. `latency` [ns]: from the last bit on the wire until the software has it."""

    def __init__(self, bit_rate: int = 1_000_000, latency: int = 20_000, seed: int = 1) -> None:
        if bit_rate not in BIT_RATES:
            raise DeclarationError(f"bus: no bit rate {bit_rate}. Use one of {', '.join(map(str, BIT_RATES))}.")
        self.bit = 1_000_000_000 // bit_rate
        self.latency = latency
        self.event_queue = EventQueue()
        self.disturbances: list[Disturbance] = []
        self.observers: list[Callable[[int, Frame], None]] = []
        self.error_observers: list[Callable[[int], None]] = []  # of error frames
        self.busy_time = 0  # the wire was in use [ns]
        self.longest_wait = 0  # from the request to send until the last bit [ns]
        self._chance = random.Random(seed)  # noqa: S311 - which frames are hit, reproducibly
        self._ports: list[_Port] = []
        self._busy = False
        self._count = 0

    @property
    def now(self) -> int:
        """Time reached [ns]."""
        return self.event_queue.now

    @property
    def load(self) -> float:
        """Share of the time that the wire was in use."""
        return self.busy_time / self.now if self.now else 0.0

    def attach(self, station: Station) -> None:
        """Attach a station."""
        port = _Port(station)
        self._ports.append(port)
        station.connect(lambda frame: self._want(port, frame))

    def detach(self, station: Station) -> None:
        """Detach a station: it neither sends nor receives."""
        for port in self._ports:
            if port.station is station:
                port.online = False
        self._ports = [port for port in self._ports if port.station is not station]

    def advance(self, time: int) -> None:
        """Execute everything on the bus until `time` [ns]."""
        event_queue = self.event_queue
        while True:
            due = event_queue.next_time()
            ready: list[Station] = []  # that want to be advanced then
            for port in self._ports:
                wanted = port.station.next_time()
                if wanted < due:
                    due, ready = wanted, [port.station]
                elif wanted == due:
                    ready.append(port.station)
            if due > time:
                break
            event_queue.advance(due)
            for station in ready:
                station.advance(due)
        event_queue.advance(time)
        for port in self._ports:
            port.station.advance(time)

    def _want(self, port: _Port, frame: Frame) -> None:
        if port.online:
            self._count += 1
            port.queue.append((frame.id, self._count, self.now, frame))
            port.queue.sort()
            self.event_queue.at(self.now, self._arbitrate)

    def _arbitrate(self) -> None:
        """Let the lowest waiting identifier win."""
        waiting = [port for port in self._ports if port.queue]
        if self._busy or not waiting:
            return
        self._busy = True
        winner = min(waiting, key=lambda port: port.queue[0])
        _, _, since, frame = winner.queue[0]
        disturbance = next(
            (candidate for candidate in self.disturbances if candidate.hits(frame, self.now, self._chance)), None
        )
        if disturbance is not None and disturbance.kind is Kind.CORRUPT:
            self._occupy(bit_count(frame) + ERROR_FRAME, lambda: self._destroyed(winner))
        else:
            winner.queue.pop(0)
            self._occupy(bit_count(frame), lambda: self._sent(winner, frame, since, disturbance))

    def _occupy(self, bits: int, then: Callable[[], None]) -> None:
        self.busy_time += bits * self.bit
        self.event_queue.at(self.now + bits * self.bit, then)

    def _sent(self, sender: _Port, frame: Frame, since: int, disturbance: Disturbance | None) -> None:
        self._busy = False
        sender.errors = max(sender.errors - 1, 0)
        self.longest_wait = max(self.longest_wait, self.now - since)
        for observe in self.observers:
            observe(self.now, frame)
        delay = self.latency
        if disturbance is not None and disturbance.kind is Kind.DELAY:
            delay += disturbance.delay + round(self._chance.random() * disturbance.jitter)
        if disturbance is None or disturbance.kind is not Kind.DROP:
            self.event_queue.at(self.now + delay, lambda: self._deliver(sender, frame))
        self._arbitrate()

    def _deliver(self, sender: _Port, frame: Frame) -> None:
        for port in list(self._ports):
            if port is not sender and port.online:
                port.station.advance(self.now)
                port.station.receive(frame)

    def _destroyed(self, sender: _Port) -> None:
        """After an error frame: the sender counts 8 and repeats until it is bus-off."""
        self._busy = False
        for observe in self.error_observers:
            observe(self.now)
        before, sender.errors = sender.errors, sender.errors + 8
        if sender.errors >= BUS_OFF:
            sender.online = False
            sender.queue.clear()
            sender.station.bus_off()
            self.event_queue.at(self.now + RECOVERY * self.bit, lambda: self._recover(sender))
        elif before < PASSIVE <= sender.errors:
            sender.station.error_passive()
        self._arbitrate()

    def _recover(self, port: _Port) -> None:
        if port in self._ports:
            port.online, port.errors = True, 0
            port.station.advance(self.now)
            port.station.bus_on()
