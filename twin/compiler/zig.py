"""The tools inside the wheel `ziglang`: clang, LLD, and what makes archives.

Clang and LLD are called by their own names, which takes half the time of `zig cc` and needs no cache of zig's.
"""

from __future__ import annotations

import importlib.util
import os
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from twin import installed
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Mapping

PLACED = re.compile(r"^(?:\./)?(?P<place>[^\s:]+:\d+):\d+: (?:fatal )?error: (?P<message>.*)$", re.MULTILINE)
ERROR = re.compile(r"error: (?P<message>.*)$", re.MULTILINE)


@cache
def executable() -> Path:
    """The one binary that holds all tools; the package is found, not imported."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError("ziglang, which holds the C compiler, is not installed. Run: pip install ziglang")
    return Path(next(iter(spec.submodule_search_locations))) / ("zig.exe" if os.name == "nt" else "zig")


def version() -> str:
    """Decides, with what the tools are given, what they make."""
    return installed.version("ziglang")


def headers() -> Path:
    """The folder of `stdint.h`, `stdbool.h`, `stddef.h`: clang's own, the same for all targets."""
    return executable().parent / "lib" / "include"


def make(where: str, files: Mapping[str, str | bytes], *command: str, out: str, zig_cache: Path | None = None) -> bytes:
    """Run a tool in a temporary folder with these files and return the content of `out`. A failure is one line.

    `zig_cache`: where `zig cc` keeps the C library that it builds first; by default in the temporary folder.
    """
    import subprocess
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        for name, content in files.items():
            (directory / name).parent.mkdir(parents=True, exist_ok=True)
            (directory / name).write_bytes(content.encode() if isinstance(content, str) else content)
        done = subprocess.run(
            [str(executable()), *command],
            capture_output=True,
            cwd=directory,
            env=_environment(zig_cache or directory / "zig"),
            check=False,
        )
        if done.returncode:
            raise BuildError(f"{where}: {_reason(done.stderr.decode(errors='replace'), done.returncode)}")
        return (directory / out).read_bytes()


def _environment(zig_cache: Path) -> dict[str, str]:
    """The least that a process needs: variables such as CPATH would decide what is made."""
    passed = {name: os.environ[name] for name in ("PATH", "TMPDIR", "TEMP", "TMP", "SYSTEMROOT") if name in os.environ}
    folder = str(zig_cache)  # a home folder may be read-only
    return {**passed, "ZIG_LOCAL_CACHE_DIR": folder, "ZIG_GLOBAL_CACHE_DIR": folder}


def _reason(text: str, status: int) -> str:
    """Return the first error message of a tool, with its location if there is one."""
    if match := PLACED.search(text):
        return f"{match['place']}: {match['message'].strip()}"
    if match := ERROR.search(text):
        return match["message"].strip()
    return (text.strip().splitlines() or [f"{executable().name} ended with status {status} and no message"])[0]
