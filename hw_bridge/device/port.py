"""State shared by the services of one slave: dictionary, time, NMT state and output."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import EventQueue, Frame, unconnected
from hw_bridge.dictionary import Abort, Code, NmtState, cia301

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.dictionary import Dictionary


RESERVED = ((0, 0), (0x001, 0x07F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))


def check_identifier(value: int) -> None:
    """Abort unless a COB-ID entry has 11 bits that CiA 301 leaves free; flags are checked by the caller."""
    if value & (cia301.EXTENDED | 0x1FFFF800) or any(low <= value & 0x7FF <= high for low, high in RESERVED):
        raise Abort(Code.VALUE_RANGE)


class Port:
    """Shared state of the services of one slave. `online` is false in bus-off: nothing is sent or received."""

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self.node = dictionary.node
        self.event_queue = EventQueue()
        self.state = NmtState.INITIALIZING
        self.online = True
        self.send: Callable[[Frame], None] = unconnected

    def transmit(self, identifier: int, data: bytes) -> None:
        """Send a frame."""
        if self.online:
            self.send(Frame(identifier, data))
