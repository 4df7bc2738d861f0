"""Passive decoding of SDO transfers, also over several segments."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.dictionary import describe_abort_code

if TYPE_CHECKING:
    from hw_bridge.trace.traced_node import TracedNode

ABORT = 4
BLOCK = (5, 6)


class Transfer:
    """The current transfer of one node."""

    def __init__(self, party: TracedNode) -> None:
        self.party = party
        self.index = self.sub = 0
        self.data = b""

    def request(self, data: bytes) -> str:
        """Describe a client's request."""
        if len(data) != 8:
            return f"request of {len(data)} bytes, 8 expected"
        command = data[0] >> 5
        if command in (1, 2):
            self.index, self.sub = struct.unpack_from("<HB", data, 1)
            self.data = b""
        if command == 1:
            if not data[0] & 2:
                return f"write {self._title}, {struct.unpack_from('<I', data, 4)[0]} bytes in segments"
            self.data = expedited(data)
            return f"write {self._valued(self.data)}"
        if command == 2:
            return f"read {self._title}"
        if command == 0:
            self.data += data[1 : 8 - (data[0] >> 1 & 7)]
            return f"write {self._valued(self.data)}" if data[0] & 1 else f"segment of {self._title}"
        if command == 3:
            return f"next segment of {self._title}"
        return self._other(command, data)

    def response(self, data: bytes) -> str:
        """Describe a server's response; confirmed and uploaded values are learned."""
        if len(data) != 8:
            return f"response of {len(data)} bytes, 8 expected"
        command = data[0] >> 5
        if command in (2, 3) and struct.unpack_from("<HB", data, 1) != (self.index, self.sub):
            self.index, self.sub = struct.unpack_from("<HB", data, 1)
            self.data = b""  # the request is not in the trace
        if command == 3:
            if self.data:
                self.party.learn(self.index, self.sub, self.data)
            return f"written {self._title}"
        if command == 2:
            if not data[0] & 2:
                self.data = b""
                return f"{self._title}: {struct.unpack_from('<I', data, 4)[0]} bytes in segments"
            self.data = expedited(data)
            self.party.learn(self.index, self.sub, self.data)
            return self._valued(self.data)
        if command == 0:
            self.data += data[1 : 8 - (data[0] >> 1 & 7)]
            if not data[0] & 1:
                return f"segment of {self._title}"
            self.party.learn(self.index, self.sub, self.data)
            return self._valued(self.data)
        if command == 1:
            return f"segment of {self._title} taken"
        return self._other(command, data)

    @staticmethod
    def aborts(data: bytes) -> bool:
        """Whether this ends a transfer with an error."""
        return len(data) == 8 and data[0] >> 5 == ABORT

    def _other(self, command: int, data: bytes) -> str:
        if command == ABORT:
            self.index, self.sub = struct.unpack_from("<HB", data, 1)
            code = struct.unpack_from("<I", data, 4)[0]
            return f"abort {self._title}: {code:08X}h {describe_abort_code(code)}"
        return "block transfer, not followed" if command in BLOCK else f"unknown command {data[0]:02X}h"

    @property
    def _title(self) -> str:
        return self.party.title(self.index, self.sub)

    def _valued(self, data: bytes) -> str:
        """The object with its value."""
        return f"{self._title} = {self.party.valued(self.party.entry(self.index, self.sub), data)[0]}"


def expedited(data: bytes) -> bytes:
    """The bytes that an expedited transfer carries."""
    return data[4 : 8 - (data[0] >> 2 & 3 if data[0] & 1 else 0)]
