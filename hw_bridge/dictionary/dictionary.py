"""The object dictionary: what a device offers under which index, and the checks on every access."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary.abort import Abort, Code
from hw_bridge.dictionary.entry import Entry, NodeId, Value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


class Dictionary:
    """Entries with their present values.

    `checks[index](entry, value)` may abort a client's write, `effects[index](entry)` follows one; `reads[index](entry)` may
    abort a client's read.
    """

    def __init__(self, entries: Iterable[Entry], node: int) -> None:
        self.node = node
        self.objects: dict[int, dict[int, Entry]] = {}
        for entry in entries:
            self.objects.setdefault(entry.index, {})[entry.sub] = entry
        self.values: dict[tuple[int, int], Value] = {}
        self.checks: dict[int, Callable[[Entry, Value], None]] = {}
        self.effects: dict[int, Callable[[Entry], None]] = {}
        self.reads: dict[int, Callable[[Entry], None]] = {}
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
        """Set values without checks: at power-on and at a reset."""
        self.version += 1
        self.values.update(values)

    def __contains__(self, index: int) -> bool:
        return index in self.objects

    def remove(self, index: int) -> None:
        """Remove an object that a device does not have, with its values."""
        for sub in self.objects.pop(index, {}):
            self.values.pop((index, sub), None)

    def find(self, index: int, subindex: int = 0) -> Entry | None:
        """Return the entry, if there is one."""
        return self.objects.get(index, {}).get(subindex)

    def entry(self, index: int, subindex: int = 0) -> Entry:
        """Return the entry; Abort if it is missing."""
        if (entry := self.find(index, subindex)) is None:
            raise Abort(Code.NO_SUBINDEX if index in self.objects else Code.NO_OBJECT)
        return entry

    def get(self, index: int, subindex: int = 0, missing: int = 0) -> int:
        """Read a number on the device's side; `missing` if it has no such object."""
        value = self.values.get((index, subindex), missing)
        assert isinstance(value, int)
        return value

    def put(self, index: int, value: Value, subindex: int = 0) -> None:
        """Write on the device's side, without checks; no-op if it has no such object."""
        if (index, subindex) in self.values:
            self.values[index, subindex] = value

    def upload(self, index: int, subindex: int) -> bytes:
        """Read as a client."""
        entry = self.entry(index, subindex)
        if not entry.readable:
            raise Abort(Code.WRITE_ONLY)
        if check := self.reads.get(index):
            check(entry)
        return entry.encode(self.values[index, subindex])

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write as a client, with all checks."""
        entry = self.entry(index, subindex)
        self.check_writable(entry)
        self.write(entry, entry.decode(data))

    def check_writable(self, entry: Entry) -> None:
        """Abort if clients may not write the entry."""
        if not entry.writable:
            raise Abort(Code.READ_ONLY)

    def write(self, entry: Entry, value: Value) -> None:
        """Check and store a client's value, then apply it."""
        self.check(entry, value)
        self.values[entry.index, entry.sub] = value
        self.act(entry)

    def check(self, entry: Entry, value: Value) -> None:
        """Abort if the value is out of range or does not fit the state of the device."""
        entry.check(value)
        if check := self.checks.get(entry.index):
            check(entry, value)

    def act(self, entry: Entry) -> None:
        """Apply a written value."""
        self.version += 1
        if effect := self.effects.get(entry.index):
            effect(entry)
