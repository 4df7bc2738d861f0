"""LSS (CiA 305) through the canopen package: a node-ID and a bit rate for a device, by its identity."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from canopen.lss import LssError, LssMaster

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.commission.line import MOVING
from hw_bridge.dictionary import cia301, state_of
from hw_bridge.master import SdoError, SilentError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.commission.line import Line

# row of each bit rate in the table of CiA 305; row 5, once 100 kbit/s, is reserved
ROWS = {1_000_000: 0, 800_000: 1, 500_000: 2, 250_000: 3, 125_000: 4, 50_000: 6, 20_000: 7, 10_000: 8}
ANSWER = 500 * MILLISECOND  # longest time that a device takes [ns]
INQUIRE = (0x5A, 0x5B, 0x5C, 0x5D)  # vendor, product, revision, serial
INQUIRE_NODE_ID = 0x5E
SECOND_ANSWER = 10 * MILLISECOND  # time for that of another device [ns]


class Identity(NamedTuple):
    """1018h.1 to .4, by which LSS names a device."""

    vendor: int
    product: int
    revision: int
    serial: int

    def __str__(self) -> str:
        return (
            f"vendor {self.vendor:X}h, product {self.product:X}h, revision {self.revision:X}h, serial {self.serial:X}h"
        )


class Carrier:
    """What the package takes for its network: requests go out on the line, and answers are there before it waits."""

    def __init__(self, line: Line, master: LssMaster) -> None:
        self.line, self.master = line, master
        self.answers: list[bytes] = []
        line.network.observe(self._seen)

    def _seen(self, _time: int, frame: Frame | None) -> None:
        if frame is not None and frame.id == LssMaster.LSS_RX_COBID:
            self.answers.append(frame.data)

    def send_message(self, identifier: int, data: bytes, _remote: bool = False) -> None:
        """A request, and the time for its answer."""
        self.answers.clear()
        self.line.network.send(Frame(identifier, bytes(data)))
        self.line.wait(
            ANSWER if data[0] not in (0x04, 0x15, 0x40, 0x41, 0x42) else MILLISECOND, lambda: bool(self.answers)
        )
        if self.answers and data[0] in (*INQUIRE, INQUIRE_NODE_ID):
            self.line.wait(SECOND_ANSWER)
            if len(self.answers) > 1:
                raise LssError("several devices answer: name one by its identity (twin hil scan)")
        for answer in self.answers:
            self.master.on_message_received(identifier, bytearray(answer), 0.0)


@contextmanager
def selected(line: Line, identity: Identity | None) -> Iterator[LssMaster]:
    """The device of this identity, or the only one on the bus, ready to be configured; afterwards it waits again."""
    master: Any = LssMaster()
    master.network = Carrier(line, master)
    master.RESPONSE_TIMEOUT = 0.01  # the carrier has waited already [s]
    try:
        if identity is None:
            master.send_switch_state_global(LssMaster.CONFIGURATION_STATE)
        elif not master.send_switch_state_selective(*identity):
            raise LssError("none of this identity")  # noqa: TRY301 - told with the others
        yield master
    except LssError as error:
        who = f"the device with {identity}" if identity is not None else "the only device on the bus"
        raise SimulationError(
            f"LSS: {who}: {error}. Is it on the bus, alone if you name no identity, and does it offer LSS?"
        ) from None
    finally:
        master.send_switch_state_global(LssMaster.WAITING_STATE)


def who(master: LssMaster) -> tuple[Identity, int]:
    """Identity and node-ID of the selected device."""
    return Identity(*(master.inquire_lss_address(one) for one in INQUIRE)), master.inquire_node_id()


def configure(line: Line, identity: Identity | None, node: int | None, bit_rate: int | None) -> tuple[Identity, int]:
    """Give node-ID and bit rate, store them, and start the device anew. Who it is, and its node-ID before.

    A new bit rate acts when the device is switched off and on: the others of the bus have to change with it. No other device
    is reset. Without an identity, SimulationError if more than one answers: all of them would get the same node-ID.
    """
    if bit_rate is not None and bit_rate not in ROWS:
        raise SimulationError(f"LSS: there is no bit rate {bit_rate}. LSS has {', '.join(map(str, ROWS))}.")
    if node is not None and answers(line, node):
        raise SimulationError(f"LSS: node {node} is on the bus already. Give another node-ID.")
    with selected(line, identity) as master:
        found, before = who(master)
        refuse_running(line, before)
        if node is not None:
            master.configure_node_id(node)
        if bit_rate is not None:
            master.configure_bit_timing(ROWS[bit_rate])
        if node is not None or bit_rate is not None:
            master.store_configuration()
    if node is not None:
        line.states.pop(before, None)
        if 1 <= before <= 127:  # one that had no node-ID begins by itself (CiA 305); others are not reset for it
            line.nmt(cia301.RESET_COMMUNICATION, before)
        line.wait(2 * ANSWER, lambda: node in line.states)
    return found, before


def refuse_running(line: Line, node: int) -> None:
    """SimulationError for a drive that somebody drives; what is no drive has no statusword, what has no node-ID no SDO."""
    with suppress(SilentError, SdoError):
        if state_of(line.client(node).number(0x6041) & 0xFFFF) in MOVING:
            raise SimulationError(f"LSS: node {node} is driven by somebody. End that program first.")


def answers(line: Line, node: int) -> bool:
    """Whether a node-ID is taken."""
    client = line.client(node)
    client.attempts = 1
    try:
        client.number(0x1000)
    except SilentError:
        return False
    finally:
        line.states.pop(node, None)
    return True
