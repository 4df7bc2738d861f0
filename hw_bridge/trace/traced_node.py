"""A node of a trace: its dictionary as far as known, and decoding of its values."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.dictionary import Abort, Dictionary, Entry, Mode, Value, cia301
from hw_bridge.master import PDOS, process_data
from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, device, magnetic_pitch, measure, profile
from hw_bridge.trace import names

if TYPE_CHECKING:
    from hw_bridge.hardware import NodeKeys
    from hw_bridge.profiles import Measure, Profile, Units

WORDS = {0x6040: names.controlword, 0x6041: names.statusword, 0x6060: names.mode, 0x6061: names.mode}
BITS = {0x6040: "04X", 0x6041: "04X", 0x603F: "04X", 0x1001: "02X"}
SAVE, PROFILE_AREA = 0x1010, 0x2000
STATUSWORD = 0x6041
MAPPABLE = 64  # objects of a PDO (CiA 301)


class Route(NamedTuple):
    """Mapping of a PDO."""

    title: str  # such as TPDO1
    mapped: tuple[tuple[Entry, int], ...]  # entry and bits

    @property
    def size(self) -> int:
        """Bytes."""
        return sum(bits for _, bits in self.mapped) // 8

    def statusword(self, data: bytes) -> int | None:
        """6041h in these bytes; none if it is not mapped."""
        offset = 0
        for entry, bits in self.mapped:
            if entry.index == STATUSWORD:
                return int.from_bytes(data[offset : offset + 2], "little")
            offset += bits // 8
        return None


class DecodedValue(NamedTuple):
    """Decoded value of an object: text, name, and value in SI where it has a unit."""

    text: str
    name: str
    value: float | str


@cache
def common() -> tuple[Entry, ...]:
    """Objects that a node of an unknown vendor may have: CiA 301, 401 and 402, but no PDO map."""
    entries: dict[tuple[int, int], Entry] = {}
    tables = [profile(name).objects for name in DRIVE_PROFILES] + [device(name).objects for name in DEVICES]
    for table in tables:
        for entry in table:
            standard = entry.index < 0x1400 or 0x6000 <= entry.index < 0x6800
            if standard:
                entries.setdefault((entry.index, entry.sub), entry)
    return tuple(entries.values())


class TracedNode:
    """A node of a trace. Without a profile it has names for what all drives have, and no units."""

    def __init__(
        self,
        node: int,
        chosen: Profile | None = None,
        keys: NodeKeys | None = None,
        name: str = "",
        objects: tuple[Entry, ...] = (),
    ) -> None:
        self.node, self.keys = node, keys
        self.objects = objects  # of an EDS file, instead of the profile's or of what all have
        self.name = name or f"node {node}"
        self.learned: set[tuple[int, int]] = set()
        self.profile = chosen
        self.dictionary = Dictionary((), node)
        self.adopt(chosen)
        if keys is not None:
            self._as_bridged()

    def adopt(self, chosen: Profile | None) -> None:
        """Adopt a vendor's dictionary; learned values remain."""
        learned_values = {key: self.dictionary.values[key] for key in self.learned}
        self.profile = chosen
        objects = self.objects or (chosen.objects if chosen is not None else common())
        self.dictionary = Dictionary(objects, self.node)
        self.stored = dict(self.dictionary.values)  # what it begins with after a reset
        self.dictionary.values.update(learned_values)
        self._units: Units | None = None
        self.routes = self._routed()

    def _as_bridged(self) -> None:
        """Assume the bridge's own process data, for a trace that begins in the middle of a run."""
        assert self.profile is not None
        assert self.keys is not None
        values = self.dictionary.values
        forces = Mode.CST in self.profile.modes  # if the drive can be told one
        data = process_data(self.dictionary, self.profile, self.keys, forces)
        values.update({(row.index, row.sub): row.value for row in self.profile.setup})
        values.update(self.keys.objects)
        for base, start, maps in ((0x200, 0x1400, data.receive), (0x180, 0x1800, data.transmit)):
            for number, words in enumerate(maps):
                flags = 0 if words else cia301.INVALID
                values[start + number, 1] = flags | base + 0x100 * number + self.node
                values[start + number + 0x200, 0] = len(words)
                values.update(
                    {(start + number + 0x200, number_in_map): word for number_in_map, word in enumerate(words, 1)}
                )
        self.routes = self._routed()

    # ---------------------------------------------------------------------------------------------------- learning

    def learn(self, index: int, sub: int, data: bytes) -> None:
        """Store a value that was written or read."""
        entry = self.entry(index, sub)
        try:
            value: Value = entry.decode(data) if entry is not None else int.from_bytes(data, "little")
        except Abort:
            value = int.from_bytes(data, "little")
        self.dictionary.values[index, sub] = value
        self.learned.add((index, sub))
        self._units = None
        if index == SAVE:
            self.stored = dict(self.dictionary.values)
        if 0x1400 <= index < 0x1C00:
            self.routes = self._routed()

    def reset(self, application: bool) -> None:
        """Restart the node with its stored values."""
        self.dictionary.values.update(
            {key: value for key, value in self.stored.items() if application or key[0] < PROFILE_AREA}
        )
        self._units = None
        self.routes = self._routed()

    def entry(self, index: int, sub: int) -> Entry | None:
        """The entry at this address, if any."""
        return self.dictionary.find(index, sub)

    def title(self, index: int, sub: int) -> str:
        """Index, subindex and name of an object."""
        entry = self.entry(index, sub)
        name = "" if entry is None else f" {entry.title}: {entry.name}" if entry.title else f" {entry.name}"
        return f"{index:04X}h.{sub}{name}"

    def _routed(self) -> dict[int, Route]:
        """PDOs in use by identifier."""
        routes = {}
        for letter, start in (("R", 0x1400), ("T", 0x1800)):
            for number in PDOS:
                identifier = self.dictionary.get(start + number, 1, missing=cia301.INVALID)
                if identifier & cia301.INVALID:
                    continue
                count = self.dictionary.get(start + number + 0x200)
                if count > MAPPABLE:  # of a multiplexed PDO, or a malformed transfer
                    continue
                words = [self.dictionary.get(start + number + 0x200, sub + 1) for sub in range(count)]
                mapped = [(self.entry(word >> 16, word >> 8 & 0xFF), word & 0xFF) for word in words]
                if all(entry is not None for entry, _ in mapped):
                    complete = tuple((entry, bits) for entry, bits in mapped if entry is not None)
                    routes[identifier & 0x7FF] = Route(f"{letter}PDO{number + 1}", complete)
        return routes

    # ------------------------------------------------------------------------------------------------------ saying

    def decode_value(self, entry: Entry, data: bytes) -> DecodedValue:
        """Decode a value of an object."""
        name = entry.name if not entry.title else f"{entry.title}: {entry.name}"
        text, value = self.valued(entry, data)
        return DecodedValue(f"{name} {text}", snake(name.partition("[")[0]), value)

    def valued(self, entry: Entry | None, data: bytes) -> tuple[str, float | str]:
        """Format a value, and convert it to SI where the profile has a unit for it."""
        raw = data.hex(" ").upper()
        if entry is None:
            return raw, data.hex()
        try:
            value = entry.decode(data)
        except Abort:
            return f"{raw} ({entry.type.name} expected)", data.hex()
        if isinstance(value, str):
            return repr(value), value
        shown = f"{value:{BITS[entry.index]}}h" if entry.index in BITS else str(value)
        if entry.index in WORDS:
            return f"{shown} {WORDS[entry.index](value)}", value
        if (unit := self.unit_of(entry)) is not None:
            return f"{shown} = {unit.factor * value:.6g} {unit.unit}", unit.factor * value
        return shown + (f" ({value:X}h)" if value > 0xFFFF else ""), value

    def unit_of(self, entry: Entry) -> Measure | None:
        """SI unit of an entry, None for plain numbers. At the motor, without a bench's scale."""
        if self.profile is None:
            return None
        if self._units is None:
            pitch = magnetic_pitch(self.keys.motor) if self.keys is not None else None
            with suppress(ZeroDivisionError):  # the trace, or an EDS file, has 0 or nothing for what they follow from
                self._units = self.profile.units(self.dictionary, pitch)
        unit = measure(entry, self._units, self.profile.motor.unit)
        return None if unit is None else unit.in_si()


def snake(name: str) -> str:
    """A name as a key: position_actual_value."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name.lower()).split())
