"""EMCY messages with error register 1001h and history 1003h."""

from __future__ import annotations

import struct

from hw_bridge.device.port import Port, check_identifier
from hw_bridge.dictionary import Abort, Code, Entry, NmtState, Value

DISABLED = 0x80000000  # bit 31 of 1014h
GENERIC = 0x01  # bit of 1001h that is set in any error


class Emergency:
    """EMCY producer with history."""

    def __init__(self, port: Port) -> None:
        self.port = port
        port.dictionary.checks[0x1003] = self._check
        port.dictionary.checks[0x1014] = self._check_identifier
        port.dictionary.reads[0x1003] = self._check_read

    def _check_identifier(self, _: Entry, value: Value) -> None:
        """Refuse a change of the COB-ID while it is in use."""
        assert isinstance(value, int)
        present = self.port.dictionary.get(0x1014)
        if not (value | present) & DISABLED and value != present:
            raise Abort(Code.VALUE_RANGE)
        if not value & DISABLED:
            check_identifier(value)

    def report(self, code: int, register: int, vendor: bytes = b"") -> None:
        """Send and record an error with the register after it occurred and the vendor's bytes."""
        register |= GENERIC
        self.port.dictionary.put(0x1001, register)
        self._remember(code)
        self._send(code, register, vendor)

    def clear(self, is_reported: bool = True) -> None:
        """Report the end of all errors, if they were reported."""
        self.port.dictionary.put(0x1001, 0)
        if is_reported:
            self._send(0, 0, b"")

    def _send(self, code: int, register: int, vendor: bytes) -> None:
        identifier = self.port.dictionary.get(0x1014, missing=0x80 + self.port.node)
        if self.port.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL) and not identifier & DISABLED:
            self.port.transmit(identifier & 0x7FF, struct.pack("<HB", code, register) + vendor.ljust(5, b"\0"))

    def _remember(self, code: int) -> None:
        dictionary = self.port.dictionary
        size = len(dictionary.objects[0x1003]) - 1
        for sub in range(size, 1, -1):
            dictionary.put(0x1003, dictionary.get(0x1003, sub - 1), sub)
        dictionary.put(0x1003, code, 1)
        dictionary.put(0x1003, min(dictionary.get(0x1003) + 1, size))

    def _check_read(self, entry: Entry) -> None:
        if entry.sub > self.port.dictionary.get(0x1003):
            raise Abort(Code.NO_DATA)

    def _check(self, entry: Entry, value: Value) -> None:
        if entry.sub != 0:
            raise Abort(Code.READ_ONLY)
        if value != 0:
            raise Abort(Code.VALUE_RANGE)  # only clearing is allowed
        for sub in self.port.dictionary.objects[0x1003]:
            self.port.dictionary.put(0x1003, 0, sub)
