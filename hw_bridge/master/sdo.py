"""SDO client: read and write the object dictionary of a node, one request at a time."""

from __future__ import annotations

import struct
from collections import deque
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import Code, cia301, describe_abort_code
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.bus import Condition

TIMEOUT = 300 * MILLISECOND  # longest time to a response [ns]; a drive that writes flash takes that long
ATTEMPTS = 2  # a frame may be lost
MISSING = (Code.NO_OBJECT, Code.NO_SUBINDEX)  # aborts of a node that does not have the object


class SdoError(SimulationError):
    """SDO abort; `code` is the abort code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class SilentError(SimulationError):
    """SDO timeout."""


def download_request(index: int, sub: int, data: bytes) -> bytes:
    """Request of an expedited download of up to four bytes."""
    return struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub) + data.ljust(4, b"\0")


class SdoClient:
    """SDO requests of a master to one node. `wait(duration, done)` lets time pass and frames arrive."""

    def __init__(self, node: int, send: Callable[[Frame], None], wait: Callable[[int, Condition], None]) -> None:
        self.node, self.send, self.wait = node, send, wait
        self.answers: list[bytes] = []
        self.has_answered = False
        self.attempts, self.timeout = ATTEMPTS, TIMEOUT
        self.doubled = False  # whether one request had two answers: two nodes have this ID
        self.prompt = True  # whether every request was answered in time: else an answer may belong to an earlier one
        self._request = b""  # index and subindex of the present request, which was sent once
        # Index and subindex of the last requests of other programs: one may have sent several before its answers arrive.
        self._foreign_requests: deque[bytes] = deque(maxlen=8)
        self.sized = True  # whether the last answer had a size; else it has four bytes

    def process_foreign_request(self, data: bytes) -> None:
        """Process a request of another program: the node answers it with the same identifier."""
        self._foreign_requests.append(data[1:4])

    def process_frame(self, data: bytes) -> None:
        """Process a response."""
        if self._request and data[1:4] == self._request and self._request not in self._foreign_requests:
            self.doubled |= self.prompt and any(answer[1:4] == self._request for answer in self.answers)
        self.answers.append(data)
        self.has_answered = True

    def read(self, index: int, sub: int = 0, timeout: int | None = None) -> bytes:
        """The bytes of an entry."""
        answer = self._transfer(struct.pack("<BHB4x", 0x40, index, sub), index, sub, 0x40, timeout)
        self.sized = not answer[0] & 0x02 or bool(answer[0] & 0x01)
        if answer[0] & 0x02:
            return answer[4 : 8 - (answer[0] >> 2 & 3 if answer[0] & 1 else 0)]
        data, toggle = b"", 0
        while True:
            part = self._transfer(bytes([0x60 | toggle]) + bytes(7), index, sub, toggle, timeout, segment=True)
            data += part[1 : 8 - (part[0] >> 1 & 7)]
            if part[0] & 1:
                return data
            toggle ^= 0x10

    def number(self, index: int, sub: int = 0, timeout: int | None = None) -> int:
        """An unsigned number of however many bytes the node gives it."""
        return int.from_bytes(self.read(index, sub, timeout), "little")

    def write(self, index: int, sub: int, data: bytes, timeout: int | None = None) -> None:
        """Write an entry of up to four bytes; numbers have no more."""
        self._transfer(download_request(index, sub, data), index, sub, 0x60, timeout)

    def _transfer(
        self, request: bytes, index: int, sub: int, expected: int, timeout: int | None, segment: bool = False
    ) -> bytes:
        timeout = self.timeout if timeout is None else timeout
        for attempt in range(1 if segment else self.attempts):
            self.answers.clear()
            self._request = b"" if segment or attempt else request[1:4]  # a repeated one may have two answers
            self.send(Frame(cia301.SDO_REQUEST + self.node, request))
            self.wait(
                timeout, lambda: any(self._fits(response, index, sub, expected, segment) for response in self.answers)
            )
            for answer in self.answers:
                if self._fits(answer, index, sub, expected, segment):
                    return self._checked(answer, index, sub)
            self.prompt = False
        what = f": no answer on {index:04X}h.{sub}" if self.has_answered else " does not answer"
        raise SilentError(
            f"node {self.node}{what}. Check its power, the wiring, the bit rate and its node-ID; twin hil scan lists the "
            f"nodes that answer."
        )

    @staticmethod
    def _fits(answer: bytes, index: int, sub: int, expected: int, segment: bool) -> bool:
        """Whether this response answers the request; an older one may arrive late."""
        if len(answer) != 8:
            return False
        if segment and answer[0] != 0x80:
            return answer[0] & 0xF0 == expected
        named = struct.unpack_from("<HB", answer, 1) == (index, sub)
        return named and (answer[0] == 0x80 or answer[0] & 0xE0 == expected)

    def _checked(self, answer: bytes, index: int, sub: int) -> bytes:
        if answer[0] == 0x80:
            code = struct.unpack_from("<I", answer, 4)[0]
            raise SdoError(
                f"node {self.node}: {index:04X}h.{sub}: refused with {code:08X}h, {describe_abort_code(code)}.", code
            )
        return answer
