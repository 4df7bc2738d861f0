"""JSON datagrams: one object with a time stamp and values; nested objects have names such as `arm.position`."""

from __future__ import annotations

import ipaddress
import json
import math
import select
import socket
import struct
import sys
import time
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.follow.sources.message import Message, now

if TYPE_CHECKING:
    from collections.abc import Iterator

UNITS = "units"  # object of units, by the names of the values
LARGEST = 65536  # size of a datagram [byte]
BUFFER = 1 << 22  # of the operating system, for times when the model computes [byte]
TIMESTAMP = 35  # SO_TIMESTAMPNS of Linux, which Python does not name: when the kernel has received a datagram
STAMP = struct.Struct("@ll")  # seconds and nanoseconds of the wall clock
OLDEST = 60.0  # a datagram cannot have waited longer: the wall clock was set meanwhile [s]


class UdpSource:
    """A UDP socket that receives JSON datagrams; of a multicast group if the host is one. `time_name`: of the stamp."""

    def __init__(self, name: str, host: str, port: int, time_name: str) -> None:
        self.name, self.time_name = name, time_name
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
            if sys.platform == "linux":
                self.socket.setsockopt(socket.SOL_SOCKET, TIMESTAMP, 1)
            self.socket.setblocking(False)
            if is_multicast(host):
                self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                membership = struct.pack("4sl", socket.inet_aton(host), socket.INADDR_ANY)
                self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            self.socket.bind((host, port))
        except OSError as error:
            self.socket.close()
            raise SimulationError(
                f"{name}: udp {host}:{port} cannot be received ({error.strerror or error}). Use a free port and an address of this machine."
            ) from None

    def receive(self, timeout: float) -> list[Message]:
        """Return the datagrams that have arrived."""
        messages: list[Message] = []
        select.select([self.socket], [], [], timeout)
        while True:
            try:
                data, ancillary, _, _ = self.socket.recvmsg(LARGEST, socket.CMSG_SPACE(STAMP.size))
            except BlockingIOError:
                return messages
            except OSError as error:
                raise SimulationError(f"{self.name}: cannot be read any more ({error.strerror}).") from None
            messages.append(parse(self.name, data, now() - age(ancillary), self.time_name))

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()


def age(ancillary: list[tuple[int, int, bytes]]) -> float:
    """Return how long ago the kernel has received a datagram [s]; 0 where it does not tell.

    While the model computes, a datagram waits in the socket.
    """
    for _, kind, data in ancillary:
        if kind == TIMESTAMP:
            seconds, nanoseconds = STAMP.unpack(data)
            passed = (time.time_ns() - seconds * 1_000_000_000 - nanoseconds) / 1e9
            return passed if 0.0 < passed < OLDEST else 0.0
    return 0.0


def is_multicast(host: str) -> bool:
    """Whether a host is the address of a multicast group."""
    try:
        return ipaddress.ip_address(host).is_multicast
    except ValueError:
        return False


def parse(source: str, data: bytes, arrival: float, time_name: str) -> Message:
    """Parse a datagram; a message with its `problem` if it is none. null is no value."""
    try:
        content = json.loads(data, parse_int=float)  # a whole number may be larger than any float
        if not isinstance(content, dict):
            return Message(source, arrival, problem="a datagram is no JSON object such as {'time': 1.25, 'tip': 0.1}")
        units, stamp = content.pop(UNITS, {}), content.pop(time_name, None)
        entries = list(flatten(content, ""))
    except (ValueError, RecursionError) as error:
        return Message(source, arrival, problem=f"a datagram is no JSON ({str(error).partition(':')[0]})")
    if stamp is not None and not (is_number(stamp) and math.isfinite(stamp)):
        return Message(source, arrival, problem=f"`{time_name}` of a datagram is no number of seconds")
    values: dict[str, float] = {}
    for name, value in entries:
        if is_number(value):
            values[name] = float(value)
        elif value is not None:
            return Message(source, arrival, problem=f"`{name}` of a datagram is no number")
    units = {name: str(text) for name, text in units.items()} if isinstance(units, dict) else {}
    return Message(source, arrival, None if stamp is None else float(stamp), values, units)


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a number; a Boolean counts as 0 or 1."""
    return isinstance(value, int | float)


def flatten(content: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the values of nested objects with their names."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
