"""One entry of an object dictionary, its data type, and the rows in which tables of them are written."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, replace

from hw_bridge.dictionary.abort import Abort, Code

Value = int | str
UNIT = re.compile(r"\s*\[([^]]*)\]")


@dataclass(frozen=True, slots=True)
class Type:
    """A data type of CiA 301; `form` is its struct format, empty for text."""

    name: str
    code: int
    form: str

    @property
    def size(self) -> int:
        """Length in bytes; 0 for text of any length."""
        return struct.calcsize(self.form) if self.form else 0

    @property
    def signed(self) -> bool:
        """Whether numbers may be below zero."""
        return self.name.startswith("INTEGER")

    def saturated(self, value: float) -> int:
        """The nearest number that fits."""
        low, high = self.span
        return min(max(round(value), low), high)

    @property
    def span(self) -> tuple[int, int]:
        """Smallest and largest number."""
        high = (1 << (8 * self.size - self.signed)) - 1
        return -high - 1 if self.signed else 0, high


BOOL = Type("BOOLEAN", 0x01, "<B")
I8, I16, I32 = Type("INTEGER8", 0x02, "<b"), Type("INTEGER16", 0x03, "<h"), Type("INTEGER32", 0x04, "<i")
U8, U16, U32 = Type("UNSIGNED8", 0x05, "<B"), Type("UNSIGNED16", 0x06, "<H"), Type("UNSIGNED32", 0x07, "<I")
U64 = Type("UNSIGNED64", 0x1B, "<Q")
TEXT, OCTETS = Type("VISIBLE_STRING", 0x09, ""), Type("OCTET_STRING", 0x0A, "")
TYPES = {kind.code: kind for kind in (BOOL, I8, I16, I32, U8, U16, U32, U64, TEXT, OCTETS)}


class NodeId(int):
    """A default to which the node-ID is added: `$NODEID+0x80` in an EDS."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry: an object without subindices, or one subindex of a record.

    `access`: const, ro, wo, rw. `low` and `high` inclusive. `title` is the name of the record it belongs to.
    """

    index: int
    sub: int
    name: str
    type: Type
    access: str
    default: Value = 0
    low: int | None = None
    high: int | None = None
    mappable: bool = False
    title: str = ""

    @property
    def label(self) -> str:
        """Name without its unit."""
        return UNIT.sub("", self.name)

    @property
    def unit(self) -> str:
        """Unit at the end of its name, such as 10 mV of `[10 mV]`, or empty."""
        match = UNIT.search(self.name)
        return match[1] if match else ""

    @property
    def readable(self) -> bool:
        """Whether a client may read it."""
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        """Whether a client may write it."""
        return self.access in ("rw", "wo")

    def encode(self, value: Value) -> bytes:
        """The value as it goes over the bus."""
        return value.encode("latin-1") if isinstance(value, str) else struct.pack(self.type.form, value)

    def decode(self, data: bytes) -> Value:
        """The value of these bytes, whose number has to fit the type."""
        if not self.type.form:
            return data.decode("latin-1")
        if len(data) != self.type.size:
            raise Abort(Code.TOO_LONG if len(data) > self.type.size else Code.TOO_SHORT)
        value: int = struct.unpack(self.type.form, data)[0]
        return value

    def check(self, value: Value) -> None:
        """Abort if the value is outside the entry's range."""
        if isinstance(value, int):
            if self.high is not None and value > self.high:
                raise Abort(Code.VALUE_TOO_HIGH)
            if self.low is not None and value < self.low:
                raise Abort(Code.VALUE_TOO_LOW)


def var(
    index: int,
    name: str,
    type_: Type,
    access: str,
    default: Value = 0,
    low: int | None = None,
    high: int | None = None,
    *,
    pdo: bool = False,
) -> tuple[Entry, ...]:
    """An object without subindices, as a row of a profile's table."""
    return (Entry(index, 0, name, type_, access, default, low, high, pdo),)


def sub(
    number: int,
    name: str,
    type_: Type,
    access: str,
    default: Value = 0,
    low: int | None = None,
    high: int | None = None,
    *,
    pdo: bool = False,
) -> Entry:
    """A subindex inside `record`."""
    return Entry(0, number, name, type_, access, default, low, high, pdo)


def record(index: int, title: str, *subs: Entry, count: str = "const") -> tuple[Entry, ...]:
    """An object with subindices; subindex 0, the highest of them, is added with access `count`."""
    rows = tuple(replace(row, index=index, title=title) for row in subs)
    if any(row.sub == 0 for row in rows):
        return rows
    return (Entry(index, 0, "Highest sub-index supported", U8, count, rows[-1].sub, title=title), *rows)
