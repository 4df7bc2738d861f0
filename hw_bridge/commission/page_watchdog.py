"""Watchdog of the browser page that commands this process: a held button, and the presence of an operator.

Renewals arrive over a socket, each with the time of the server's tick that it answers: a renewal delayed by network, browser
or server is old on arrival. They are evaluated here, in the process that commands the drive, in each of its cycles.
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
PAGE_SILENT = "the operator's page has not answered"


class PageWatchdog:
    """Page watchdog of one motion command. Times are monotonic [s].

    `over`: the operator has ended it. `expired`: the latest hold of the button ended because it was not renewed in time.
    """

    def __init__(self, end: socket.socket, now: Callable[[], float] = time.monotonic) -> None:
        self.channel, self._now = Channel(end), now
        self.dead_man = DeadManSwitch(HOLD / 1e9)
        self.renewed = now()
        self.over = self.expired = False

    def look(self) -> None:
        """Process received messages; SimulationError if no page is present any more."""
        try:
            for message in self.channel.receive(0.0):
                self._take(message)
        except ClosedError:
            raise SimulationError("the server of the page has ended: stopped.") from None
        if (silent := self._now() - self.renewed) > ATTENDED:
            raise SimulationError(f"{PAGE_SILENT} for {1e3 * silent:.0f} ms: stopped.")

    def _take(self, message: dict[str, float]) -> None:
        """Process a renewal (`here`, with `hold` and `press` for a held button), `release_hold`, or `end`."""
        if "here" in message:
            self.renewed = max(self.renewed, message["here"])
        if "hold" in message:
            at = min(max(message["hold"], -1.0), 1.0)
            self.dead_man.hold(BUTTON, at, 0.0, int(message["press"]), self._now() - message["here"], self._now())
        if "release_hold" in message:
            self.dead_man.release_hold()
        self.over = self.over or "end" in message

    def deflection(self) -> float:
        """How far the button is held, -1 to 1; 0 if it was not renewed in time."""
        self.expired |= bool(self.dead_man.expire(self._now()))
        button = self.dead_man.inputs.get(BUTTON)
        at = float(button.value) if button is not None else 0.0
        self.expired &= not at
        return at
