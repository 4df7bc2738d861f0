"""Process data: mapping and its rules, receive and transmit PDOs with their transmission types."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Timer
from hw_bridge.device.port import Port, check_identifier
from hw_bridge.dictionary import Abort, Code, Entry, NmtState, Value, cia301
from hw_bridge.profiles import Rules

if TYPE_CHECKING:
    from collections.abc import Callable

SYNCHRONOUS = 240  # the largest synchronous transmission type
REMOTE_ONLY = (252, 253)
EVENT = (254, 255)

LENGTH_SHORT, LENGTH_EXCEEDED = 0x8210, 0x8220  # EMCY


class Pdo:
    """Common part of receive and transmit PDOs: parameters at `communication`, mapping at `mapping`."""

    receiving: bool

    def __init__(self, port: Port, rules: Rules, communication: int, mapping: int) -> None:
        self.port, self.rules = port, rules
        self.communication, self.mapping = communication, mapping
        self.mapped: list[Entry] = []
        self.identifier = cia301.INVALID  # COB-ID entry with its flags
        self.kind = 255  # transmission type
        self.form = struct.Struct("<")  # all mapped objects at once
        dictionary = port.dictionary
        dictionary.checks[communication] = self._check_communication
        dictionary.checks[mapping] = self._check_mapping
        dictionary.effects[communication] = dictionary.effects[mapping] = lambda _: self.configure()

    @property
    def active(self) -> bool:
        """Whether it exists and the node is operational."""
        return not self.identifier & cia301.INVALID and self.port.state is NmtState.OPERATIONAL

    def hears(self, identifier: int) -> bool:
        """Whether a frame with this identifier is for this PDO."""
        return self.identifier & (cia301.INVALID | 0x7FF) == identifier

    def configure(self) -> None:
        """Apply changed parameters."""
        dictionary = self.port.dictionary
        self.identifier = dictionary.get(self.communication, 1)
        self.kind = dictionary.get(self.communication, 2)
        words = [dictionary.get(self.mapping, sub + 1) for sub in range(dictionary.get(self.mapping))]
        self.mapped = [dictionary.entry(word >> 16, word >> 8 & 0xFF) for word in words]
        self.form = struct.Struct("<" + "".join(entry.type.form[1:] for entry in self.mapped))
        self.addresses = [(entry.index, entry.sub) for entry in self.mapped]
        self.reset()

    def reset(self) -> None:
        """Discard pending data."""

    def _check_communication(self, entry: Entry, value: Value) -> None:
        assert isinstance(value, int)
        if entry.sub == 1:
            exists = not self.identifier & cia301.INVALID
            changes_in_use = exists and not value & cia301.INVALID and (value ^ self.identifier) & 0x1FFFFFFF
            if value & (cia301.EXTENDED | 0x1FFFF800) or changes_in_use:
                raise Abort(Code.VALUE_RANGE)
            if not value & cia301.INVALID:
                check_identifier(value)
        elif entry.sub == 2:
            remote = value in REMOTE_ONLY and not self.receiving
            if value > SYNCHRONOUS and value not in EVENT and not remote:
                raise Abort(Code.VALUE_RANGE)
        elif entry.sub == 3 and not self.identifier & cia301.INVALID:
            raise Abort(self.rules.remap)  # the inhibit time is fixed while the PDO exists

    def _check_mapping(self, entry: Entry, value: Value) -> None:
        assert isinstance(value, int)
        dictionary = self.port.dictionary
        if not self.identifier & cia301.INVALID:
            raise Abort(self.rules.remap)
        if entry.sub:
            if dictionary.get(self.mapping):
                raise Abort(self.rules.remap)
            if value:
                self._mappable(value)
            return
        if value > self.rules.objects:
            raise Abort(Code.PDO_LENGTH)
        words = [dictionary.get(self.mapping, sub + 1) for sub in range(value)]
        if sum(self._mappable(word).type.size for word in words) * 8 > 64:
            raise Abort(Code.PDO_LENGTH)

    def _mappable(self, word: int) -> Entry:
        """The entry that a mapping word names, if this kind of PDO may carry it."""
        entry = self.port.dictionary.entry(word >> 16, word >> 8 & 0xFF)
        allowed = entry.writable if self.receiving else entry.readable
        if not entry.mappable or not allowed or word & 0xFF != entry.type.size * 8:
            raise Abort(Code.NOT_MAPPABLE)
        return entry


class ReceivePdo(Pdo):
    """PDO that writes data into the dictionary: at once, or at the next SYNC."""

    receiving = True

    def __init__(
        self,
        port: Port,
        rules: Rules,
        number: int,
        fault: Callable[[int], None],
        on_write: Callable[[list[Entry]], None],
    ) -> None:
        super().__init__(port, rules, 0x1400 + number, 0x1600 + number)
        self.fault, self.on_write = fault, on_write
        self.waiting: bytes | None = None

    def reset(self) -> None:
        """Discard data that wait for a SYNC."""
        self.waiting = None

    def receive(self, data: bytes) -> None:
        """Process data of this PDO's identifier."""
        if not self.active:
            return
        if len(data) < self.form.size:
            self.fault(LENGTH_SHORT)
            return
        if len(data) > self.form.size:
            self.fault(LENGTH_EXCEEDED)
        if self.kind <= SYNCHRONOUS:
            self.waiting = data
        else:
            self._apply(data)

    def sync(self) -> None:
        """Apply pending data."""
        if self.waiting is not None and self.active:
            data, self.waiting = self.waiting, None
            self._apply(data)

    def _apply(self, data: bytes) -> None:
        """Write all objects first, then apply them: a controlword acts on the target in the same PDO."""
        dictionary = self.port.dictionary
        taken = []
        for entry, value in zip(self.mapped, self.form.unpack_from(data), strict=True):
            try:
                dictionary.check(entry, value)
            except Abort:
                continue  # a PDO has no response; the object keeps its value
            dictionary.values[entry.index, entry.sub] = value
            taken.append(entry)
        for entry in taken:
            dictionary.act(entry)
        self.on_write(self.mapped)


class TransmitPdo(Pdo):
    """PDO that sends data of the dictionary: on change, on a timer, at SYNC or on request."""

    receiving = False

    def __init__(self, port: Port, rules: Rules, number: int) -> None:
        super().__init__(port, rules, 0x1800 + number, 0x1A00 + number)
        self.inhibit = Timer(port.event_queue, self.changed)
        self.event = Timer(port.event_queue, self._elapsed)
        self.sent: bytes | None = None
        self.sampled: bytes | None = None  # at the last SYNC
        self.count = 0

    def reset(self) -> None:
        """Restart: the next comparison detects a change."""
        self.inhibit.stop()
        self.event.stop()
        self.sent = self.sampled = None
        self.count = 0

    def data(self) -> bytes:
        """Present data."""
        values = self.port.dictionary.values
        return self.form.pack(*[values[address] for address in self.addresses])

    def changed(self) -> None:
        """Send if the data have changed."""
        if self.kind < EVENT[0] or self.inhibit.running or not self.mapped or not self.active:
            return
        if self.data() != self.sent:
            self._send()

    def sync(self) -> None:
        """Process a SYNC: sample and send if due."""
        if not self.mapped or not self.active:
            return
        if self.kind == REMOTE_ONLY[0]:
            self.sampled = self.data()
        if self.kind > SYNCHRONOUS:
            return
        self.count += 1
        due = self.data() != self.sent if self.kind == 0 else self.count >= self.kind
        if due:
            self.count = 0
            self._send()

    def requested(self) -> None:
        """Process a remote frame."""
        if self.active and self.mapped and not self.identifier & cia301.NO_REMOTE:
            self._send()

    def _elapsed(self) -> None:
        """Event timer: send, or as soon as the inhibit time is over too."""
        self.sent = None
        self.changed()

    def _send(self) -> None:
        if not self.active:
            return
        dictionary = self.port.dictionary
        self.sent = self.sampled or self.data()
        self.port.transmit(self.identifier & 0x7FF, self.sent)
        if self.kind in EVENT:
            if inhibit := dictionary.get(self.communication, 3):
                self.inhibit.start(inhibit * MILLISECOND // 10)
            if period := dictionary.get(self.communication, 5):
                self.event.start(period * MILLISECOND)
