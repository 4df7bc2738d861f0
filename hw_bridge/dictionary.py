"""The object dictionary: what a device offers under which index, and the checks on every access."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hw_bridge.abort import Abort, Code

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

Value = int | str


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

    def saturated(self, value: float) -> int:
        """The nearest number that fits."""
        low, high = self.span
        return min(max(round(value), low), high)

    @property
    def span(self) -> tuple[int, int]:
        """Smallest and largest number."""
        signed = self.name.startswith("INTEGER")
        high = (1 << (8 * self.size - signed)) - 1
        return -high - 1 if signed else 0, high


BOOL = Type("BOOLEAN", 0x01, "<B")
I8, I16, I32 = Type("INTEGER8", 0x02, "<b"), Type("INTEGER16", 0x03, "<h"), Type("INTEGER32", 0x04, "<i")
U8, U16, U32 = Type("UNSIGNED8", 0x05, "<B"), Type("UNSIGNED16", 0x06, "<H"), Type("UNSIGNED32", 0x07, "<I")
TEXT = Type("VISIBLE_STRING", 0x09, "")
TYPES = {kind.code: kind for kind in (BOOL, I8, I16, I32, U8, U16, U32, TEXT)}


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
    index: int, name: str, type_: Type, access: str, default: Value = 0, low: int | None = None,
    high: int | None = None, *, pdo: bool = False,
) -> tuple[Entry, ...]:  # fmt: skip
    """An object without subindices, as a row of a profile's table."""
    return (Entry(index, 0, name, type_, access, default, low, high, pdo),)


def sub(
    number: int, name: str, type_: Type, access: str, default: Value = 0, low: int | None = None,
    high: int | None = None, *, pdo: bool = False,
) -> Entry:  # fmt: skip
    """A subindex inside `record`."""
    return Entry(0, number, name, type_, access, default, low, high, pdo)


def record(index: int, title: str, *subs: Entry, count: str = "const") -> tuple[Entry, ...]:
    """An object with subindices; subindex 0, the highest of them, is added with access `count`."""
    rows = tuple(replace(one, index=index, title=title) for one in subs)
    if any(one.sub == 0 for one in rows):
        return rows
    return (Entry(index, 0, "Highest sub-index supported", U8, count, rows[-1].sub, title=title), *rows)


class Dictionary:
    """Entries with their present values.

    `checks[index](entry, value)` may abort a client's write, `effects[index](entry)` follows one.

    """

    def __init__(self, entries: Iterable[Entry], node: int) -> None:
        self.node = node
        self.objects: dict[int, dict[int, Entry]] = {}
        for entry in entries:
            self.objects.setdefault(entry.index, {})[entry.sub] = entry
        self.values: dict[tuple[int, int], Value] = {}
        self.checks: dict[int, Callable[[Entry, Value], None]] = {}
        self.effects: dict[int, Callable[[Entry], None]] = {}
        self.version = 0  # counts what came from outside: clients, PDOs, resets
        self.restore(self.defaults())

    def defaults(self) -> dict[tuple[int, int], Value]:
        """The values of a new device with this node-ID."""
        return {
            (e.index, e.sub): int(e.default) + self.node if isinstance(e.default, NodeId) else e.default
            for e in self.entries()
        }

    def entries(self) -> list[Entry]:
        """All entries in the order of index and subindex."""
        return [subs[number] for _, subs in sorted(self.objects.items()) for number in sorted(subs)]

    def restore(self, values: dict[tuple[int, int], Value]) -> None:
        """Take over values without checks: at power-on and at a reset."""
        self.version += 1
        self.values.update(values)

    def __contains__(self, index: int) -> bool:
        return index in self.objects

    def entry(self, index: int, subindex: int = 0) -> Entry:
        """The entry, or the abort that says what is missing."""
        found = self.objects.get(index)
        if found is None:
            raise Abort(Code.NO_OBJECT)
        if subindex not in found:
            raise Abort(Code.NO_SUBINDEX)
        return found[subindex]

    def get(self, index: int, subindex: int = 0, missing: int = 0) -> int:
        """The device's own look at a number; `missing` if it has no such object."""
        value = self.values.get((index, subindex), missing)
        assert isinstance(value, int)
        return value

    def put(self, index: int, value: Value, subindex: int = 0) -> None:
        """The device's own writing, without checks; nothing happens if it has no such object."""
        if (index, subindex) in self.values:
            self.values[index, subindex] = value

    def upload(self, index: int, subindex: int) -> bytes:
        """What a client reads."""
        entry = self.entry(index, subindex)
        if not entry.readable:
            raise Abort(Code.WRITE_ONLY)
        return entry.encode(self.values[index, subindex])

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """What a client writes, with all checks."""
        entry = self.entry(index, subindex)
        self.check_writable(entry)
        self.write(entry, entry.decode(data))

    def check_writable(self, entry: Entry) -> None:
        """Abort if clients may not write the entry."""
        if not entry.writable:
            raise Abort(Code.READ_ONLY)

    def write(self, entry: Entry, value: Value) -> None:
        """Check and take over a client's value, then let it act."""
        self.check(entry, value)
        self.values[entry.index, entry.sub] = value
        self.act(entry)

    def check(self, entry: Entry, value: Value) -> None:
        """Abort if the value is out of range or does not fit the state of the device."""
        entry.check(value)
        if check := self.checks.get(entry.index):
            check(entry, value)

    def act(self, entry: Entry) -> None:
        """Let a value that was written act."""
        self.version += 1
        if effect := self.effects.get(entry.index):
            effect(entry)
