"""A page that watches what this process moves: its button that is held, and that somebody is there at all.

Renewals come over a socket, each with the time of the server's tick that it answers: what a network, a browser or a server
kept back is old when it comes. They are judged here, in the process that commands the drive, at each of its cycles.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from hw_bridge.commission.deadman import HOLD
from twin.errors import SimulationError
from twin.live import Channel, ClosedError, DeadManSwitch

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

ATTENDED = (
    0.5  # what moves without a held button ends so long after the last renewal [s]; estimate: fifteen are lost then
)
BUTTON = "button"


class Attendance:
    """The end of whoever moves. `over`: the person has ended it. Times are those of the monotonic clock [s]."""

    def __init__(self, end: socket.socket, now: Callable[[], float] = time.monotonic) -> None:
        self.channel, self._now = Channel(end), now
        self.hands = DeadManSwitch(HOLD / 1e9)
        self.renewed = now()
        self.over = False

    def look(self) -> None:
        """Take what came; SimulationError where nobody watches any more."""
        try:
            for message in self.channel.receive(0.0):
                self._take(message)
        except ClosedError:
            raise SimulationError("the server of the page is gone. It stops.") from None
        if (silent := self._now() - self.renewed) > ATTENDED:
            raise SimulationError(f"no page has shown it for {1e3 * silent:.0f} ms. It stops.")

    def _take(self, message: dict[str, float]) -> None:
        """A renewal (`here`, with `hold` and `press` where a button is held), `release_hold`, or `end`."""
        if "here" in message:
            self.renewed = max(self.renewed, message["here"])
        if "hold" in message:
            at = min(max(message["hold"], -1.0), 1.0)
            self.hands.hold(BUTTON, at, 0.0, int(message["press"]), self._now() - message["here"], self._now())
        if "release_hold" in message:
            self.hands.release_hold()
        self.over = self.over or "end" in message

    def way(self) -> float:
        """How far the button is held, -1 to 1; 0 where that was not renewed in time."""
        self.hands.expire(self._now())
        held = self.hands.inputs.get(BUTTON)
        return float(held.value) if held is not None else 0.0
