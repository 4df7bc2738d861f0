"""Content-addressed store of generated files: C, object files, libraries, FMUs, and what else can be made again.

An entry is a folder `NAME-KEY` with files and their SHA-256 sums in the format of `sha256sum`. The key is a hash of all
inputs: sources, options and versions of tools. One rule each:

- validity: an entry counts if every file belongs to this user or root, is not writable by others, and has its sum. It may be
  native code that will be loaded.
- damage: an entry that does not count is removed and made again.
- eviction: above `CAPACITY` the least recently used entries are removed, except those used within `RECENT` seconds.
- concurrency: an entry appears by renaming a folder. `Store.shared` holds off `clear` while a file is used by its path.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

SUMS = "SHA256SUMS"
LOCK = ".lock"
CAPACITY = 500_000_000  # [byte]
RECENT = 3600.0  # [s]
WRITABLE_BY_OTHERS = 0o022
ENTRY = re.compile(r"\.?[\w.-]+-[0-9a-f]{32}(\.\d+\.\d+)?")  # with a dot and two numbers: being written

_creation: dict[Path, threading.Lock] = {}  # of entries that were asked for: one thread makes an entry, others wait


def make_key(*parts: str | bytes) -> str:
    """Hash a sequence of parts; no two sequences are joined to the same bytes."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        digest.update(b"%d " % len(data) + data)
    return digest.hexdigest()[:32]


class Store:
    """The store of a build folder."""

    _evicted: set[Path] = set()  # noqa: RUF012 - shared: a process evicts at most once from a folder

    def __init__(self, build: Path) -> None:
        self.folder = build.absolute() / "cache"

    def path(self, name: str, key: str) -> Path:
        """Folder of an entry, whether it exists or not."""
        return self.folder / f"{name}-{key}"

    def get(self, name: str, key: str) -> dict[str, bytes] | None:
        """Files of an entry by name; None if there is no valid one."""
        entry = self.path(name, key)
        try:
            files = dict(read_files(entry))
        except (OSError, ValueError):
            return None
        with suppress(OSError):  # another user's entry
            os.utime(entry)  # for eviction
        return files

    def put(self, name: str, key: str, files: Mapping[str, bytes]) -> None:
        """Create an entry, unless a valid one is there already. OSError names the entry."""
        entry = self.path(name, key)
        partial = entry.with_name(f".{entry.name}.{os.getpid()}.{threading.get_ident()}")
        with self.shared():
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                partial.mkdir(mode=0o755)
                sums = "".join(f"{hashlib.sha256(data).hexdigest()}  {file}\n" for file, data in files.items())
                for file, data in {**files, SUMS: sums.encode()}.items():
                    with open(os.open(partial / file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as stream:
                        stream.write(data)
                if self.get(name, key) is None:
                    shutil.rmtree(entry, ignore_errors=True)
                    try:
                        partial.rename(entry)
                    except OSError:
                        if self.get(name, key) is None:  # else another process was faster
                            raise
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(entry)) from error
            finally:
                shutil.rmtree(partial, ignore_errors=True)
        self.evict()

    def get_or_create(self, name: str, key: str, create: Callable[[], Mapping[str, bytes]]) -> Mapping[str, bytes]:
        """Files of an entry by name; `create` makes them if there is no valid entry; other threads wait for it."""
        with _creation.setdefault(self.path(name, key), threading.Lock()):
            files: Mapping[str, bytes] | None = self.get(name, key)
            if files is None:
                files = create()
                self.put(name, key, files)
        return files

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Hold off `clear` in other processes, so that entries stay where they are."""
        with self._locked(exclusive=False):
            yield

    @contextmanager
    def _locked(self, *, exclusive: bool) -> Iterator[None]:
        try:
            import fcntl

            self.folder.mkdir(parents=True, exist_ok=True)
            file = os.open(self.folder / LOCK, os.O_RDONLY | os.O_CREAT, 0o644)
        except (ImportError, OSError):  # Windows keeps open files by itself; a folder that is read-only is not cleared
            yield
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH)
            yield
        finally:
            os.close(file)

    def entries(self) -> list[tuple[float, int, Path]]:
        """Time of last use [s since the epoch], size [byte] and folder of all entries, the least recently used first."""
        entries = []
        for entry in self.folder.iterdir() if self.folder.is_dir() else ():
            if ENTRY.fullmatch(entry.name) and entry.is_dir() and not entry.is_symlink():
                with suppress(FileNotFoundError):  # removed by another process
                    size = sum(file.stat().st_size for file in entry.iterdir())
                    entries.append((entry.stat().st_mtime, size, entry))
        return sorted(entries)

    def evict(self) -> None:
        """Remove the least recently used entries above the capacity; at most once per process, since it looks at all of them."""
        if self.folder in self._evicted:
            return
        self._evicted.add(self.folder)
        entries = self.entries()
        excess = sum(size for _, size, _ in entries) - CAPACITY
        for last_use, size, entry in entries:
            if excess <= 0 or last_use > time.time() - RECENT:
                return
            shutil.rmtree(entry, ignore_errors=True)
            excess -= size

    def clear(self) -> list[tuple[float, int, Path]]:
        """Remove all entries, and nothing else; return those removed. Waits while another process uses one by its path."""
        with self._locked(exclusive=True):
            entries = self.entries()
            for _, _, entry in entries:
                shutil.rmtree(entry)
        return entries


def read_files(entry: Path) -> Iterator[tuple[str, bytes]]:
    """Name and content of each file of an entry; ValueError if one is damaged, missing or additional."""
    lines = [line.partition("  ") for line in read_own(entry / SUMS).decode().splitlines()]
    if sorted([*(name for _, _, name in lines), SUMS]) != sorted(file.name for file in entry.iterdir()):
        raise ValueError(f"{entry}: is incomplete")
    for expected, _, name in lines:
        data = read_own(entry / name)
        if hashlib.sha256(data).hexdigest() != expected:
            raise ValueError(f"{entry / name}: is damaged")
        yield name, data


def read_own(path: Path) -> bytes:
    """Content of a file; ValueError if another user than this one and root owns it, or may write to it."""
    with path.open("rb") as file:
        status = os.fstat(file.fileno())
        if hasattr(os, "geteuid") and (status.st_uid not in (os.geteuid(), 0) or status.st_mode & WRITABLE_BY_OTHERS):
            raise ValueError(f"{path}: another user may have written it")
        return file.read()
