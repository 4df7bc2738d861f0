"""A CANopen slave: frames in, frames out, `advance(t)`; independent of whether its time is simulated."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from hw_bridge.device.emergency import Emergency
from hw_bridge.device.lss import REQUEST, LssSlave
from hw_bridge.device.nmt import Nmt
from hw_bridge.device.pdo import SYNCHRONOUS, ReceivePdo, TransmitPdo
from hw_bridge.device.port import Port, check_identifier
from hw_bridge.device.sdo import SdoServer
from hw_bridge.device.storage import Storage
from hw_bridge.dictionary import Abort, Code, Dictionary, NmtState, cia301
from hw_bridge.profiles import Rules
from twin.errors import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from hw_bridge.bus import Frame
    from hw_bridge.device.store import Store
    from hw_bridge.dictionary import Entry, Value

PRODUCER = 1 << 30  # bit of 1005h: send SYNC


class Slave(ABC):
    """The services of CiA 301 around one object dictionary; a device adds its functions.

    `boot_time` and `sdo_time` [ns]: from power-on to the boot-up message, from an SDO request to its response.
    """

    def __init__(self, entries: Iterable[Entry], node: int, rules: Rules, boot_time: int, sdo_time: int) -> None:
        self.dictionary = Dictionary(entries, node)
        self.port = Port(self.dictionary)
        self.node = node
        self.sdo_time = sdo_time
        self.storage = Storage(self.dictionary)
        self.emergency = Emergency(self.port)
        self.sdo = SdoServer(self.dictionary)
        self.lss = LssSlave(self.port, self._begin_with_node_id)
        self.nmt = Nmt(self.port, boot_time, self._state_changed, self._reset, self.master_lost)
        numbers = range(4)
        self.rpdos = [ReceivePdo(self.port, rules, n, self.communication_error, self.data_received) for n in numbers]
        self.tpdos = [TransmitPdo(self.port, rules, n) for n in numbers]
        self.dictionary.checks[0x1005] = self._check_sync
        self.dictionary.checks[0x1019] = self._check_counter
        self._configure()
        self.nmt.start()

    # -------------------------------------------------------------------------------------------- what a device adds

    @abstractmethod
    def communication_error(self, code: int) -> None:
        """React to a communication error with this EMCY code."""

    @abstractmethod
    def master_lost(self) -> None:
        """React to a missing heartbeat or node guarding."""

    @abstractmethod
    def data_received(self, mapped: list[Entry]) -> None:
        """React to a received PDO with these objects."""

    @abstractmethod
    def nmt_changed(self) -> None:
        """React to a changed NMT state."""

    @abstractmethod
    def power_on(self) -> None:
        """Restart with the values of the dictionary."""

    @abstractmethod
    def error_passive(self) -> None:
        """React to error passive."""

    @abstractmethod
    def bus_off(self) -> None:
        """React to bus-off."""

    @abstractmethod
    def bus_on(self) -> None:
        """React to recovery from bus-off."""

    # ------------------------------------------------------------------------------------------------------ the bus

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Send frames with `send` from now on."""
        self.port.send = send

    def remember(self, store: Store) -> None:
        """Power on with the memory in a file, and store it there from now on."""
        self.storage.attach(store)
        try:
            self._reset(application=True)
        except (Abort, ArithmeticError) as error:  # each value is possible, all of them together are not
            raise DeclarationError(
                f"{store.path}: what is stored does not fit together ({error}). Remove the file to begin anew."
            ) from None

    @property
    def now(self) -> int:
        """Time reached [ns]."""
        return self.port.event_queue.now

    def restart(self) -> None:
        """Restart, as after the NMT command Reset node."""
        self.nmt.command(bytes([cia301.RESET_NODE, self.node]))

    def next_time(self) -> int:
        """Latest time at which it has to be advanced [ns]."""
        return self.port.event_queue.next_time()

    def advance(self, time: int) -> None:
        """Execute everything that is due until `time` [ns]."""
        self.port.event_queue.advance(time)

    def receive(self, frame: Frame) -> None:
        """Process a frame, at the time of the last advance."""
        if not self.port.online:
            return
        dictionary, node = self.dictionary, self.node
        if frame.remote:
            self._requested(frame.id)
        elif frame.id == 0:
            self.nmt.command(frame.data)
        elif self.port.state is NmtState.INITIALIZING:
            if frame.id == REQUEST and self.lss.is_unconfigured:
                self.lss.process_request(frame.data)
        elif cia301.ERROR_CONTROL < frame.id < cia301.ERROR_CONTROL + 0x80:
            self.nmt.process_heartbeat(frame.id - cia301.ERROR_CONTROL)
        elif frame.id == cia301.SDO_REQUEST + node:
            if self.port.state is not NmtState.STOPPED and (answer := self.sdo.answer(frame.data)) is not None:
                respond = self._responding(answer)
                self.port.event_queue.at(self.port.event_queue.now + self.sdo_time, respond)
            self.refresh()
        elif frame.id == dictionary.get(0x1005) & 0x7FF:
            self._sync(frame.data)
        elif frame.id == REQUEST:
            self.lss.process_request(frame.data)
        else:
            meant = [pdo for pdo in self.rpdos if pdo.hears(frame.id)]
            for pdo in meant:
                pdo.receive(frame.data)
            if meant:
                self.refresh()

    def refresh(self) -> None:
        """Let transmit PDOs check for changes."""
        for pdo in self.tpdos:
            pdo.changed()

    def _responding(self, answer: bytes) -> Callable[[], None]:
        return lambda: self.port.transmit(cia301.SDO_RESPONSE + self.node, answer)

    def _requested(self, identifier: int) -> None:
        if identifier == cia301.ERROR_CONTROL + self.node:
            self.nmt.guard()
        for pdo in self.tpdos:
            if pdo.hears(identifier):
                pdo.requested()

    def _sync(self, data: bytes) -> None:
        """Process a SYNC: sample actual values, then apply targets. One with another length than 1019h says is ignored."""
        if len(data) != (self.dictionary.get(0x1019) != 0):
            return
        for sending in self.tpdos:
            sending.sync()
        for receiving in self.rpdos:
            receiving.sync()
        self.refresh()

    @staticmethod
    def _check_sync(_: Entry, value: Value) -> None:
        assert isinstance(value, int)
        if value & PRODUCER:  # none of them can
            raise Abort(Code.VALUE_RANGE)
        check_identifier(value)

    @staticmethod
    def _check_counter(_: Entry, value: Value) -> None:
        if value != 0 and value not in range(2, SYNCHRONOUS + 1):
            raise Abort(Code.VALUE_RANGE)

    def _configure(self) -> None:
        for pdo in (*self.rpdos, *self.tpdos):
            pdo.configure()

    def _state_changed(self) -> None:
        for pdo in (*self.rpdos, *self.tpdos):
            pdo.reset()
        self.nmt_changed()
        self.refresh()

    def _begin_with_node_id(self) -> None:
        self._reset(application=False)
        self.nmt.start()

    def _reset(self, application: bool) -> None:
        self.node = self.port.node = self.dictionary.node = self.lss.pending
        self.storage.load(application)
        self._configure()
        if application:
            self.power_on()
