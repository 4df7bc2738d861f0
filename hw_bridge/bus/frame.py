"""A CAN 2.0A data or remote frame, and how long it occupies the bus."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Frame:
    """Frame with an 11-bit identifier; `length` is the DLC of a remote frame, which carries no data."""

    id: int
    data: bytes = b""
    remote: bool = False
    length: int = 0

    def __str__(self) -> str:
        return f"{self.id:03X}#{'R' if self.remote else self.data.hex().upper()}"


def bit_count(frame: Frame) -> int:
    """Bits on the wire with the worst case of stuffing, including three bits between frames.

    34 control bits and the data may be stuffed, one bit after each four; 13 bits never are.
    """
    data = 8 * len(frame.data)
    return 34 + data + (34 + data - 1) // 4 + 13
