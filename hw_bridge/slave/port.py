"""What the services of one slave share: dictionary, time, NMT state and the way out."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from hw_bridge.agenda import Agenda
from hw_bridge.frame import Frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.dictionary import Dictionary


class NmtState(IntEnum):
    """NMT states with their code in the heartbeat; the code of Initializing is that of the boot-up message."""

    INITIALIZING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


def unconnected(_frame: Frame) -> None:
    """Where frames go until a bus takes them."""


class Port:
    """Shared by the services of one slave. `online` is false in bus-off: nothing goes out, nothing comes in."""

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self.node = dictionary.node
        self.agenda = Agenda()
        self.state = NmtState.INITIALIZING
        self.online = True
        self.send: Callable[[Frame], None] = unconnected

    def transmit(self, identifier: int, data: bytes) -> None:
        """Hand a frame to the bus."""
        if self.online:
            self.send(Frame(identifier, data))
