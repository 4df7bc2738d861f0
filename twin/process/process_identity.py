"""Who a process is, so that what a dead one left is told from what a living one uses: number and time of its start."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

PREFIX = "twin-"
MEMORY = Path("/dev/shm")  # noqa: S108 - of Linux
ROOM = 256 << 20  # that has to be free there [byte]
SMALL = 16 << 20  # files that may lie there [byte]


def started(pid: int) -> str:
    """When a process started, as the system counts; nothing if there is none, `0` where the system does not tell."""
    try:
        with Path(f"/proc/{pid}/stat").open("rb") as file:
            fields = file.read().rpartition(b")")[2].split()
        return "" if fields[0] in (b"Z", b"X") else fields[19].decode()
    except FileNotFoundError:
        if Path("/proc/self/stat").exists():
            return ""
    except (OSError, IndexError):
        return "0"
    return "0" if there(pid) else ""


def there(pid: int) -> bool:
    """Whether a process is there, on systems without /proc."""
    if os.name == "nt":  # where `os.kill` would end it
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
    """`1234-567890`: a process and its start."""
    pid = pid or os.getpid()
    return f"{pid}-{started(pid) or '0'}"


def alive(identity: str) -> bool:
    """Whether the process that `process_identity` named is there."""
    pid, _, start = identity.partition("-")
    return pid.isdecimal() and bool(start) and started(int(pid)) == start


def temporary() -> Path:
    """The system's folder for temporary files, as `tempfile` would find it."""
    candidates = (os.environ.get(name, "") for name in ("TMPDIR", "TEMP", "TMP"))
    return next((Path(path) for path in candidates if path and os.access(path, os.W_OK | os.X_OK)), Path("/tmp"))  # noqa: S108


def memory() -> Path | None:
    """Where small files that may be executed lie in memory; None where it is small, or somebody named another place.

    On a disk, to remove a folder takes a hundred times as long as here, and an FMU is five.
    """
    if any(map(os.environ.get, ("TMPDIR", "TEMP", "TMP"))) or not os.access(MEMORY, os.W_OK | os.X_OK):
        return None
    about = os.statvfs(MEMORY)
    return None if about.f_flag & os.ST_NOEXEC or about.f_bavail * about.f_frsize < ROOM else MEMORY


class Quick:
    """The folder in memory that somebody removes when this process has ended, if there is one."""

    folder = ""


def place_for(size: int) -> str | None:
    """Where temporary files of a size [byte] are to lie; None: where `tempfile` puts them."""
    return Quick.folder if Quick.folder and size <= SMALL else None


def folder_of(parent: Path, identity: str) -> Path:
    """The folder for temporary files of a run; what begins with its name is its process's too, and is swept with it."""
    return parent / f"{PREFIX}{identity}"


def sweep(parent: Path) -> None:
    """Remove the folders that dead runs left."""
    try:
        leftovers = [folder for folder in parent.iterdir() if folder.name.startswith(PREFIX)]
    except OSError:
        return
    for folder in leftovers:
        pid, start, *_ = [*folder.name.removeprefix(PREFIX).split("-"), ""]
        if pid.isdecimal() and start.isdecimal() and not alive(f"{pid}-{start}"):
            remove(folder)


def remove(folder: Path) -> None:
    """Remove a folder, as far as it goes."""
    with suppress(OSError):
        folder.rmdir()  # most are empty
        return
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


def memory_is_limited() -> bool:
    """Whether `ulimit -v` is set: then what cannot be loaded lacks memory."""
    try:
        import resource
    except ImportError:  # elsewhere than on Unix
        return False
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
