"""JSON messages as datagrams."""

from __future__ import annotations

import errno
import ipaddress
import select
import socket
import struct
import sys
import time

from twin.errors import SimulationError
from twin.follow.sources.messages import Message, now, parse

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
            advice = "Use a free port and an address of this machine."
            if error.errno == errno.EADDRINUSE:
                advice = "Use a free port, or for several followers of a rig a multicast group such as 239.74.163.2."
            raise SimulationError(
                f"{name}: udp {host}:{port} cannot be received ({error.strerror or error}). {advice}"
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
