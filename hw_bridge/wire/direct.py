"""Direct access to the sockets and serial ports that python-can has opened, without its messages.

With three drives most of a cycle was the making of messages; `python -m benchmarks.hil where` measures both.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import msgpack  # type: ignore[import-untyped]

from hw_bridge.bus import Frame
from hw_bridge.wire.adapter import HIGHEST, LONGEST
from hw_bridge.wire.link import AnyLink, Arrival, Link, age

if TYPE_CHECKING:
    import can

AT_ONCE = 4096  # bytes read from a serial port
WRITE_TIMEOUT = 0.02  # a serial port that takes no byte for so long is stalled [s]
REFUSALS = 10, 1_000_000_000  # so many refused frames within this time [ns], and none that was accepted, are a failure
REFUSED = "the adapter refuses frames (its answer is BEL): it is in bus-off, or its channel is closed"
PROMPT = 50_000  # a wait shorter than this was none [ns]
STAMP = struct.Struct("@ll")  # SO_TIMESTAMPNS: seconds, nanoseconds
FOREIGN = ("is_extended_id", "is_fd")  # what CANopen does not use
MESSAGE = {  # python-can's form of a frame in a datagram
    "timestamp": 0.0, "arbitration_id": 0, "is_extended_id": False, "is_remote_frame": False, "is_error_frame": False,
    "channel": None, "dlc": 0, "data": b"", "is_fd": False, "bitrate_switch": False, "error_state_indicator": False,
}  # fmt: skip


class UdpLink(Link):
    """Datagrams of `udp_multicast`."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        multicast = bus._multicast  # type: ignore[attr-defined]
        self._socket: socket.socket = multicast._socket
        self._group: tuple[str, int] = multicast._send_destination
        self._ancillary_size = multicast.received_ancillary_buffer_size

    def take(self, timeout: float) -> list[Arrival]:
        """All available datagrams; invalid ones are skipped."""
        arrivals = self._all()
        if arrivals or timeout <= 0.0:
            return arrivals
        begin = time.monotonic_ns()
        select.select([self._socket], [], [], timeout)
        self.idle += time.monotonic_ns() - begin
        return self._all()

    def _all(self) -> list[Arrival]:
        arrivals: list[tuple[Arrival, int]] = []  # with when it came, by the monotonic clock [ns]
        while True:
            self.looked = time.monotonic_ns()
            try:
                data, ancillary, _, _ = self._socket.recvmsg(AT_ONCE, self._ancillary_size, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return [item._replace(waited=max(self.looked - came, 0)) for item, came in arrivals]
            if (arrival := _datagram(data, ancillary)) is not None:
                arrivals.append((arrival, time.monotonic_ns() - arrival.waited))

    def put(self, frame: Frame) -> None:
        """Send as a datagram."""
        dlc = frame.length if frame.remote else len(frame.data)
        message = MESSAGE | {
            "arbitration_id": frame.id,
            "is_remote_frame": frame.remote,
            "dlc": dlc,
            "data": frame.data,
        }
        self._socket.sendto(msgpack.packb(message), self._group)


def _datagram(data: bytes, ancillary: list[tuple[int, int, bytes]]) -> Arrival | None:
    """Convert a datagram; None for what no CANopen frame can be. The age is computed last: callers note the time then."""
    try:
        message: dict[str, Any] = msgpack.unpackb(data)
        if message["is_error_frame"]:
            return Arrival(None)
        if any(message[flag] for flag in FOREIGN):
            return None
        remote, length = message["is_remote_frame"], message["dlc"]
        frame = Frame(message["arbitration_id"], b"" if remote else bytes(message["data"]), remote, length * remote)
    except (ValueError, TypeError, KeyError, msgpack.UnpackException):
        return None
    if not 0 <= frame.id <= HIGHEST or len(frame.data) > LONGEST:
        return None
    if not ancillary:
        return Arrival(frame)
    seconds, nanoseconds = STAMP.unpack(ancillary[0][2])
    return Arrival(frame, age(seconds * 1_000_000_000 + nanoseconds))


class SlcanLink(Link):
    """Lines of a serial adapter, in ASCII: python-can's reads each byte by itself and waits until all are sent.

    A serial port has no time stamps. Bytes that were available before a wait, or long after it ended, are assumed to have
    arrived evenly since the previous look: a stalled process does not take all of them for new.

    An adapter answers each frame that it is to send: CR, `z` or nothing if it accepts the frame, BEL if it does not.
    """

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self._port = bus.serialPortOrig  # type: ignore[attr-defined]
        self._partial_line = b""  # a line that is not complete
        self._refusals, self._refused_since = 0, 0  # in a row, and time of the first [ns]

    def take(self, timeout: float) -> list[Arrival]:
        """All complete lines; invalid ones are skipped."""
        port: int = self._port.fileno()
        begin = time.monotonic_ns()
        ready = select.select([port], [], [], max(timeout, 0.0))[0]
        now = time.monotonic_ns()
        self.idle += now - begin
        data = os.read(port, AT_ONCE) if ready else b""
        if ready and not data:
            raise OSError("it is gone")  # what a system says of it differs
        before, self.looked = self.looked, now if ready else begin + round(max(timeout, 0.0) * 1e9)
        *lines, self._partial_line = (self._partial_line + data).replace(b"\a", b"\a\r").split(b"\r")
        self._partial_line = self._partial_line[-AT_ONCE:]
        frames = [frame for line in lines if (frame := _line(line)) is not None]
        waited = max(now - before, 0) if not PROMPT < now - begin < timeout * 1e9 + PROMPT else 0
        arrivals = [
            Arrival(frame, waited * (len(frames) - number) // len(frames)) for number, frame in enumerate(frames)
        ]
        return [*arrivals, Arrival(None, failure=REFUSED)] if self._refuses(lines, now) else arrivals

    def _refuses(self, lines: list[bytes], now: int) -> bool:
        """Count refused frames; return whether there are too many in a row. The count begins again after that."""
        number, time_span = REFUSALS
        for line in lines:
            if line in (b"", b"z"):
                self._refusals = 0
            elif line.endswith(b"\a"):
                if now - self._refused_since > time_span:
                    self._refusals, self._refused_since = 0, now
                self._refusals += 1
        if self._refusals < number:
            return False
        self._refusals = 0
        return True

    def put(self, frame: Frame) -> None:
        """Send as a line. If the adapter is stalled, discard what it has not taken: later, its commands would be outdated."""
        if frame.remote:
            text = f"r{frame.id:03X}{frame.length:d}\r"
        else:
            text = f"t{frame.id:03X}{len(frame.data):d}{frame.data.hex().upper()}\r"
        data, port = text.encode(), self._port.fileno()
        while data:  # without pyserial: its time limit also ends a write that succeeded while this process was stalled
            if not select.select([], [port], [], WRITE_TIMEOUT)[1]:
                self._port.reset_output_buffer()
                raise OSError("it takes no bytes")
            with suppress(BlockingIOError):
                data = data[os.write(port, data) :]


def _line(line: bytes) -> Frame | None:
    """Convert a line; None for an answer of the adapter, for garbage, and for what CANopen does not use."""
    kind = line[:1]
    try:
        if kind not in (b"t", b"r"):
            return None
        digits = "0" + line[1:4].decode()
        identifier = int.from_bytes(bytes.fromhex(digits))  # int(digits, 16) would accept signs, 0x and underscores
        length = int(line[4:5])
        if identifier > HIGHEST or length > LONGEST:
            return None
        if kind == b"r":
            return Frame(identifier, remote=True, length=length)
        data = bytes.fromhex(line[5 : 5 + 2 * length].decode())
        return Frame(identifier, data) if len(data) == length else None
    except ValueError:
        pass
    return None


DIRECT: dict[str, type[UdpLink | SlcanLink]] = {"udp_multicast": UdpLink, "slcan": SlcanLink}


def link(bus: can.BusABC, interface: str) -> Link:
    """Create the fastest link to a bus."""
    if interface in DIRECT and sys.platform == "linux":
        return DIRECT[interface](bus)
    return AnyLink(bus, interface)
