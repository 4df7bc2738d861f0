"""Changes of a run in one node, with previous values."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hw_bridge.journal.file import JournalFile

Address = tuple[int, int]  # index and subindex


@dataclass
class ObjectChange:
    """One changed object: previous and written bytes; `before` empty: it could not be read.

    `written` has every value that this program wrote; empty: process data wrote it.
    """

    index: int
    sub: int
    before: bytes
    written: list[bytes] = field(default_factory=list)
    reason: str = ""

    @property
    def address(self) -> Address:
        """Index and subindex."""
        return self.index, self.sub

    @property
    def name(self) -> str:
        """`607Dh.1`."""
        return f"{self.index:04X}h.{self.sub}"


class Journal:
    """The changes of one node, in the order of their first write; also in a file, if one is attached."""

    def __init__(self) -> None:
        self.changes: dict[Address, ObjectChange] = {}
        self.history: list[ObjectChange] = []  # of changes that were restored or kept
        self.file: JournalFile | None = None

    def attach(self, file: JournalFile) -> None:
        """Store the changes in a file from now on; its present ones are read first."""
        self.file = file
        for number, row in enumerate(file.changes, 2):
            try:
                self._take(row)
            except (KeyError, ValueError, TypeError):
                raise SimulationError(
                    f"{file.path}:{number}: is no line of a journal; the file is kept. Move it away."
                ) from None

    def _take(self, row: dict[str, Any]) -> None:
        address = int(row["index"], 16), int(row["sub"])
        if row.get("done"):
            self.changes.pop(address, None)
            return
        values = [bytes.fromhex(row["after"])] if row["after"] is not None else []
        recorded = self.changes.get(address)
        if recorded is None:
            self.changes[address] = ObjectChange(*address, bytes.fromhex(row["before"]), values, str(row["reason"]))
        else:
            recorded.written += values

    def record(self, changes: Iterable[ObjectChange]) -> None:
        """Record writes that are about to be made. On return they are on the disk, if a file is attached."""
        rows = []
        for change in changes:
            recorded = self.changes.get(change.address)
            if recorded is None:
                self.changes[change.address] = replace(change, written=list(change.written))
            elif set(change.written) <= set(recorded.written):
                continue
            else:
                recorded.written += change.written
            rows.append(_row(change))
        if rows and self.file is not None:
            self.file.append(rows)

    def settle(self, addresses: Iterable[Address]) -> None:
        """Remove changes that were restored, or are to stay."""
        changes = [self.changes.pop(address) for address in addresses if address in self.changes]
        self.history += changes
        if changes and self.file is not None:
            with suppress(SimulationError):  # the disk is full: a later restoration finds these as they were
                self.file.append(
                    {"index": f"{change.index:04X}", "sub": change.sub, "done": True} for change in changes
                )

    def close(self) -> None:
        """Close the file, and remove it if no changes are left."""
        if self.file is not None:
            self.file.close(remove=not self.changes)
            self.file = None


def _row(change: ObjectChange) -> dict[str, Any]:
    return {
        "index": f"{change.index:04X}",
        "sub": change.sub,
        "size": len(change.before),
        "before": change.before.hex(),
        "after": change.written[-1].hex() if change.written else None,
        "reason": change.reason,
    }
