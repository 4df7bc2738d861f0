"""The tools inside the wheel `ziglang`: clang, LLD, and what makes archives; and the cache of what they made.

Clang and LLD are called by their own names, which takes half the time of `zig cc` and needs no cache of zig's.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from twin import installed
from twin.errors import BuildError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

PLACED = re.compile(r"^(?:\./)?(?P<place>[^\s:]+:\d+):\d+: (?:fatal )?error: (?P<message>.*)$", re.MULTILINE)
HASH = 32  # bytes of the hash at the end of a cache file
WRITABLE_BY_OTHERS = 0o022
ERROR = re.compile(r"error: (?P<message>.*)$", re.MULTILINE)


@cache
def executable() -> Path:
    """The one binary that holds all tools; the package is found, not imported."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError("ziglang, which holds the C compiler, is not installed. Run: pip install ziglang")
    return Path(next(iter(spec.submodule_search_locations))) / ("zig.exe" if os.name == "nt" else "zig")


@cache
def version() -> str:
    """Decides, with what the tools are given, what they make."""
    return installed.version("ziglang")


def headers() -> Path:
    """The folder of `stdint.h`, `stdbool.h`, `stddef.h`: clang's own, the same for all targets."""
    return executable().parent / "lib" / "include"


def make(where: str, build: Path, files: Mapping[str, str | bytes], *command: str, out: str) -> bytes:
    """Run a tool in a temporary folder with these files and return the content of `out`. A failure is one line."""
    import subprocess
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        for name, content in files.items():
            (directory / name).write_bytes(content.encode() if isinstance(content, str) else content)
        done = subprocess.run(
            [str(executable()), *command], capture_output=True, cwd=directory, env=_environment(build), check=False
        )
        if done.returncode:
            raise BuildError(f"{where}: {_reason(done.stderr.decode(errors='replace'), done.returncode)}")
        return (directory / out).read_bytes()


def _environment(build: Path) -> dict[str, str]:
    """The least that a process needs: variables such as CPATH would decide what is made."""
    passed = {name: os.environ[name] for name in ("PATH", "TMPDIR", "TEMP", "TMP", "SYSTEMROOT") if name in os.environ}
    cache_folder = str(build.resolve() / "zig")  # zig cc has one; a home folder may be read-only
    return {**passed, "ZIG_LOCAL_CACHE_DIR": cache_folder, "ZIG_GLOBAL_CACHE_DIR": cache_folder}


def _reason(text: str, status: int) -> str:
    """Return the first error message of a tool, with its location if there is one."""
    if match := PLACED.search(text):
        return f"{match['place']}: {match['message'].strip()}"
    if match := ERROR.search(text):
        return match["message"].strip()
    return (text.strip().splitlines() or [f"{executable().name} ended with status {status} and no message"])[0]


def digest(*parts: str | bytes) -> str:
    """Hash of a sequence of parts; no two sequences are joined to the same."""
    hasher = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        hasher.update(b"%d " % len(data) + data)
    return hasher.hexdigest()[:32]


def put(path: Path, data: bytes) -> None:
    """Write a file atomically, writable by its owner only."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, data, mode=~WRITABLE_BY_OTHERS)


def read_own(path: Path) -> bytes:
    """Content of a file of the cache; PermissionError if another user owns it, or may write to it.

    What the cache holds is native code that will be loaded.
    """
    with path.open("rb") as file:
        refuse_foreign(os.fstat(file.fileno()), path)
        return file.read()


def refuse_foreign(status: os.stat_result, path: Path) -> None:
    """PermissionError if a file can be changed by others than this user and root."""
    if not hasattr(os, "geteuid"):
        return
    if status.st_uid not in (os.geteuid(), 0) or status.st_mode & WRITABLE_BY_OTHERS:
        raise PermissionError(f"{path}: another user may have written it")


def get_or_create(path: Path, make_: Callable[[], bytes]) -> bytes:
    """Return the content of a cache file; create it if it is missing or does not match the hash at its end."""
    with contextlib.suppress(OSError):
        content = read_own(path)
        data = content[:-HASH]
        if content[-HASH:] == hashlib.sha256(data).digest():
            return data
    data = make_()
    put(path, data + hashlib.sha256(data).digest())
    return data
