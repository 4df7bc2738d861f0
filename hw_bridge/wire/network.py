"""Any python-can interface as a master's network, on the monotonic clock."""

from __future__ import annotations

import gc
import os
import time
from collections import Counter
from typing import TYPE_CHECKING, Any

import can

from hw_bridge.bus import Condition, Network, never
from hw_bridge.wire.adapter import Ear, from_message, hasten, left, opened, sent
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.bus import Frame

PATIENCE = 20_000_000  # longest time that frames which came late are heard [ns]
BUS_OFF = 0x40  # CAN_ERR_BUSOFF of linux/can/error.h


class WireNetwork(Network):
    """One python-can bus, heard in the thread that runs the loop: a loop that hangs tells no heartbeat."""

    wall_clock = True

    def __init__(self, interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> None:
        super().__init__()
        self.bus = opened(interface, channel, bit_rate, options)
        self.ear = Ear(self.bus)
        self._echoes = interface == "udp_multicast"  # what is sent comes back
        self._error_classes = interface == "socketcan"
        self._sent: Counter[Frame] = Counter()  # what has not come back yet
        self._begin = time.monotonic_ns()
        self._collecting = gc.isenabled()
        gc.disable()  # its pauses are longer than a cycle
        self.real_time = hasten()

    @property
    def now(self) -> int:
        """Time since the network was opened."""
        return time.monotonic_ns() - self._begin

    def send(self, frame: Frame) -> None:
        """Hand a frame to the interface."""
        sent(self.bus, frame)
        if self._echoes:
            self._sent[frame] += 1
        self.tell(frame)

    def advance(self, until: int, done: Condition = never) -> None:
        """Hear frames until a time, or until a condition holds.

        What came before that time is heard too, however late it is: but not for longer than `PATIENCE`, or a bus full of
        foreign frames would keep this program for ever.
        """
        end = max(until, self.now) + PATIENCE
        while True:
            left = until - self.now
            message = self.ear.message(max(left / 1e9, 0.0))
            if message is not None:
                self._take(message)
            if self.now > end or (message is None and left <= 0) or (done is not never and done()):
                return

    def _take(self, message: can.Message) -> None:
        if message.is_error_frame and (self.bus.state is can.BusState.ERROR or self._tells_bus_off(message)):
            raise SimulationError("bus: bus-off. Check bit rate, wiring and termination.")
        if (frame := from_message(message)) is not None:
            if frame in self._sent:
                self._sent[frame] -= 1
                if not self._sent[frame]:
                    del self._sent[frame]
                return
            self.tell(frame)
            self.hear(frame)
        elif message.is_error_frame:
            self.tell(None)

    def _tells_bus_off(self, message: can.Message) -> bool:
        """SocketCAN has no state, but error frames with its class in the identifier."""
        return self._error_classes and bool(message.arbitration_id & BUS_OFF)

    def close(self) -> None:
        """Leave the bus."""
        left(self.bus)
        if self._collecting:
            gc.enable()
        if self.real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
