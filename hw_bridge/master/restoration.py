"""Restore every object that a run wrote: at the end of the run, or from the journal of an interrupted one."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hw_bridge.dictionary import State, cia301, cia401, cia402, state_of
from hw_bridge.journal import DriveIdentity, JournalFile, ObjectChange, bus_folder, journal_path
from hw_bridge.master.sdo import SdoError
from hw_bridge.master.writes import LONGEST, PDOS, download, upload
from hw_bridge.profiles import SCALING, acting
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.journal import Journal
    from hw_bridge.master.master import Master
    from hw_bridge.master.station import Station

Address = tuple[int, int]
OUTPUTS = (cia402.OUTPUTS, cia401.OUTPUTS)  # to restore them would switch valves or a brake
ENABLED = (State.ENABLED, State.QUICK_STOP, State.REACTION)
HEARTBEATS = (0x1016, 0x1017)
MODE = 0x6060
SHOWN = 4  # names of objects in a note
TEMPORARY = "while its mapping is restored"  # reason of a change by a restoration, for one that is killed
STATUSWORD = 0x6041
ATTEMPTS = 4  # of a request: some hundred of them are made, and frames may be lost
ROUNDS = 2  # a limit may be refused until its counterpart is restored


@dataclass
class Restored:
    """Result of restoring one node; `failed` and `foreign`: lines."""

    restored: list[str] = field(default_factory=list)
    retained: list[str] = field(default_factory=list)  # by the hardware file's `keep`, or outputs that stay safe
    foreign: list[str] = field(default_factory=list)  # changed by another program since: left as they are
    failed: list[str] = field(default_factory=list)

    @property
    def counts(self) -> str:
        """How many objects are as before, and how many are not; which were left on purpose."""
        retained = f" Left on purpose (outputs, offsets, `keep`): {', '.join(self.retained)}." if self.retained else ""
        return (
            f"{len(self.restored)} objects are as before the run, {len(self.failed + self.foreign)} are not.{retained}"
        )


def restore(station: Station, armed: bool = True) -> Restored:
    """Write back and verify all objects in the station's journal. Its power is off, and it is in Pre-operational.

    Order (CiA 301): disable all changed PDOs; scaling, then all else, last written first; mappings as count
    0, entries, count; kinds and times; COB-IDs with their valid bit; heartbeats. A mapping of which an entry is refused
    stays empty: its frames would act on another object. SimulationError if it is enabled. Not `armed`: objects that may
    switch outputs are not restored, and stay in the journal.
    """
    journal, result = station.journal, Restored()
    refuse_enabled(station)
    keep = _retained_changes(station, journal)
    result.retained = [journal.changes[address].name for address in keep]
    journal.settle(keep)
    switching = [] if armed else [change for change in journal.changes.values() if _switches(station, change)]
    result.failed += [
        f"{station.name}: {change.name} was {_hex(change.before)} and may switch outputs, such as a valve or a brake: add --arm "
        f"if nobody is in their way."
        for change in switching
    ]
    changes = [change for change in journal.changes.values() if change.before and change not in switching]
    pdos = _changed_pdos(station, [change for change in changes if change.index in PDOS])
    others = sorted((change for change in reversed(changes) if change.index not in PDOS), key=_rank)
    temporary = [*_excluded_counts(station, pdos), *_excluded_identifiers(station, pdos)]
    journal.record(temporary)
    pdos += temporary
    _disable(station, pdos)
    left = _write_back(station, [other for other in others if other.index not in HEARTBEATS], result)
    left += _write_back(station, sorted(pdos, key=_pdo_rank), result, prepare=lambda change: _empty(station, change))
    left += _write_back(station, [other for other in others if other.index in HEARTBEATS], result)
    _verify(station, changes, left, result)
    for change in temporary:
        if (present := _reads(station, change)) == change.before:
            journal.settle([change.address])
        else:
            result.failed.append(
                f"{station.name}: {change.name} was to stay {_hex(change.before)} and is {_hex(present)}: the drive refuses it "
                f"or one of its entries."
            )
    return result


def _switches(station: Station, change: ObjectChange) -> bool:
    return acting.switches(station.profile, change.index, change.sub)


def _changed_pdos(station: Station, changes: list[ObjectChange]) -> list[ObjectChange]:
    """Changes of the PDOs that differ from before: the others stay enabled."""
    touched = {change.index & ~0x200 for change in changes if _reads(station, change) != change.before}
    return [change for change in changes if change.index & ~0x200 in touched]


def _reads(station: Station, change: ObjectChange) -> bytes:
    """Value of an object; empty where it cannot be read, as mapping entries beyond the count."""
    try:
        return upload(station, change.index, change.sub)
    except SdoError:
        return b""


def refuse_enabled(station: Station) -> None:
    """Raise SimulationError for a drive whose power stage is on; a device without statusword is no drive."""
    with suppress(SdoError):
        if (state := state_of(station.sdo.number(STATUSWORD) & 0xFFFF)) in ENABLED:
            raise SimulationError(f"{station.name}: is in {state}: nothing is restored while it is enabled.")


def _retained_changes(station: Station, journal: Journal) -> list[Address]:
    """Changes that are not restored: those that the hardware file names, outputs, and offsets that are added to targets."""
    named = getattr(station.keys, "keep", ())
    everything = named == "all"
    return [
        address
        for address in journal.changes
        if address[0] in (*OUTPUTS, *cia402.OFFSETS) or everything or address in named or (address[0], None) in named
        if journal.changes[address].reason != TEMPORARY
    ]


def _rank(change: ObjectChange) -> int:
    """Scaling goes first: other values are in its units."""
    return 0 if change.index in SCALING else 1


def _pdo_rank(change: ObjectChange) -> tuple[int, int, int, int]:
    """One PDO after the other: mapping entries, count, kind and times, at last the COB-ID."""
    is_mapping = bool(change.index & 0x200)
    order = (0 if change.sub else 1) if is_mapping else (3 if change.sub == 1 else 2)
    return change.index & ~0x200, order, change.index, change.sub


def _disable(station: Station, pdos: Iterable[ObjectChange]) -> None:
    """Disable PDOs before remapping."""
    for index in sorted({pdo.index & ~0x200 for pdo in pdos}):
        present = int.from_bytes(upload(station, index, 1), "little")
        if not present & cia301.INVALID:
            download(station, index, 1, (present | cia301.INVALID).to_bytes(LONGEST, "little"))


def _excluded_counts(station: Station, pdos: list[ObjectChange]) -> list[ObjectChange]:
    """Counts of mappings whose entries are restored, but not the count: each has to be 0 meanwhile."""
    mappings = {pdo.index for pdo in pdos if pdo.index & 0x200 and pdo.sub}
    excluded = sorted(mappings - {pdo.index for pdo in pdos if not pdo.sub})
    return [ObjectChange(index, 0, upload(station, index, 0), [b"\0"], TEMPORARY) for index in excluded]


def _excluded_identifiers(station: Station, pdos: list[ObjectChange]) -> list[ObjectChange]:
    """COB-IDs that are not restored, of PDOs that are: each has to be disabled meanwhile."""
    restored = {pdo.index for pdo in pdos if not pdo.index & 0x200 and pdo.sub == 1}
    excluded = sorted({pdo.index & ~0x200 for pdo in pdos} - restored)
    values = [(index, upload(station, index, 1)) for index in excluded]
    return [
        ObjectChange(
            index, 1, data, [(int.from_bytes(data, "little") | cia301.INVALID).to_bytes(LONGEST, "little")], TEMPORARY
        )
        for index, data in values
    ]


def _empty(station: Station, change: ObjectChange) -> None:
    """Set a mapping's count to 0 before its entries are written."""
    if change.index & 0x200 and change.sub and upload(station, change.index, 0) != b"\0":
        download(station, change.index, 0, b"\0")


def _write_back(
    station: Station,
    changes: list[ObjectChange],
    result: Restored,
    prepare: Callable[[ObjectChange], None] | None = None,
) -> list[ObjectChange]:
    """Write the previous values, in rounds; return the changes that were still refused."""
    for _ in range(ROUNDS):
        refused: list[ObjectChange] = []
        for change in changes:
            if _is_count_of_any(change, refused):
                refused.append(change)
                continue
            try:
                present = upload(station, change.index, change.sub)
                if present == change.before:
                    continue
                is_own = change.index in PDOS or not change.written or present in change.written
                if not is_own:
                    result.foreign.append(
                        f"{station.name}: {change.name} is {_hex(present)}, which the run did not write; before the run it "
                        f"was {_hex(change.before)}. It is left as it is."
                    )
                    station.journal.settle([change.address])
                    continue
                if prepare is not None:
                    prepare(change)
                download(station, change.index, change.sub, change.before)
            except SdoError:
                refused.append(change)
        changes = refused
    return changes


def _is_count_of_any(change: ObjectChange, refused: list[ObjectChange]) -> bool:
    """Whether a change is the count of a mapping of which an entry was refused."""
    return (
        change.index in PDOS and not change.sub and any(entry.sub and entry.index == change.index for entry in refused)
    )


def _verify(station: Station, changes: list[ObjectChange], left: list[ObjectChange], result: Restored) -> None:
    """Read everything back; restored values are removed from the journal."""
    for change in changes:
        if change.address not in station.journal.changes:
            continue
        try:
            present = upload(station, change.index, change.sub)
        except SdoError as error:
            result.failed.append(f"{station.name}: {change.name} was {_hex(change.before)} and cannot be read: {error}")
            continue
        if present == change.before:
            result.restored.append(change.name)
        else:
            why = "the drive refuses it" if change in left else "it reads otherwise"
            if _is_count_of_any(change, left):
                why = "the drive refuses one of its entries"
            result.failed.append(
                f"{station.name}: {change.name} is {_hex(present)} and was {_hex(change.before)} before the run: {why}."
            )
    unread = [unread_change.address for unread_change in station.journal.changes.values() if not unread_change.before]
    done = set(result.restored)
    station.journal.settle([*unread, *(change.address for change in changes if change.name in done)])


def _hex(data: bytes) -> str:
    """Bytes as the number that they are, in as many digits as it has."""
    return f"{data[::-1].hex().upper()}h"


# ---------------------------------------------------------------------------------------------------- journals on disk


def identity_of(station: Station) -> DriveIdentity:
    """1018h and node-ID; a number that cannot be read is 0."""
    numbers = []
    for sub in (1, 2, 4):
        try:
            numbers.append(station.sdo.number(0x1018, sub))
        except SdoError:
            numbers.append(0)
    return DriveIdentity(numbers[0], numbers[1], numbers[2], station.number)


def folder_of(keys: HardwareKeys) -> Path:
    """Folder of the journals of a hardware file's drives."""
    return bus_folder(keys.interface, keys.channel, keys.is_software(), keys.options)


def open_journal(station: Station, folder: Path) -> None:
    """Store the station's journal on disk from now on, including changes left by an earlier run."""
    identity = identity_of(station)
    station.journal.attach(JournalFile(journal_path(folder, identity), identity))


def begin(master: Master) -> None:
    """Before anything is written: open journals, and restore what an interrupted run left."""
    for station in master.stations.values():
        if not master.keys.simulated:
            open_journal(station, folder_of(master.keys))
        if not (count := len(station.journal.changes)):
            continue
        master.nmt(cia301.PRE_OPERATIONAL, station.number)
        result = restore(station, master.armed)
        if result.failed:
            raise SimulationError([*result.failed, f"{station.name}: an earlier run left these. The journal is kept."])
        master.recovered.append(
            f"{station.name}: an earlier run ended without restoring {count} objects; they were restored before this one."
        )
        master.recovered += result.foreign
        station.journal.history.clear()


def finish(master: Master) -> None:
    """After the stop. Never raises: what could not be restored goes to the master's notes, and its journal is kept."""
    for station in master.stations.values():
        journal = station.journal
        try:
            if journal.changes:
                _finish(master, station)
        except Exception as error:
            _unrestored(master, station, str(error))
        finally:
            journal.close()


def _finish(master: Master, station: Station) -> None:
    station.sdo.number(0x1000)  # a node that is gone is given up here
    station.sdo.attempts = ATTEMPTS
    master.nmt(cia301.PRE_OPERATIONAL, station.number)
    result = restore(station, master.armed)
    if result.failed or result.foreign:
        master.notes += [*result.failed, *result.foreign]
    master.restorations.append(
        f"{station.name}: {len(result.restored)} objects were changed for the run and are as before"
        + (f"; kept: {', '.join(result.retained)}" if result.retained else "")
    )


def _unrestored(master: Master, station: Station, why: str) -> None:
    """Add a note; simulated drives of this process end with it."""
    if (file := station.journal.file) is not None:
        names = [change.name for change in station.journal.changes.values()]
        master.notes.append(
            f"{station.name}: {len(names)} objects are not restored: {why} The journal is kept "
            f"({file.path}): `twin hil restore {station.number}`. They are "
            f"{', '.join(names[:SHOWN])}{', ...' if len(names) > SHOWN else '.'}"
        )
