"""Atomic file writes."""

from __future__ import annotations

import os
import stat
import threading
from contextlib import suppress
from pathlib import Path


def write_atomically(path: Path, data: bytes | str, mode: int = -1) -> None:
    """Write a file under a temporary name and rename it; a failed write leaves no file. Text is UTF-8.

    `mode`: mask of the default permissions.

    Raises OSError with `path` in it: the system's own error for a full disk names no file.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)
        if os.name == "posix" and mode != -1:
            partial.chmod(stat.S_IMODE(partial.stat().st_mode) & mode)
        partial.replace(path)
    except BaseException as error:
        with suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
