"""LSS slave of CiA 305: node-ID and bit rate by identity, or of the only device on the bus. Without fast scan."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.bus import Frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.device.port import Port

REQUEST, RESPONSE = 0x7E5, 0x7E4  # identifiers
SWITCH_GLOBAL, NODE_ID, BIT_TIMING, ACTIVATE, STORE = 0x04, 0x11, 0x13, 0x15, 0x17
SELECT = (0x40, 0x41, 0x42, 0x43)  # 1018h.1 to .4, one after the other
SELECTED = 0x44
INQUIRE = {0x5A: 1, 0x5B: 2, 0x5C: 3, 0x5D: 4}  # subindices of 1018h
INQUIRE_NODE = 0x5E
RATES = 9  # rows of the standard table of bit timings
OK, OUT_OF_RANGE = 0, 1
UNCONFIGURED = 255  # node-ID of a device that has none


class LssSlave:
    """Configures while it is switched on; a new node-ID acts at the next reset. The bus of a simulated drive has one rate.

    A device without a node-ID hears LSS alone. It begins (`start`) when it goes back to waiting with one.
    """

    def __init__(self, port: Port, start: Callable[[], None]) -> None:
        self.port, self.start = port, start
        self.configures = False
        self.pending = port.node
        self.matched = 0  # parts of the identity that were right so far

    def heard(self, data: bytes) -> None:
        """A request."""
        if len(data) != 8:
            return
        command, value = data[0], struct.unpack_from("<I", data, 1)[0]
        if command == SWITCH_GLOBAL:
            self.configures = data[1] == 1
            if not self.configures and self.port.node == UNCONFIGURED != self.pending:
                self.start()
        elif command in SELECT:
            self._select(SELECT.index(command), value)
        elif self.configures:
            self._configure(command, data)

    def _select(self, place: int, value: int) -> None:
        right = self.port.dictionary.get(0x1018, place + 1) == value and self.matched == place
        self.matched = place + 1 if right else 0
        if self.matched == len(SELECT):
            self.matched, self.configures = 0, True
            self._answer(SELECTED)

    def _configure(self, command: int, data: bytes) -> None:
        if command == NODE_ID:
            allowed = 1 <= data[1] <= 127
            self.pending = data[1] if allowed else self.pending
            self._answer(command, OK if allowed else OUT_OF_RANGE)
        elif command == BIT_TIMING:
            self._answer(command, OK if data[1] == 0 and data[2] < RATES else OUT_OF_RANGE)
        elif command == STORE:
            self._answer(command, OK)
        elif command in INQUIRE:
            self._answer(command, *struct.pack("<I", self.port.dictionary.get(0x1018, INQUIRE[command])))
        elif command == INQUIRE_NODE:
            self._answer(command, self.port.node)

    def _answer(self, *data: int) -> None:
        if self.port.online:
            self.port.send(Frame(RESPONSE, bytes(data).ljust(8, b"\0")))
