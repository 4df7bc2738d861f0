"""Shared libraries that need a C library: sources of other tools, compiled by `zig cc` and kept in the store."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from twin.compiler import zig
from twin.compiler.platforms import host
from twin.errors import BuildError
from twin.store import WRITABLE_BY_OTHERS, Store, make_key

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
    "x86_64-windows": "x86_64-windows-gnu",
}
OPTIONS = ("-shared", "-fPIC", "-O2", "-w")
C_PLUS_PLUS = (".cpp", ".cc", ".cxx")
# what the options of a foreign build description may be: nothing that runs a program, or names a file outside
ALLOWED = re.compile(
    r"-[DU]\w.*|-O([0-3sz]|fast)|-std=[\w+]+|-W(?![alp],)[\w+=-]*|-w|-g\d?|-pedantic(-errors)?|-m[\w=.+-]+|-l[\w.+-]+|-pthread"
    r"|-I(?!/)(?!.*\.\.).*|-f(no-[\w-]+|PIC|pic|wrapv|exceptions|(un)?signed-char|visibility=\w+|fp-contract=\w+|strict-aliasing)"
)


def build_hosted_library(
    name: str, files: Mapping[str, bytes], sources: Sequence[str], options: Sequence[str], build: Path
) -> bytes:
    """Compile and link a shared library for this machine; the same inputs are compiled once. BuildError if it fails.

    `files`: all files by their path, `sources`: those to compile, `options`: for the compiler; paths are relative to the files.
    """
    if refused := [option for option in options if not ALLOWED.fullmatch(option)]:
        raise BuildError(f"the compiler option {refused[0][:40]} is not allowed")
    target = TARGETS[host()]
    compiler = "c++" if any(source.endswith(C_PLUS_PLUS) for source in sources) else "cc"
    libraries = () if target.endswith("windows-gnu") else ("-lm",)
    command = (compiler, "-target", target, *OPTIONS, *options, *sources, *libraries, "-o", "library")
    parts = [part for item in sorted(files.items()) for part in item]
    key = make_key(zig.version(), *command, *parts)

    def compiled() -> dict[str, bytes]:
        return {"library": zig.make(name, files, *command, out="library", zig_cache=private_cache(build))}

    return Store(build).get_or_create(name, key, compiled)["library"]


def private_cache(build: Path) -> Path | None:
    """Folder in the store for the C library that `zig cc` builds at first, which takes 10 s; None if others can write there."""
    folder = Store(build).path("zig-cc", make_key(zig.version()))
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError:
        return None
    is_own = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
    return folder if is_own and not status.st_mode & WRITABLE_BY_OTHERS else None
