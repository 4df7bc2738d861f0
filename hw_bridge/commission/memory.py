"""What a drive keeps when it is switched off: store, and back to how it was delivered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.commission.line import refuse_moving
from hw_bridge.dictionary import cia301
from hw_bridge.journal import Journal, JournalFile, bus_folder, journal_path
from hw_bridge.master import SdoError, restoration
from twin.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.commission.line import Line
    from hw_bridge.master import Station

SETTLE = 10 * MILLISECOND  # until a node is in the state that it was told [ns]
STORE, RESTORE = 0x1010, 0x1011
SAVE, LOAD = b"save", b"load"
FLASH = 3_000 * MILLISECOND  # longest time that writing flash takes; estimate [ns]
START = 5_000 * MILLISECOND  # longest time to the boot-up message; estimate [ns]


def store(node: Station, folder: Path | None = None) -> None:
    """Keep all parameters that can be kept (1010h.1); refused for values that a run left, by the journal in `folder`.

    Without `folder` that of real buses.
    """
    if left := left_by_a_run(node, folder or bus_folder("", "", software=False)):
        raise SimulationError(
            f"{node.name}: holds {len(left)} values that a run wrote and did not restore ({', '.join(left[:4])}"
            f"{', ...' if len(left) > 4 else ''}). Restore them first: twin hil restore {node.number}"
        )
    _signed(node, STORE, SAVE, "stores no parameters")


def left_by_a_run(node: Station, folder: Path) -> list[str]:
    """Names of the objects that a run wrote and did not restore; SimulationError while one holds the journal."""
    identity = restoration.identity_of(node)
    path = journal_path(folder, identity)
    if not path.exists():
        return []
    journal = Journal()
    file = JournalFile(path, identity)
    try:
        journal.attach(file)
        return [change.name for change in journal.changes.values()]
    finally:
        journal.close()


def restore_journal(line: Line, node: Station, folder: Path) -> restoration.Restored | None:
    """Restore what a run left by the drive's journal in `folder`; nothing where there is none.

    SimulationError if the journal is damaged or of another drive, or if the drive is enabled; it is kept then.
    """
    if not journal_path(folder, restoration.identity_of(node)).exists():
        return None
    refuse_moving(node)
    restoration.open_journal(node, folder)
    try:
        line.nmt(cia301.PRE_OPERATIONAL, node.number)
        line.wait(SETTLE)
        return restoration.restore(node)
    finally:
        node.journal.close()


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
