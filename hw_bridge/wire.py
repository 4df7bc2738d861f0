"""Any python-can interface as the bus of a simulated drive, paced by the wall clock."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import can

from hw_bridge.frame import Frame

if TYPE_CHECKING:
    from hw_bridge.slave.slave import Slave

PATIENCE = 0.05  # longest wait [s] before a look at the request to stop
LATE = 10_000_000  # the wall clock this far ahead counts as an overrun [ns]


def from_message(message: can.Message) -> Frame | None:
    """The frame of a python-can message; nothing for what CANopen does not use."""
    if message.is_error_frame or message.is_extended_id or message.is_fd:
        return None
    if message.is_remote_frame:
        return Frame(message.arbitration_id, remote=True, length=message.dlc)
    return Frame(message.arbitration_id, bytes(message.data))


def to_message(frame: Frame) -> can.Message:
    """The python-can message of a frame."""
    dlc = frame.length if frame.remote else len(frame.data)
    return can.Message(
        arbitration_id=frame.id, data=frame.data, dlc=dlc, is_extended_id=False, is_remote_frame=frame.remote
    )


class Wire:
    """Carries one slave on a python-can bus until `stop` is set; then it is silent and the bus still open."""

    def __init__(self, slave: Slave, bus: can.BusABC) -> None:
        self.slave, self.bus = slave, bus
        self.stop = threading.Event()
        self.overruns = 0
        self.lost = 0  # frames that the interface did not take
        slave.connect(self._send)

    def _send(self, frame: Frame) -> None:
        try:
            self.bus.send(to_message(frame))
        except can.CanError:
            self.lost += 1

    def run(self) -> None:
        """Let simulated time follow the monotonic clock."""
        slave = self.slave
        begin = time.monotonic_ns() - slave.port.agenda.now
        while not self.stop.is_set():
            now = time.monotonic_ns() - begin
            due = slave.next_time()
            self.overruns += now - due > LATE
            slave.advance(now)
            wait = (slave.next_time() - (time.monotonic_ns() - begin)) / 1e9
            message = self.bus.recv(min(max(wait, 0.0), PATIENCE))
            if message is not None and (frame := from_message(message)) is not None:
                slave.advance(max(time.monotonic_ns() - begin, slave.port.agenda.now))
                slave.receive(frame)
