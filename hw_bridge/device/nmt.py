"""NMT slave: states, boot-up, heartbeat producer and consumer, node guarding where the dictionary has it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame, Timer
from hw_bridge.device.port import Port
from hw_bridge.dictionary import Abort, Code, NmtState, cia301

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.dictionary import Entry, Value

COMMANDS = {
    cia301.START: NmtState.OPERATIONAL,
    cia301.STOP: NmtState.STOPPED,
    cia301.PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}

REACTIONS = {0: NmtState.PRE_OPERATIONAL, 1: None, 2: NmtState.STOPPED}  # 1029h.1; 0 only leaves Operational


class Nmt:
    """NMT state machine of a slave. `reset(application)` restores values, `lost()` is called when a heartbeat is missing."""

    def __init__(
        self,
        port: Port,
        boot_time: int,
        changed: Callable[[], None],
        reset: Callable[[bool], None],
        lost: Callable[[], None],
    ) -> None:
        self.port = port
        self.boot_time = boot_time
        self.changed, self.reset, self.lost = changed, reset, lost
        self.heartbeat = Timer(port.event_queue, self._beat)
        self.boot = Timer(port.event_queue, self._booted)
        self.life = Timer(port.event_queue, self._missed)
        self.consumers: dict[int, Timer] = {}  # by the node watched
        self.guard_toggle = 0
        port.dictionary.checks[0x1016] = self._check_consumer
        port.dictionary.effects[0x1016] = lambda _: self.watch()
        port.dictionary.effects[0x1017] = lambda _: self._beat()

    def start(self) -> None:
        """Start booting; the boot-up message follows after the boot time. Without a node-ID wait for LSS instead."""
        self.port.state = NmtState.INITIALIZING
        for timer in (self.heartbeat, self.life, *self.consumers.values()):
            timer.stop()
        self.guard_toggle = 0
        if self.port.node != cia301.UNCONFIGURED:
            self.boot.start(self.boot_time)

    def command(self, data: bytes) -> None:
        """Execute an NMT command if it is for this node."""
        if len(data) != 2 or data[1] not in (0, self.port.node) or self.port.state is NmtState.INITIALIZING:
            return
        if data[0] in COMMANDS:
            self.enter(COMMANDS[data[0]])
        elif data[0] in (cia301.RESET_NODE, cia301.RESET_COMMUNICATION):
            self.reset(data[0] == cia301.RESET_NODE)
            self.start()
            self.changed()

    def enter(self, state: NmtState) -> None:
        """Change the state and notify the device."""
        if state is not self.port.state:
            self.port.state = state
            self.changed()

    def _booted(self) -> None:
        self.port.transmit(cia301.ERROR_CONTROL + self.port.node, bytes([NmtState.INITIALIZING]))
        self.enter(NmtState.PRE_OPERATIONAL)
        self.watch()
        if period := self._period():
            self.heartbeat.start(period)

    def _period(self) -> int:
        return self.port.dictionary.get(0x1017) * MILLISECOND

    def _beat(self) -> None:
        """Send a heartbeat and start the time to the next; also at once when 1017h was written."""
        self.heartbeat.stop()
        if period := self._period():
            self.port.transmit(cia301.ERROR_CONTROL + self.port.node, bytes([self.port.state]))
            self.heartbeat.start(period)

    # ----------------------------------------------------------------------------------------- heartbeat consumer

    def _watched(self) -> list[tuple[int, int, int]]:
        """Subindex, node and time [ms] of every consumer entry in use."""
        dictionary = self.port.dictionary
        entries = [(sub, dictionary.get(0x1016, sub)) for sub in dictionary.objects.get(0x1016, {}) if sub]
        used = [(sub, value >> 16 & 0x7F, value & 0xFFFF) for sub, value in entries]
        return [consumer for consumer in used if consumer[1] and consumer[2]]

    def _check_consumer(self, entry: Entry, value: Value) -> None:
        assert isinstance(value, int)
        node = value >> 16
        if entry.sub == 0:
            raise Abort(Code.READ_ONLY)
        if node > 127:
            raise Abort(Code.VALUE_RANGE)
        if value & 0xFFFF and any(sub != entry.sub and node == other for sub, other, _ in self._watched()):
            raise Abort(Code.PARAMETER_INCOMPATIBLE)

    def watch(self) -> None:
        """Apply 1016h; each consumer waits for the first heartbeat."""
        for timer in self.consumers.values():
            timer.stop()
        self.consumers = {node: Timer(self.port.event_queue, self._missed) for _, node, _ in self._watched()}

    def process_heartbeat(self, node: int) -> None:
        """Process a heartbeat of another node."""
        for _, watched, time in self._watched():
            if watched == node:
                self.consumers[node].start(time * MILLISECOND)

    def guard(self) -> None:
        """Answer a guarding request; the heartbeat has precedence, and some vendors have no guarding."""
        dictionary = self.port.dictionary
        if 0x100C not in dictionary or dictionary.get(0x1017) or self.port.state is NmtState.INITIALIZING:
            return
        self.port.send(Frame(cia301.ERROR_CONTROL + self.port.node, bytes([self.guard_toggle | self.port.state])))
        self.guard_toggle ^= 0x80
        if life := dictionary.get(0x100C) * dictionary.get(0x100D):
            self.life.start(life * MILLISECOND)

    def _missed(self) -> None:
        self.lost()
        self.react()

    def react(self) -> None:
        """Change the state after a communication error, by 1029h.1."""
        reaction = REACTIONS.get(self.port.dictionary.get(0x1029, 1, missing=0))
        if reaction is NmtState.STOPPED or (reaction and self.port.state is NmtState.OPERATIONAL):
            self.enter(reaction)
