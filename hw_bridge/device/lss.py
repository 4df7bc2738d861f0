"""Layer setting services of CiA 305, slave side: node-ID and bit rate by identity, and the search for devices without a node-ID."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.bus import Frame
from hw_bridge.dictionary import cia301

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.device.port import Port

REQUEST, RESPONSE = 0x7E5, 0x7E4  # identifiers
SWITCH_GLOBAL, NODE_ID, BIT_TIMING, ACTIVATE, STORE = 0x04, 0x11, 0x13, 0x15, 0x17
SELECT = (0x40, 0x41, 0x42, 0x43)  # 1018h.1 to .4, one after the other
SELECTED = 0x44
IDENTIFY = (0x46, 0x47, 0x48, 0x49, 0x4A, 0x4B)  # vendor, product, revision from and to, serial number from and to
IDENTIFY_UNCONFIGURED, FASTSCAN = 0x4C, 0x51
IDENTIFIED, IDENTIFIED_UNCONFIGURED = 0x4F, 0x50
INQUIRE = {0x5A: 1, 0x5B: 2, 0x5C: 3, 0x5D: 4}  # subindices of 1018h
INQUIRE_NODE = 0x5E
RATES = (0, 1, 2, 3, 4, 6, 7, 8)  # rows of the standard table of bit timings; row 5 is reserved
OK, OUT_OF_RANGE = 0, 1
RESTART = 0x80  # of fastscan, instead of a bit number


class LssSlave:
    """LSS slave, configurable while selected; a new node-ID is effective at the next reset. The bit rate is fixed.

    A device without a node-ID processes LSS alone. It starts (`start`) when it returns to waiting with one.
    """

    def __init__(self, port: Port, start: Callable[[], None]) -> None:
        self.port, self.start = port, start
        self.configures = False
        self.pending = port.node
        self.selected_parts = 0  # of the identity, that were right so far
        self.identified_parts = 0  # of `IDENTIFY`, likewise
        self.scanned_part = 0  # of the identity, that fastscan asks for next

    @property
    def is_unconfigured(self) -> bool:
        """Whether it has no node-ID."""
        return self.port.node == cia301.UNCONFIGURED

    def process_request(self, data: bytes) -> None:
        """Process a request."""
        if len(data) != 8:
            return
        command, value = data[0], struct.unpack_from("<I", data, 1)[0]
        if command == SWITCH_GLOBAL:
            self.configures = data[1] == 1
            if not self.configures and self.is_unconfigured and self.pending != cia301.UNCONFIGURED:
                self.start()
        elif command in SELECT:
            self._select(SELECT.index(command), value)
        elif command in IDENTIFY:
            self._identify(IDENTIFY.index(command), value)
        elif command == IDENTIFY_UNCONFIGURED:
            if self.is_unconfigured:
                self._answer(IDENTIFIED_UNCONFIGURED)
        elif command == FASTSCAN:
            self._scan(value, *data[5:8])
        elif self.configures:
            self._configure(command, data)

    def _part(self, number: int) -> int:
        """1018h.1 to .4 for 0 to 3."""
        return self.port.dictionary.get(0x1018, number + 1)

    def _select(self, number: int, value: int) -> None:
        fits = self._part(number) == value and self.selected_parts == number
        self.selected_parts = number + 1 if fits else 0
        if self.selected_parts == len(SELECT):
            self.selected_parts, self.configures = 0, True
            self._answer(SELECTED)

    def _identify(self, number: int, value: int) -> None:
        part = self._part((0, 1, 2, 2, 3, 3)[number])
        fits = (part == value, part == value, value <= part, part <= value, value <= part, part <= value)[number]
        self.identified_parts = number + 1 if fits and self.identified_parts == number else 0
        if self.identified_parts == len(IDENTIFY):
            self.identified_parts = 0
            self._answer(IDENTIFIED)

    def _scan(self, value: int, bit: int, number: int, following: int) -> None:
        """Fastscan: answer if the bits from `bit` up of this part of the identity are those of `value`."""
        if not self.is_unconfigured or self.configures:
            return
        if bit == RESTART:
            self.scanned_part = 0
            self._answer(IDENTIFIED)
        elif number == self.scanned_part < len(SELECT) and bit < 32 and self._part(number) >> bit == value >> bit:
            self.scanned_part = following
            self.configures = bit == 0 and following < number  # the last part is found
            self._answer(IDENTIFIED)

    def _configure(self, command: int, data: bytes) -> None:
        if command == NODE_ID:
            allowed = 1 <= data[1] <= 127 or data[1] == cia301.UNCONFIGURED
            self.pending = data[1] if allowed else self.pending
            self._answer(command, OK if allowed else OUT_OF_RANGE)
        elif command == BIT_TIMING:
            self._answer(command, OK if data[1] == 0 and data[2] in RATES else OUT_OF_RANGE)
        elif command == STORE:
            self._answer(command, OK)
        elif command in INQUIRE:
            self._answer(command, *struct.pack("<I", self._part(INQUIRE[command] - 1)))
        elif command == INQUIRE_NODE:
            self._answer(command, self.port.node)

    def _answer(self, *data: int) -> None:
        if self.port.online:
            self.port.send(Frame(RESPONSE, bytes(data).ljust(8, b"\0")))
