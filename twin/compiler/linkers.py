"""Objects become a shared library: one function per format. Each refers to libm alone, and says which."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from twin.compiler import libm, zig
from twin.compiler.platforms import PLATFORMS

if TYPE_CHECKING:
    from collections.abc import Mapping

SELF = Path(__file__).read_bytes() + libm.SELF  # in the keys of the store


def elf(target: str, objects: Mapping[str, bytes], build: Path, own: Path | None) -> bytes:
    """`ld.lld`; `own` is the libm to bind to instead of the oldest."""
    platform = PLATFORMS[target]
    files = dict(objects) if own else {**objects, "libm.so": libm.elf(target, build)}
    return zig.make(
        target,
        files,
        "ld.lld",
        "-m",
        platform.machine,
        "-shared",
        "-o",
        "library.so",
        "--strip-all",
        "--gc-sections",
        "--build-id=none",
        "--hash-style=gnu",
        "-z",
        "defs",
        "-z",
        "now",
        *objects,
        "--as-needed",
        str(own or "libm.so"),
        out="library.so",
    )


def coff(target: str, objects: Mapping[str, bytes], build: Path, _: Path | None) -> bytes:
    """`lld-link`; no C runtime starts the library, so it carries the little that one needs."""
    files = {**objects, "carried.o": libm.carried(target, build), "m.lib": libm.coff(target, build)}
    return zig.make(
        target,
        files,
        "lld-link",
        "/dll",
        f"/machine:{PLATFORMS[target].machine}",
        "/out:library.dll",
        "/noimplib",
        "/nodefaultlib",
        "/entry:DllMainCRTStartup",
        "/opt:ref",
        "/brepro",
        *files,
        out="library.dll",
    )


def macho(target: str, objects: Mapping[str, bytes], build: Path, _: Path | None) -> bytes:
    """Zig's own linker, the only one here for this format; it signs what processors by Apple would not run unsigned."""
    files = {**objects, "carried.o": libm.carried(target, build)}
    return zig.make(
        target,
        files,
        "cc",
        "-target",
        f"{PLATFORMS[target].machine}.11.0",
        "-shared",
        "-nostdlib",
        "-s",
        "-Wl,-install_name,@rpath/library.dylib",
        "-Wl,-dead_strip",
        *files,
        "-o",
        "library.dylib",
        out="library.dylib",
    )


LINKERS = {"elf": elf, "coff": coff, "macho": macho}
