"""Identity of a process, its number and start time, and temporary folders that are removed when it is dead."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

PREFIX = "twin-"
MEMORY = Path("/dev/shm")  # noqa: S108 - of Linux
ROOM = 256 << 20  # space that must be free in MEMORY [byte]
SMALL = 16 << 20  # largest size of files in MEMORY [byte]


def start_time(pid: int) -> str:
    """Return the start time of a process in clock ticks of the system: empty if there is no process, `0` if unknown."""
    try:
        with Path(f"/proc/{pid}/stat").open("rb") as file:
            fields = file.read().rpartition(b")")[2].split()
        return "" if fields[0] in (b"Z", b"X") else fields[19].decode()
    except FileNotFoundError:
        if Path("/proc/self/stat").exists():
            return ""
    except (OSError, IndexError):
        return "0"
    return "0" if exists(pid) else ""


def exists(pid: int) -> bool:
    """Whether a process exists, on systems without /proc."""
    if os.name == "nt":  # `os.kill` would end the process on Windows
        import ctypes

        system = ctypes.windll.kernel32  # type: ignore[attr-defined,unused-ignore]
        handle = system.OpenProcess(0x100000, False, pid)
        alone = bool(handle) and system.WaitForSingleObject(handle, 0) == 0x102
        system.CloseHandle(handle)
        return alone
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def process_identity(pid: int = 0) -> str:
    """Return the identity of a process, by default of this one: number and start time, `1234-567890`."""
    pid = pid or os.getpid()
    return f"{pid}-{start_time(pid) or '0'}"


def alive(identity: str) -> bool:
    """Whether the process with an identity of `process_identity` still runs."""
    pid, _, start = identity.partition("-")
    return pid.isdecimal() and bool(start) and start_time(int(pid)) == start


def temporary_folder() -> Path:
    """Return the system's folder for temporary files, as `tempfile` would."""
    candidates = (os.environ.get(name, "") for name in ("TMPDIR", "TEMP", "TMP"))
    return next((Path(path) for path in candidates if path and os.access(path, os.W_OK | os.X_OK)), Path("/tmp"))  # noqa: S108


def memory_folder() -> Path | None:
    """Return the folder in memory for small executable files; None if it is too small or TMPDIR names another folder.

    Removing a folder takes a hundred times as long on a disk, and an FMU has five folders.
    """
    if any(map(os.environ.get, ("TMPDIR", "TEMP", "TMP"))) or not os.access(MEMORY, os.W_OK | os.X_OK):
        return None
    about = os.statvfs(MEMORY)
    return None if about.f_flag & os.ST_NOEXEC or about.f_bavail * about.f_frsize < ROOM else MEMORY


class MemoryFolder:
    """Folder in memory that the supervisor removes when this process has ended; empty if there is none."""

    folder = ""


def temporary_folder_for(size: int) -> str | None:
    """Return the folder for temporary files of a size [byte]; None: the default of `tempfile`."""
    return MemoryFolder.folder if MemoryFolder.folder and size <= SMALL else None


def folder_of(parent: Path, identity: str) -> Path:
    """Return the folder for temporary files of a process; `sweep` removes all folders with this prefix."""
    return parent / f"{PREFIX}{identity}"


def sweep(parent: Path) -> None:
    """Remove temporary folders of processes that no longer run."""
    try:
        leftovers = [folder for folder in parent.iterdir() if folder.name.startswith(PREFIX)]
    except OSError:
        return
    for folder in leftovers:
        pid, start, *_ = [*folder.name.removeprefix(PREFIX).split("-"), ""]
        if pid.isdecimal() and start.isdecimal() and not alive(f"{pid}-{start}"):
            remove(folder)


def remove(folder: Path) -> None:
    """Remove a folder; errors are ignored."""
    with suppress(OSError):
        folder.rmdir()  # fast path: most folders are empty
        return
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory_is_limited() -> bool:
    """Whether `ulimit -v` is set: then a library that cannot be loaded lacks memory."""
    try:
        import resource
    except ImportError:  # not on Unix
        return False
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
