"""Any python-can interface as the bus of a simulated drive, paced by the wall clock."""

from __future__ import annotations

import logging
import os
import random
import threading
import time
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import can

from hw_bridge.bus import BUS_OFF, Kind
from hw_bridge.frame import Frame
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Disturbance
    from hw_bridge.slave.slave import Slave

PATIENCE = 0.05  # longest wait [s] before a look at the request to stop
RECOVERY = 2_000_000  # from bus-off to the return [ns]: 128 x 11 bits at 1 Mbit/s and a little more
LATE = 10_000_000  # the wall clock this far ahead counts as an overrun [ns]
OLDEST = 1.0  # a frame cannot have waited longer for this process: its time stamp is of another clock [s]
# python-can's slcan looks at the time only after each wait for a byte, which is 1 ms long by default
OPTIONS: dict[str, dict[str, Any]] = {"slcan": {"timeout": 0.0002}}
HIGHEST, LONGEST = 0x7FF, 8  # identifier of CAN 2.0A, bytes of a frame
UNREADABLE = 20, 0.05  # so many failed reads within this time [s] are the end of an interface; fewer are garbage
PRIORITY = 10  # of SCHED_FIFO: above everything ordinary, below what the kernel's own threads have


def hasten() -> bool:
    """Go before ordinary processes, where the system has that and allows it; a loop that always waits may."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError):
        return False
    return True


def opened(interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> can.BusABC:
    """A python-can bus; SimulationError in one line if it cannot be opened."""
    logging.getLogger("can").setLevel(logging.ERROR)  # what a half-opened bus says besides its error
    try:
        bus = can.Bus(**{**OPTIONS.get(interface, {}), **options, "channel": channel, "interface": interface,
                         "bitrate": bit_rate})  # fmt: skip
    except Exception as error:  # drivers of adapters raise whatever they meet
        what = " ".join(str(error).split()).rstrip(".!") or type(error).__name__
        raise SimulationError(
            f"{interface} {channel}: cannot be opened: {what}. Check the interface's name, its driver and the adapter."
        ) from error
    if interface == "slcan":
        bus.serialPortOrig = Gulps(bus.serialPortOrig)  # type: ignore[attr-defined]
    return bus


def from_message(message: can.Message) -> Frame | None:
    """The frame of a python-can message; nothing for what CANopen does not use, or what no CAN frame can be."""
    if message.is_error_frame or message.is_extended_id or message.is_fd:
        return None
    if message.arbitration_id > HIGHEST or len(message.data) > LONGEST:  # of a serial line that garbles
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


class Gulps:
    """A serial port that is asked for single bytes and reads all that there are.

    python-can's slcan wants each byte by itself: with a system call for each, three drives fill a cycle of 5 ms.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self.bytes: deque[int] = deque()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.port, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("port", "bytes"):
            super().__setattr__(name, value)
        else:
            setattr(self.port, name, value)

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        return len(self.bytes) or self.port.in_waiting

    def read(self, _size: int = 1) -> bytes:
        """The next byte, or none within the port's timeout."""
        if not self.bytes:
            self.bytes.extend(self.port.read(max(self.port.in_waiting, 1)))
        return bytes((self.bytes.popleft(),)) if self.bytes else b""

    def reset_input_buffer(self) -> None:
        """Forget what was not read."""
        self.bytes.clear()
        self.port.reset_input_buffer()


class Ear:
    """Hears a python-can bus. What cannot be read is passed over; SimulationError where nothing can any more."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.failed, self.since = 0, 0.0  # reads in a row, since when [s]

    def message(self, timeout: float) -> can.Message | None:
        """What comes next, or nothing within `timeout` [s]."""
        try:
            message = self.bus.recv(timeout)
        except (can.CanError, OSError, ValueError, IndexError) as error:
            number, time_span = UNREADABLE
            now = time.monotonic()
            if now - self.since > time_span:
                self.failed, self.since = 0, now
            self.failed += 1
            if self.failed > number:
                raise SimulationError(f"bus: cannot be read: {error}. Check the adapter.") from error
            if (flush := getattr(self.bus, "flush", None)) is not None:  # slcan would read the same bytes for ever
                with suppress(can.CanError, OSError):
                    flush()
            return None
        self.failed = 0
        return message


def nothing() -> None:
    """Nobody looks."""


class Wire:
    """Carries one slave on a python-can bus until `stop` is set; then it is silent and the bus still open.

    Disturbances hit what the slave sends and hears as on the deterministic bus. The interface itself is not disturbed:
    there a destroyed frame is seen once it gets through, or never.
    """

    def __init__(self, slave: Slave, bus: can.BusABC) -> None:
        self.slave, self.bus, self.ear = slave, bus, Ear(bus)
        self.stop = threading.Event()
        self.overruns = 0
        self.lost = 0  # frames that the interface did not take
        self.disturbances: list[Disturbance] = []
        self.look: Callable[[], None] = nothing  # called between frames
        self._errors = 0  # transmit error counter
        self._chance = random.Random(1)  # noqa: S311 - which frames are hit
        slave.connect(self._wanted)

    @property
    def now(self) -> int:
        """Time of the slave [ns]."""
        return self.slave.port.agenda.now

    def _disturbed(self, frame: Frame) -> Disturbance | None:
        return next((one for one in self.disturbances if one.hits(frame, self.now, self._chance)), None)

    def _later(self, hit: Disturbance, then: Callable[[], None]) -> None:
        self.slave.port.agenda.at(self.now + hit.delay + round(self._chance.random() * hit.jitter), then)

    def _wanted(self, frame: Frame) -> None:
        """The slave sends a frame."""
        hit = self._disturbed(frame) if self.disturbances else None
        if hit is None:
            self._errors = max(self._errors - 1, 0)
            self._send(frame)
        elif hit.kind is Kind.DELAY:
            self._later(hit, lambda: self._send(frame))
        elif hit.kind is Kind.CORRUPT:
            self._destroyed(frame, hit)

    def _destroyed(self, frame: Frame, hit: Disturbance) -> None:
        """The sender repeats until it gets through or is bus-off; here all of that takes no time."""
        repeated = min(hit.count + 1, (BUS_OFF - self._errors + 7) // 8)
        hit.count -= repeated - 1
        self._errors += 8 * repeated
        if self._errors < BUS_OFF:
            self._send(frame)
            return
        self._errors = 0
        self.slave.bus_off()
        self.slave.port.agenda.at(self.now + RECOVERY, self.slave.bus_on)

    def _send(self, frame: Frame) -> None:
        try:
            self.bus.send(to_message(frame))
        except (can.CanError, OSError):
            self.lost += 1

    def _heard(self, frame: Frame) -> None:
        """A frame for the slave."""
        hit = self._disturbed(frame) if self.disturbances else None
        if hit is None or hit.kind is Kind.CORRUPT:
            self.slave.receive(frame)
        elif hit.kind is Kind.DELAY:
            self._later(hit, lambda: self.slave.receive(frame))

    def run(self) -> None:
        """Let simulated time follow the monotonic clock.

        A frame acts at the time when it reached this machine. A process that the system lets wait would else find its
        timeouts expired before it has read what came in the meantime, which no drive does.
        """
        slave, late = self.slave, False
        begin = time.monotonic_ns() - slave.port.agenda.now
        while not self.stop.is_set():
            self.look()
            wait = (slave.next_time() - (time.monotonic_ns() - begin)) / 1e9
            message = self.ear.message(min(max(wait, 0.0), PATIENCE))
            now, before = time.monotonic_ns() - begin, late
            late = now - slave.next_time() > LATE
            self.overruns += late and not before
            frame = from_message(message) if message is not None else None
            if message is None or frame is None:
                slave.advance(now)
            else:
                slave.advance(max(now - waited(message), slave.port.agenda.now))
                self._heard(frame)


def waited(message: can.Message) -> int:
    """How long a frame has been on this machine [ns]; 0 where its interface tells the time of another clock."""
    age = time.time() - message.timestamp
    return round(age * 1e9) if 0.0 < age < OLDEST else 0
