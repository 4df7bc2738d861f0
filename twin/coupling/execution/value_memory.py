"""Memory of the values that the loop moves: addresses, views, and codes of types."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.execution import loop

if TYPE_CHECKING:
    from twin.coupling.member import MemberVariable

NEVER = 1 << 62  # communication points between two rows: no recording


@dataclass
class ValueMemory:
    """Zeroed buffer that grows by blocks, which never move; all addresses are multiples of 8 byte."""

    blocks: list[np.ndarray[Any, Any]] = field(default_factory=list)
    used: int = 0

    def take(self, size: int) -> int:
        """Allocate `size` zeroed bytes; return the address."""
        words = -(-max(size, 1) // 8)
        if not self.blocks or self.used + words > len(self.blocks[-1]):
            self.blocks.append(np.zeros(max(4096, words), np.int64))
            self.used = 0
        address = int(self.blocks[-1].ctypes.data) + 8 * self.used
        self.used += words
        return address

    def saved(self) -> list[np.ndarray[Any, Any]]:
        """Return a copy of the content."""
        return [block.copy() for block in self.blocks]

    def restore(self, saved: list[np.ndarray[Any, Any]]) -> None:
        """Restore the content that `saved` returned."""
        for block, content in zip(self.blocks, saved, strict=True):
            block[:] = content


def silent_copy(record: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a copy of the loop's record with which the loop records and reports nothing."""
    record = record.copy()
    record["every"] = record["limit"] = NEVER
    record["limit_count"] = record["condition_count"] = 0
    record["derives"] = 0  # Requests for a Jacobian would not be answered: Newton's method uses differences.
    return record


def view(address: int, variable: MemberVariable) -> np.ndarray[Any, Any]:
    """Return a flat view of a variable's values at an address."""
    raw = (ctypes.c_uint8 * (variable.size * variable.dtype.itemsize)).from_address(address)
    return np.ctypeslib.as_array(raw).view(variable.dtype)


def kind(dtype: np.dtype[Any]) -> int:
    """Return the loop's code of a type in memory."""
    return loop.KINDS[f"{dtype.kind}{dtype.itemsize}"]


def bits(value: float) -> int:
    """Return the bits of a Float64 as an integer."""
    return int(np.float64(value).view(np.int64))
