"""What differs between platforms, as tables; each row is what the tools are told, nothing else knows a platform."""

from __future__ import annotations

import os
import sysconfig
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Platform:
    """A platform with an operating system: clang's triple and options, how to link for it, the suffix of its libraries."""

    triple: str
    format: str  # "elf", "coff" or "macho"
    machine: str  # what the linker calls the processor
    libm: str  # the oldest version of the symbols of libm, where it has versions
    suffix: str
    options: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Bare:
    """A processor without an operating system: its code is linked into a firmware, never loaded."""

    triple: str
    suffix: str
    options: tuple[str, ...]


# libraries may lie anywhere; libm is called at once, not by way of a table of jumps; code must not call helpers for
# atomics, which are a compiler's runtime library; Windows cannot walk a stack without tables
SHARED = ("-fPIC", "-fno-plt", "-fno-asynchronous-unwind-tables", "-fno-unwind-tables")
INLINE = (*SHARED, "-mno-outline-atomics")
TABLES = ("-fasynchronous-unwind-tables",)

# firmware may trap unaligned accesses, and memory without an MMU must not see them. Hosted in the language's sense, or
# sqrt would be a call
FIXED = ("-fno-pic", "-fno-asynchronous-unwind-tables", "-fno-unwind-tables", "-mno-unaligned-access")

# no -march: every machine of a platform runs the same instructions, and so gets the same bits
PLATFORMS = {
    "x86_64-linux": Platform("x86_64-unknown-linux-gnu", "elf", "elf_x86_64", "GLIBC_2.2.5", ".so", SHARED),
    "aarch64-linux": Platform("aarch64-unknown-linux-gnu", "elf", "aarch64linux", "GLIBC_2.17", ".so", INLINE),
    "x86_64-windows": Platform("x86_64-w64-windows-gnu", "coff", "x64", "", ".dll", TABLES),
    "x86_64-darwin": Platform("x86_64-apple-macosx11.0.0", "macho", "x86_64-macos", "", ".dylib", SHARED),
    "aarch64-darwin": Platform("arm64-apple-macosx11.0.0", "macho", "aarch64-macos", "", ".dylib", SHARED),
}
BARE = {
    "cortex-m7": Bare("thumbv7em-unknown-none-eabihf", ".a", ("-mcpu=cortex-m7", *FIXED)),
    "cortex-a53": Bare("aarch64-unknown-none-elf", ".a", ("-mcpu=cortex-a53", *FIXED)),
}

# the functions of libm that a component may call
LIBM = frozenset(
    """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs floor fma fmax fmin
    fmod frexp hypot ldexp lgamma log log10 log1p log2 modf nearbyint pow rint round sin sinh sqrt tan tanh tgamma trunc
    """.split()  # noqa: SIM905 - as a list it takes a line per word
)


def host() -> str:
    """The platform this process runs on, by its FMI 3.0 name."""
    machine_name = os.uname().machine if hasattr(os, "uname") else sysconfig.get_platform().rsplit("-", 1)[-1]
    arch = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine_name.lower(), machine_name.lower())
    system = {"nt": "windows"}.get(os.name, sysconfig.get_platform().split("-", maxsplit=1)[0])
    return f"{arch}-{'darwin' if system == 'macosx' else system}"
