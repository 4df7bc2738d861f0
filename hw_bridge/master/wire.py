"""Any python-can interface as a master's network, on the monotonic clock."""

from __future__ import annotations

import gc
import os
import time
from typing import TYPE_CHECKING, Any

import can

from hw_bridge.master.network import Condition, Network, never
from hw_bridge.wire import from_message, to_message
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.frame import Frame

# python-can's slcan looks at the time only after each wait for a byte, which is 1 ms long by default
OPTIONS: dict[str, dict[str, Any]] = {"slcan": {"timeout": 0.0002}}
PRIORITY = 10  # of SCHED_FIFO: above everything ordinary, below what the kernel's own threads have


def hasten() -> bool:
    """Go before ordinary processes, where the system has that and allows it; a loop that always waits may."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError):
        return False
    return True


class WireNetwork(Network):
    """One python-can bus, heard in the thread that runs the loop: a loop that hangs tells no heartbeat."""

    wall_clock = True

    def __init__(self, interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> None:
        super().__init__()
        try:
            more = OPTIONS.get(interface, {}) | options
            self.bus = can.Bus(channel=channel, interface=interface, bitrate=bit_rate, **more)
        except (can.CanError, OSError, ValueError, ImportError, TypeError) as error:
            raise SimulationError(f"{interface} {channel}: cannot be opened: {error}. Check the adapter.") from error
        self._echoes = interface == "udp_multicast"  # what is sent comes back
        self._own: set[int] = set()  # identifiers that were sent
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
        try:
            self.bus.send(to_message(frame))
        except (can.CanError, OSError) as error:
            raise SimulationError(
                f"bus: does not take frames: {error}. Check wiring, termination and power."
            ) from error
        self._own.add(frame.id)
        self.tell(frame)

    def advance(self, until: int, done: Condition = never) -> None:
        """Hear frames until a time, or until a condition holds."""
        while True:
            left = (until - self.now) / 1e9
            try:
                message = self.bus.recv(max(left, 0.0))
            except (can.CanError, OSError) as error:
                raise SimulationError(f"bus: cannot be read: {error}. Check the adapter.") from error
            if message is not None:
                if message.is_error_frame and self.bus.state is can.BusState.ERROR:
                    raise SimulationError("bus: bus-off. Check bit rate, wiring and termination.")
                if (frame := from_message(message)) is not None:
                    if not (self._echoes and frame.id in self._own):
                        self.tell(frame)
                    self.hear(frame)
                elif message.is_error_frame:
                    self.tell(None)
            elif left <= 0.0:
                return
            if done is not never and done():
                return

    def close(self) -> None:
        """Leave the bus."""
        self.bus.shutdown()
        if self._collecting:
            gc.enable()
        if self.real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
