"""Store parameters 1010h and restore defaults 1011h, with their signatures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import Abort, Code

if TYPE_CHECKING:
    from hw_bridge.device.store import Store
    from hw_bridge.dictionary import Dictionary, Entry, Value

SAVE, LOAD = 0x65766173, 0x64616F6C  # "save" and "load" on the bus
ALL, COMMUNICATION, APPLICATION = 1, 2, 3
GROUPS = {
    ALL: range(0x1000, 0xA000),
    COMMUNICATION: range(0x1000, 0x2000),
    APPLICATION: range(0x2000, 0xA000),
}
VOLATILE = {0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF}


class Storage:
    """Non-volatile memory of a device, of this process or in a file. Restored defaults act at the next reset (CiA 301)."""

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self.store: Store | None = None
        self.saved: dict[tuple[int, int], Value] = {}
        for index, act in ((0x1010, self._store), (0x1011, self._restore)):
            dictionary.checks[index] = self._check
            dictionary.effects[index] = act

    def attach(self, store: Store) -> None:
        """Store everything in a file from now on; its present content is effective after the next reset."""
        self.saved = {key: value for key, value in store.read(self.dictionary).items() if key[0] not in VOLATILE}
        self.store = store

    def _save(self, values: dict[tuple[int, int], Value]) -> None:
        """Adopt values, once the file has them."""
        if self.store is not None:
            try:
                self.store.write(self.dictionary, values)
            except OSError:
                raise Abort(Code.HARDWARE) from None
        self.saved = values

    def _check(self, entry: Entry, value: Value) -> None:
        if value != (SAVE if entry.index == 0x1010 else LOAD):
            raise Abort(Code.CANNOT_STORE)

    def _store(self, entry: Entry) -> None:
        self.dictionary.put(entry.index, entry.default, entry.sub)  # it reads as what it can do
        group = GROUPS.get(entry.sub, GROUPS[APPLICATION])
        values = self.dictionary.values
        keys = [
            (stored.index, stored.sub)
            for stored in self.dictionary.entries()
            if stored.index in group and stored.access == "rw" and stored.index not in VOLATILE
        ]
        self._save(self.saved | {key: values[key] for key in keys})

    def _restore(self, entry: Entry) -> None:
        self.dictionary.put(entry.index, entry.default, entry.sub)
        group = GROUPS.get(entry.sub)
        if group is None:  # the vendor's pages: back to what was saved, at the next reset, which does just that
            return
        self._save({key: value for key, value in self.saved.items() if key[0] not in group})

    def load(self, application: bool) -> None:
        """Set values as after a reset: the saved ones, else the defaults; without `application` communication only."""
        group = GROUPS[ALL if application else COMMUNICATION]
        values = self.dictionary.defaults() | self.saved
        self.dictionary.restore({key: value for key, value in values.items() if key[0] in group})
