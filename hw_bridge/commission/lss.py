"""LSS (CiA 305) through the canopen package: a node-ID and a bit rate for a device, by its identity."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from canopen.lss import LssError, LssMaster

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.commission.nvm import FLASH
from hw_bridge.commission.sdo_session import MOVING
from hw_bridge.dictionary import NmtState, cia301, state_of
from hw_bridge.master import SdoError, SilentError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.commission.sdo_session import SdoSession

# row of each bit rate in the table of CiA 305; row 5, once 100 kbit/s, is reserved
ROWS = {1_000_000: 0, 800_000: 1, 500_000: 2, 250_000: 3, 125_000: 4, 50_000: 6, 20_000: 7, 10_000: 8}
ANSWER = 500 * MILLISECOND  # longest time that a device takes [ns]
INQUIRE = (0x5A, 0x5B, 0x5C, 0x5D)  # vendor, product, revision, serial
INQUIRE_NODE_ID = 0x5E
SECOND_ANSWER = 10 * MILLISECOND  # time for that of another device, but for the last inquiry `ANSWER` [ns]
STORE = 0x17
UNANSWERED = (0x04, 0x15, 0x40, 0x41, 0x42)


class Identity(NamedTuple):
    """1018h.1 to .4, by which LSS addresses a device."""

    vendor: int
    product: int
    revision: int
    serial: int

    def __str__(self) -> str:
        return (
            f"vendor {self.vendor:X}h, product {self.product:X}h, revision {self.revision:X}h, serial {self.serial:X}h"
        )


class Carrier:
    """Network adapter for the canopen package: requests go out on the bus, and responses are there before it waits."""

    def __init__(self, sdo_session: SdoSession, master: LssMaster) -> None:
        self.sdo_session, self.master = sdo_session, master
        self.answers: list[bytes] = []
        sdo_session.network.observe(self._on_frame)

    def _on_frame(self, _time: int, frame: Frame | None) -> None:
        if frame is not None and frame.id == LssMaster.LSS_RX_COBID:
            self.answers.append(frame.data)

    def send_message(self, identifier: int, data: bytes, _remote: bool = False) -> None:
        """Send a request, and wait for its response."""
        self.answers.clear()
        self.sdo_session.network.send(Frame(identifier, bytes(data)))
        longest = MILLISECOND if data[0] in UNANSWERED else FLASH if data[0] == STORE else ANSWER
        self.sdo_session.wait(longest, lambda: bool(self.answers))
        if self.answers and data[0] in (*INQUIRE, INQUIRE_NODE_ID):
            self.sdo_session.wait(ANSWER if data[0] == INQUIRE_NODE_ID else SECOND_ANSWER)
            if len(self.answers) > 1:
                raise LssError("several devices answer: name one by its identity (twin hil scan)")
        for answer in self.answers:
            self.master.on_message_received(identifier, bytearray(answer), 0.0)


@contextmanager
def selected(sdo_session: SdoSession, identity: Identity | None) -> Iterator[LssMaster]:
    """Select the device of this identity, or the only one on the bus, for configuration; afterwards it waits again."""
    master: Any = LssMaster()
    master.network = Carrier(sdo_session, master)
    master.RESPONSE_TIMEOUT = 0.01  # the carrier has waited already [s]
    try:
        master.send_switch_state_global(LssMaster.WAITING_STATE)  # also a device that a killed program had selected
        if identity is None:
            master.send_switch_state_global(LssMaster.CONFIGURATION_STATE)
        elif not master.send_switch_state_selective(*identity):
            raise LssError("none of this identity")  # noqa: TRY301 - told with the others
        yield master
    except LssError as error:
        device = f"the device with {identity}" if identity is not None else "the only device on the bus"
        raise SimulationError(
            f"LSS: {device}: {error}. Is it on the bus, alone if you name no identity, and does it offer LSS?"
        ) from None
    finally:
        master.send_switch_state_global(LssMaster.WAITING_STATE)


def inquire(master: LssMaster) -> tuple[Identity, int]:
    """Identity and node-ID of the selected device."""
    return Identity(*(master.inquire_lss_address(part) for part in INQUIRE)), master.inquire_node_id()


def configure(
    sdo_session: SdoSession, identity: Identity | None, node: int | None, bit_rate: int | None
) -> tuple[Identity, int]:
    """Set node-ID and bit rate, store them, and restart the device. Return its identity, and its previous node-ID.

    A new bit rate is effective after power-on: the others of the bus have to change with it. No other device
    is reset. Without an identity, SimulationError if more than one answers: all of them would get the same node-ID.
    """
    if bit_rate is not None and bit_rate not in ROWS:
        raise SimulationError(f"LSS: there is no bit rate {bit_rate}. LSS has {', '.join(map(str, ROWS))}.")
    if node is not None and answers(sdo_session, node):
        raise SimulationError(f"LSS: node {node} is on the bus already. Give another node-ID.")
    with selected(sdo_session, identity) as master:
        device_identity, before = inquire(master)
        assert_not_running(sdo_session, before)
        if node is not None:
            master.configure_node_id(node)
        if bit_rate is not None:
            master.configure_bit_timing(ROWS[bit_rate])
        if node is not None or bit_rate is not None:
            master.store_configuration()
    if node is not None:
        sdo_session.states.pop(before, None)
        if 1 <= before <= 127:  # one that had no node-ID begins by itself (CiA 305); others are not reset for it
            sdo_session.nmt(cia301.RESET_COMMUNICATION, before)
        sdo_session.wait(2 * ANSWER, lambda: node in sdo_session.states)
    return device_identity, before


def assert_not_running(sdo_session: SdoSession, node: int) -> None:
    """Raise SimulationError for a drive that another program drives, or one in NMT Stopped, which may still move.

    Other devices have no statusword or no SDO.
    """
    with suppress(SilentError, SdoError):
        if state_of(sdo_session.client(node).number(0x6041) & 0xFFFF) in MOVING:
            raise SimulationError(f"LSS: node {node} is driven by somebody. End that program first.")
    if sdo_session.states.get(node) is NmtState.STOPPED:
        raise SimulationError(
            f"LSS: node {node} is in NMT Stopped: whether it moves is not known. Bring it to rest: twin hil disable {node}."
        )


def answers(sdo_session: SdoSession, node: int) -> bool:
    """Whether a node-ID is in use."""
    client = sdo_session.client(node)
    client.attempts = 1
    try:
        client.number(0x1000)
    except SilentError:  # in NMT Stopped a node takes no SDO, but sends its heartbeat
        return node in sdo_session.states
    finally:
        sdo_session.states.pop(node, None)
    return True
