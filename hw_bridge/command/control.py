"""Control channel of a running `twin drive`: fault injection by UDP on this machine, separate from the bus."""

from __future__ import annotations

import json
import socket
from dataclasses import asdict
from typing import TYPE_CHECKING

from hw_bridge.fault import Cause, Fault, inject, problem
from twin.errors import SimulationError, TwinError

if TYPE_CHECKING:
    from hw_bridge.bus import Medium
    from hw_bridge.device import Slave

HOST = "127.0.0.1"  # this machine only
LARGEST = 4096  # bytes of a request
ANSWER_TIMEOUT = 2.0  # [s]


class Control:
    """Fault injection server of one drive or module, polled between frames."""

    def __init__(self, port: int, slave: Slave, medium: Medium) -> None:
        from hw_bridge.device import Drive

        self.slave, self.medium = slave, medium
        self.profile = slave.profile if isinstance(slave, Drive) else None
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        try:
            self.socket.bind((HOST, port))
        except OSError as error:
            self.socket.close()
            raise SimulationError(f"--control {port}: {error.strerror}. Choose another port, or 0 for any.") from error
        self.port: int = self.socket.getsockname()[1]

    def look(self) -> None:
        """Execute and answer the requests since the last call."""
        while True:
            try:
                request, sender = self.socket.recvfrom(LARGEST)
            except BlockingIOError:
                return
            self.socket.sendto(self._done(request).encode(), sender)

    def _done(self, request: bytes) -> str:
        """Execute a request; return its problem, or an empty string."""
        try:
            keys = json.loads(request)
            if keys.get("identifiers") is not None:
                keys["identifiers"] = tuple(keys["identifiers"])
            fault = Fault(**{**keys, "cause": Cause(keys["cause"])})
            if text := problem(fault, self.profile, master=False):
                return f"{text}."
            inject(fault, self.medium, self.slave.node, self.slave)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, TwinError) as error:
            return f"request not understood: {error}"
        return ""

    def close(self) -> None:
        """Close the channel."""
        self.socket.close()


def request(port: int, fault: Fault) -> None:
    """Request a fault of a running drive; SimulationError if it refuses or does not answer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.settimeout(ANSWER_TIMEOUT)
        try:
            channel.connect((HOST, port))
            channel.send(json.dumps(asdict(fault)).encode())
            answer = channel.recv(LARGEST).decode()
        except OSError as error:
            raise SimulationError(
                f"--control {port}: no drive answers. Start one: twin drive ... --control {port}."
            ) from error
    if answer:
        raise SimulationError(f"--control {port}: {answer}")
