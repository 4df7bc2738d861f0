"""Stubs of libm, the only library that a component links to: names without code, independent of a libc.

Linux    libm.so.6 with the versions that glibc 2.17 has
Windows  ucrtbase.dll, by an import library; and the few lines every library carries that has no C runtime
"""

from __future__ import annotations

import ctypes
import re
from functools import cache
from pathlib import Path

from twin.compiler import zig
from twin.compiler.platforms import LIBM, PLATFORMS
from twin.store import Store, make_key

# clang joins a sine and a cosine of one angle into one call where it believes the system to have one. glibc's gives the
# bits of the two (tests/compiler); macOS' is not known to, and Windows has none: there a library carries its own
PAIR = "sincos"
CARRIED_MACHO = """\
typedef struct { double sine, cosine; } pair;
double sin(double), cos(double);
__attribute__((visibility("hidden"))) pair __sincos_stret(double x) { pair both = {sin(x), cos(x)}; return both; }
"""

# the entry point, the mark of code that uses floating point, the pair, and the probe of stacks beyond a page, which
# touches each page of the rax bytes below the caller's frame in turn and changes no register
CARRIED_COFF = """\
double sin(double), cos(double);
int _fltused = 1;
int DllMainCRTStartup(void *library, unsigned reason, void *reserved) { return 1; }
void sincos(double x, double *sine, double *cosine) { double s = sin(x); *cosine = cos(x); *sine = s; }
__asm__(
    ".globl ___chkstk_ms\\n"
    "___chkstk_ms:\\n"
    "  pushq %rcx\\n"
    "  pushq %rax\\n"
    "  leaq 24(%rsp), %rcx\\n"
    "1: cmpq $0x1000, %rax\\n"
    "  jb 2f\\n"
    "  subq $0x1000, %rcx\\n"
    "  orq $0, (%rcx)\\n"
    "  subq $0x1000, %rax\\n"
    "  jmp 1b\\n"
    "2: subq %rax, %rcx\\n"
    "  orq $0, (%rcx)\\n"
    "  popq %rax\\n"
    "  popq %rcx\\n"
    "  ret\\n"
);
"""

SELF = Path(__file__).read_bytes()  # in the keys of the store: these lines decide what is made

CARRIED = {"coff": CARRIED_COFF, "macho": CARRIED_MACHO}


def _object(target: str, text: str) -> bytes:
    """Object file of a few lines that must be compiled as they stand."""
    platform = PLATFORMS[target]
    options = (
        "-target",
        platform.triple,
        *platform.options,
        "-O2",
        "-ffunction-sections",
        "-fno-builtin",
        "-fno-stack-protector",
        "-fno-ident",
        "-w",
        "-c",
        "m.c",
        "-o",
        "m.o",
    )
    return zig.make(target, {"m.c": text}, "clang", *options, out="m.o")


def elf(target: str, build: Path) -> bytes:
    """`libm.so.6` of a platform: every function a component may call, none with a body."""
    platform, names = PLATFORMS[target], sorted({*LIBM, PAIR})
    text = "".join(f"void {name}(void) {{}}\n" for name in names)
    script = f"{platform.libm} {{ global: {'; '.join(names)}; local: *; }};\n"

    def create() -> dict[str, bytes]:
        files: dict[str, str | bytes] = {"m.o": _object(target, text), "m.map": script}
        command = (
            "ld.lld",
            "-m",
            platform.machine,
            "-shared",
            "-soname",
            "libm.so.6",
            "--version-script",
            "m.map",
            "-o",
            "m.so",
            "m.o",
        )
        return {"m.so": zig.make(target, files, *command, out="m.so")}

    return Store(build).get_or_create("libm", _key(target), create)["m.so"]


@cache
def newest() -> Path | None:
    """The libm of this process: to link against it takes each function's newest version, without old wrappers."""
    try:
        ctypes.CDLL("libm.so.6")
        maps = Path("/proc/self/maps").read_text()
    except OSError:
        return None
    match = re.search(r"(/\S*/libm(?:\.so\.6|-2\.\d+\.so))$", maps, re.MULTILINE)
    return Path(match[1]) if match else None


def coff(target: str, build: Path) -> bytes:
    """Import library of `ucrtbase.dll`, which is part of every Windows since 10."""
    text = "\n".join(["LIBRARY ucrtbase.dll", "EXPORTS", *sorted(LIBM), ""])

    def create() -> dict[str, bytes]:
        command = ("dlltool", "-m", "i386:x86-64", "-d", "m.def", "-l", "m.lib")
        return {"m.lib": zig.make(target, {"m.def": text}, *command, out="m.lib")}

    return Store(build).get_or_create("libm", _key(target), create)["m.lib"]


def carried(target: str, build: Path) -> bytes:
    """What a library carries of its own since no library of the system has it for certain."""
    text = CARRIED[PLATFORMS[target].format]
    return Store(build).get_or_create("carried", _key(target), lambda: {"carried.o": _object(target, text)})[
        "carried.o"
    ]


def _key(target: str) -> str:
    """Key of what is made for a platform: this module's text, the platform's row, the tools."""
    return make_key(SELF, zig.version(), target, str(PLATFORMS[target]), *sorted(LIBM))
