"""One journal file: a header line with the drive's identity, then a line for each write, each with its checksum.

A line is flushed to the disk before the drive is written. A last line without its end was therefore never acted upon.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

VERSION = 1
LARGEST = 4_000_000  # bytes


class DriveIdentity(NamedTuple):
    """1018h.1, .2 and .4, and the node-ID, which is in the COB-IDs that are restored."""

    vendor: int
    product: int
    serial: int
    node: int

    @property
    def text(self) -> str:
        """Format the identity."""
        return f"vendor {self.vendor:X}h, product {self.product:X}h, serial {self.serial:X}h at node {self.node}"


def journal_path(folder: Path, identity: DriveIdentity) -> Path:
    """Path of a drive's journal."""
    return folder / f"{identity.vendor:X}-{identity.product:X}-{identity.serial:X}-node{identity.node}.jsonl"


def encode(row: dict[str, Any]) -> bytes:
    """Encode a row with the checksum of its content."""
    text = json.dumps(row, ensure_ascii=True, sort_keys=True)
    return (
        json.dumps({"row": row, "crc": zlib.crc32(text.encode())}, ensure_ascii=True, sort_keys=True).encode() + b"\n"
    )


def decode(line: bytes) -> dict[str, Any]:
    """Decode the content of a line; ValueError where its checksum is wrong."""
    line_content = json.loads(line)
    row = line_content["row"]
    if (
        not isinstance(row, dict)
        or zlib.crc32(json.dumps(row, ensure_ascii=True, sort_keys=True).encode()) != line_content["crc"]
    ):
        raise ValueError("checksum")
    return row


class JournalFile:
    """A journal on disk, locked by the process that holds it open. `rows`: what it held when it was opened."""

    def __init__(self, path: Path, identity: DriveIdentity) -> None:
        """Open or create it. SimulationError if it is damaged, of another drive, or in use; it is kept in each case."""
        self.path, self.identity = path, identity
        self._open()
        try:
            self._lock()
            while not self._is_at_its_path():  # the program that held it has removed it meanwhile
                self.file.close()
                self._open()
                self._lock()
            self.rows = self._read()
            if not self.rows:
                self.file.seek(0)
                self.file.truncate()
                self.append([{"journal": VERSION, **identity._asdict()}])
                self._sync_folder()
        except BaseException:
            self.file.close()
            raise

    @property
    def changes(self) -> list[dict[str, Any]]:
        """Its lines without the header."""
        return self.rows[1:]

    def _open(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.file = self.path.open("a+b", buffering=0)  # nothing is left to write when it is closed
        except OSError as error:
            raise SimulationError(
                f"{self.path}: cannot be written: {error.strerror}. No drive is written without a journal: set TWIN_STATE to "
                f"a folder that can be."
            ) from None

    def _is_at_its_path(self) -> bool:
        """Whether the locked file is the one that the next process finds."""
        try:
            return os.path.samestat(os.fstat(self.file.fileno()), self.path.stat())
        except FileNotFoundError:
            return False

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:  # no such locks on this system
            return
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SimulationError(
                f"{self.path}: a running program holds the journal of this drive ({self.identity.text}). End it first."
            ) from None

    def _read(self) -> list[dict[str, Any]]:
        self.file.seek(0)
        data = self.file.read(LARGEST + 1)
        lines = data.split(b"\n")
        if len(data) <= LARGEST and lines[-1]:  # its write never ended: what it announces was not done
            self.file.truncate(len(data) - len(lines[-1]))
        rows = []
        for number, line in enumerate(lines[:-1], 1):
            try:
                if len(data) > LARGEST:
                    raise ValueError("too long")  # noqa: TRY301 - as all else that is wrong with it
                rows.append(decode(line))
            except (ValueError, KeyError, TypeError, RecursionError):
                raise SimulationError(
                    f"{self.path}:{number}: the journal of {self.identity.text} is damaged; it is kept. Compare the drive "
                    f"with a dump (twin hil compare), restore it from there, then move this file away."
                ) from None
        if rows:
            own = {key: rows[0].get(key) for key in DriveIdentity._fields}
            if rows[0].get("journal") != VERSION or own != self.identity._asdict():
                raise SimulationError(
                    f"{self.path}:1: expected a journal of {self.identity.text}, found one of {own}; it is kept and not "
                    f"applied. Move it away."
                )
        return rows

    def append(self, rows: Iterable[dict[str, Any]]) -> None:
        """Write lines and flush them to the disk: all of them, or none and SimulationError."""
        data, end = b"".join(map(encode, rows)), self.file.seek(0, os.SEEK_END)
        try:
            if self.file.write(data) != len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # noqa: TRY301 - as if nothing had been written
            os.fsync(self.file.fileno())
        except OSError as error:
            with suppress(OSError):  # a part of a line would spoil the next one
                self.file.truncate(end)
            raise SimulationError(
                f"{self.path}: cannot be written: {error.strerror}. The drive is not written."
            ) from None

    def _sync_folder(self) -> None:
        with suppress(OSError, AttributeError):  # not every system lets folders be flushed
            folder = os.open(self.path.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)

    def close(self, remove: bool) -> None:
        """Close it; `remove`: nothing is left to restore."""
        if self.file.closed:
            return
        if remove:  # before the lock is gone
            with suppress(OSError):
                self.path.unlink()
        self.file.close()
