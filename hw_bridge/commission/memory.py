"""What a drive keeps when it is switched off: store, and back to how it was delivered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.commission.line import refuse_moving
from hw_bridge.dictionary import cia301
from hw_bridge.master import SdoError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.commission.line import Line
    from hw_bridge.master import Station

STORE, RESTORE = 0x1010, 0x1011
SAVE, LOAD = b"save", b"load"
FLASH = 3_000 * MILLISECOND  # longest time that writing flash takes; estimate [ns]
START = 5_000 * MILLISECOND  # longest time to the boot-up message; estimate [ns]


def store(node: Station) -> None:
    """Keep all parameters that can be kept (1010h.1)."""
    _signed(node, STORE, SAVE, "stores no parameters")


def defaults(node: Station) -> None:
    """From the next start on, as it was delivered (1011h.1). Node-ID and bit rate may be among it."""
    _signed(node, RESTORE, LOAD, "restores no parameters")


def _signed(node: Station, index: int, signature: bytes, what: str) -> None:
    refuse_moving(node)
    try:
        node.sdo.write(index, 1, signature, FLASH)
    except SdoError as error:
        raise SimulationError(f"{node.name}: {what}: {error}") from None


def restart(line: Line, node: Station) -> None:
    """NMT Reset node, and wait until it tells that it has started."""
    refuse_moving(node)
    line.states.pop(node.number, None)
    line.nmt(cia301.RESET_NODE, node.number)
    line.wait(START, lambda: line.states.get(node.number) is not None)
    if node.number not in line.states:
        raise SimulationError(
            f"{node.name}: does not tell that it started within {START / 1e9:g} s. If its node-ID or bit rate is among "
            f"what it restored, look for it with twin hil scan."
        )
    line.wait(100 * MILLISECOND)
