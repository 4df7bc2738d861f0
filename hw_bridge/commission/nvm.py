"""Non-volatile memory of a drive: store parameters (1010h), restore defaults (1011h), and restart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.commission.sdo_session import assert_not_driven
from hw_bridge.dictionary import cia301
from hw_bridge.journal import Journal, JournalFile, bus_folder, journal_path
from hw_bridge.master import SdoError, restoration
from twin.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.commission.sdo_session import SdoSession
    from hw_bridge.journal import ObjectChange
    from hw_bridge.master import Station

SETTLE = 10 * MILLISECOND  # until a node is in the state that it was told [ns]
STORE, RESTORE = 0x1010, 0x1011
SAVE, LOAD = b"save", b"load"
FLASH = 3_000 * MILLISECOND  # longest time that writing flash takes; estimate [ns]
START = 5_000 * MILLISECOND  # longest time to the boot-up message; estimate [ns]


def store(node: Station, folder: Path | None = None) -> None:
    """Store all parameters (1010h.1); refused for values that a run left, by the journal in `folder`.

    Without `folder` that of real buses.
    """
    assert_can_store(node, folder or bus_folder("", "", software=False))
    _signed(node, STORE, SAVE, "stores no parameters")


def assert_can_store(node: Station, folder: Path) -> None:
    """Raise SimulationError for a drive that a program drives, or that holds values that a run did not restore."""
    assert_not_driven(node)
    if left := unrestored_objects(node, folder):
        raise SimulationError(unrestored_text(node, left))


def unrestored_text(node: Station, left: list[ObjectChange]) -> str:
    """Sentence on the objects that a run wrote and did not restore, with the remedy."""
    what, them = ("1 object", "it") if len(left) == 1 else (f"{len(left)} objects", "them")
    return (
        f"{node.name}: a killed run left {what} as it wrote {them} ({', '.join(change.name for change in left[:4])}"
        f"{', ...' if len(left) > 4 else ''}). Restore {them}: twin hil restore {node.number}"
    )


def unrestored_objects(node: Station, folder: Path) -> list[ObjectChange]:
    """Objects that a run wrote and did not restore; SimulationError while a program holds the journal."""
    identity = restoration.identity_of(node)
    path = journal_path(folder, identity)
    if not path.exists():
        return []
    journal = Journal()
    file = JournalFile(path, identity)
    try:
        journal.attach(file)
        return [*journal.changes.values()]
    finally:
        journal.close()


def restore_journal(
    sdo_session: SdoSession, node: Station, folder: Path, armed: bool = True
) -> restoration.Restored | None:
    """Restore what a run left by the drive's journal in `folder`; None where there is none.

    SimulationError if the journal is damaged or of another drive, or if the drive is enabled; it is kept then. Not
    `armed`: nothing that may switch an output.
    """
    if not journal_path(folder, restoration.identity_of(node)).exists():
        return None
    assert_not_driven(node)
    restoration.open_journal(node, folder)
    try:
        sdo_session.nmt(cia301.PRE_OPERATIONAL, node.number)
        sdo_session.wait(SETTLE)
        return restoration.restore(node, armed)
    finally:
        node.journal.close()


def defaults(node: Station) -> None:
    """Restore default parameters (1011h.1), effective at the next start. Node-ID and bit rate may be among them."""
    _signed(node, RESTORE, LOAD, "restores no parameters")


def _signed(node: Station, index: int, signature: bytes, what: str) -> None:
    assert_not_driven(node)
    try:
        node.sdo.write(index, 1, signature, FLASH)
    except SdoError as error:
        raise SimulationError(f"{node.name}: {what}: {error}") from None


def restart(sdo_session: SdoSession, node: Station) -> None:
    """Send NMT Reset node, and wait for the boot-up message."""
    assert_not_driven(node)
    sdo_session.states.pop(node.number, None)
    sdo_session.nmt(cia301.RESET_NODE, node.number)
    sdo_session.wait(START, lambda: sdo_session.states.get(node.number) is not None)
    if node.number not in sdo_session.states:
        raise SimulationError(
            f"{node.name}: does not tell that it started within {START / 1e9:g} s. If its node-ID or bit rate is among "
            f"what it restored, look for it with twin hil scan."
        )
    sdo_session.wait(100 * MILLISECOND)
