"""C becomes objects, shared libraries, archives, and code in this process: the door to the C compiler.

No library links a libc (decision 0014): nothing of one is ever built, and the first build takes as long as any other.
What is made depends on the text, the target and the version of ziglang alone, to the byte.
"""

from __future__ import annotations

import ctypes
import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from twin.compiler import libm, linkers, machine, zig
from twin.compiler.platforms import BARE, LIBM, PLATFORMS, host
from twin.errors import BuildError
from twin.process import cores
from twin.store import Store, make_key

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

__all__ = [
    "BARE",
    "LIBM",
    "PLATFORMS",
    "SYNTAX",
    "archive",
    "compile_c",
    "host",
    "in_order",
    "link",
    "load",
    "side_by_side",
]

T = TypeVar("T")

# who works with syntax trees holds it: CPython 3.11 counts the depth of all threads' trees in one place, and fails then
SYNTAX = threading.RLock()

# each line is one promise
OPTIONS = (
    "-std=c11", "-O3",
    "-fno-math-errno",                                              # else no call of libm may be moved or left out
    "-ffp-contract=off", "-mllvm", "-disable-fp-call-folding",      # rounded as Python does, by the libm that runs
    "-fno-builtin-pow", "-include", "pure.h",                       # x**2.0 is not always x*x, nor 10.0**x exp10(x)
    "-fwrapv", "-fno-strict-aliasing",                              # nothing a component does is undefined
    "-fno-slp-vectorize",                                           # pairs of doubles are packed for less than it costs
    "-mllvm", "-unroll-full-max-count=32",                          # long loops unrolled take a second to compile
    "-mllvm", "-disable-loop-idiom-memset",                         # loops stay loops: there is no memset to call
    "-mllvm", "-disable-loop-idiom-memcpy",
    "-fno-builtin-memset", "-fno-builtin-memcpy", "-fno-builtin-memmove", "-fno-builtin-memcmp", "-fno-builtin-bcmp",
    "-fno-builtin-strlen", "-fno-builtin-wcslen",
    "-fvisibility=hidden", "-fno-stack-protector", "-fomit-frame-pointer",
    "-g0", "-fno-ident",                                            # nothing of where it was made
)  # fmt: skip

# not a builtin, but still a function of its arguments alone: calls may be joined, and memory is kept in registers
PURE = "double pow(double, double) __attribute__((const));\n"


def compile_c(
    text: str,
    target: str,
    build: Path,
    *,
    headers: Mapping[str, str] = {},
    options: Sequence[str] = (),
    name: str = "component.c",
) -> bytes:
    """Object file of one C file, from the store of `build` if it is there; messages call the file `name`.

    `headers` lie beside the file. `options` come last, and win. Symbols are hidden but where the text says otherwise.
    """
    if target not in PLATFORMS and target not in BARE:
        raise BuildError(f"platform {target!r} is not known. Use one of {', '.join([*PLATFORMS, *BARE])}.")
    platform = PLATFORMS[target] if target in PLATFORMS else BARE[target]
    files = {**headers, "pure.h": PURE, name: text}
    command = ["-target", platform.triple, *OPTIONS, *platform.options, *options, "-c", name, "-o", "object.o"]
    key = make_key(zig.version(), *command, *(part for file in sorted(files.items()) for part in file))

    def compiled() -> dict[str, bytes]:
        include = "-nostdinc", "-isystem", str(zig.headers())
        return {"object.o": zig.make(target, files, "clang", *include, *command, out="object.o")}

    return Store(build).get_or_create(Path(name).stem, key, compiled)["object.o"]


# --------------------------------------------------------------------------------------------------- objects to a library


def link(target: str, objects: Sequence[bytes], build: Path, *, newest: bool = False) -> bytes:
    """Shared library of object files, which exports what they do not hide.

    `newest` is for a library that stays on this machine: glibc's newest versions of functions are its fastest.
    """
    if target not in PLATFORMS:
        raise BuildError(f"platform {target!r} has no shared libraries. Use one of {', '.join(PLATFORMS)}.")
    own = libm.newest() if newest and target == host() else None
    named = {f"{number}.o": data for number, data in enumerate(objects)}
    return linkers.LINKERS[PLATFORMS[target].format](target, named, build, own)


def archive(target: str, objects: Mapping[str, bytes]) -> bytes:
    """Static library of object files by their names, in their order."""
    return zig.make(target, objects, "ar", "rcsD", "library.a", *objects, out="library.a")


# ----------------------------------------------------------------------------------------------------- into this process


def load(name: str, objects: Sequence[bytes], build: Path, symbols: tuple[str, ...]) -> tuple[int, ...]:
    """Link object files for this machine and load them into this process; addresses of symbols, valid as long as the process."""
    store, file = Store(build), f"library{PLATFORMS[host()].suffix}"
    libc = (os.confstr("CS_GNU_LIBC_VERSION") or "") if libm.newest() else ""
    key = make_key(linkers.SELF, zig.version(), host(), libc, *objects)
    with store.shared():
        store.get_or_create(name, key, lambda: {file: link(host(), objects, build, newest=True)})
        path = store.path(name, key) / file
        try:
            library = ctypes.CDLL(str(path))
        except OSError as error:
            raise BuildError(
                f"{path}: cannot be loaded: {error}. Give --build a folder that programs may run in."
            ) from None
    return tuple(machine.address_of(library[symbol]) for symbol in symbols)


def in_order(tasks: Iterable[Callable[[], T]]) -> Iterator[T]:
    """Results of tasks, each as soon as those before it are there.

    One more runs at a time than there are cores: the tools are processes, Python has one core.
    """
    waiting = list(tasks)
    if not waiting:
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(max(1, min(cores() + 1, len(waiting)))) as pool:
        yield from pool.map(lambda task: task(), waiting)


def side_by_side(tasks: Iterable[Callable[[], T]]) -> list[T]:
    """Results of tasks in their order."""
    return list(in_order(tasks))
