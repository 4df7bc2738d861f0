"""A component or group as C with a header, and as static libraries: what a firmware engineer links or compiles.

No heap, no C library but the mathematical one. The header's struct is the component's record: its fields are the
variables, what lies behind them belongs to the solver. A group's `member.variable` is the field `member_variable`.
A name that means something else in C, in C++ or in their common headers gets an underscore: `default` is `default_`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from twin import compiler
from twin.errors import BuildError, TwinError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component

# targets, and how `zig cc -target` calls them
TRIPLES = {
    "x86_64-linux": ("x86_64-linux-gnu.2.17",),
    "aarch64-linux": ("aarch64-linux-gnu.2.17",),
    "cortex-m7": ("thumb-freestanding-eabihf", "-mcpu=cortex_m7+strict_align"),
    "cortex-a53": ("aarch64-freestanding-none", "-mcpu=cortex_a53+strict_align"),
}

README = """\
Components as C, made by twin

NAME.h            the struct and its functions; how to call them stands there
NAME.c            the component: plain C11, one file, no macros
TARGET/libNAME.a  the same compiled for a target

     NAME_t part;
     NAME_init(&part);              start values; then set parameters and inputs
     NAME_start(&part, 0.0);        states and outputs follow from them
     NAME_step(&part, t, h);        from t to t + h [s]; returns a twin_status

No heap, no static memory, no input or output; any number of structs, in any number of threads. SI units. The mathematical
functions a component uses (exp, pow, ...) come from your C library's libm; where only + - * / are used, nothing does.
Structs must be aligned to 8 byte, as your compiler does with a double.

Nothing is checked: an input that is not finite may give an output that is not finite with TWIN_OK, and so may a parameter
outside of the bounds that NAME.h states, or a time that does not go on. Test outputs before a drive gets them. A sampled
component acts at multiples of its period (period_ns in NAME.c) that lie within a step. Steps of one period are what was tested.

From source:
  cc -std=c11 -O2 -ffp-contract=off -fwrapv -c NAME.c
Without -ffp-contract=off some compilers join a product and a sum, which rounds once instead of twice. No fast-math.
Without -fwrapv whole numbers that overflow may be anything; with it they wrap around, as in the libraries.

With the library:
x86_64-linux   cc main.c x86_64-linux/libNAME.a -lm
aarch64-linux  aarch64-linux-gnu-gcc main.c aarch64-linux/libNAME.a -lm
cortex-m7      arm-none-eabi-gcc -mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16 ... cortex-m7/libNAME.a -lm
               needs the double-precision unit, switched on before the first call. -lm is newlib's; the compiler's own
               library (libgcc) gives the 64-bit conversions
cortex-a53     aarch64-none-elf-gcc -mcpu=cortex-a53 ... cortex-a53/libNAME.a -lm
               needs floating point switched on before the first call

The Cortex libraries make no unaligned accesses.
"""


def header(cls: type[Component], name: str) -> str:
    """The header: struct and functions."""
    return compiler.translate(cls, name).header


def archive(made: compiler.Sources, target: str, build: Path) -> bytes:
    """The static library for a target."""
    if target not in TRIPLES:
        raise BuildError(f"target {target!r} is not offered for C. Use one of {', '.join(TRIPLES)}.")
    return compiler.archive(target, {f"{made.name}.o": compiler.compile_sources(made, target, build)})


def export(
    cls: type[Component],
    name: str,
    folder: Path,
    build: Path,
    targets: Sequence[str],
    force: bool,
    *,
    line_directives: bool = False,
) -> list[Path]:
    """Write `NAME.h`, `NAME.c`, `README.txt` and `TARGET/libNAME.a` into a folder; the paths written."""
    files = [folder / f"{name}.h", folder / f"{name}.c", folder / "README.txt"]
    paths = [*files, *(folder / target / f"lib{name}.a" for target in targets)]
    there = [str(path) for path in paths if path.exists() and path.read_bytes() != README.encode()]
    if there and not force:
        raise TwinError(f"{there[0]} is there already. Give --force to replace it, or another folder with -o.")
    made = compiler.sources(cls, name, build)
    shown = compiler.translate(cls, name, line_directives=True) if line_directives else made
    archives = compiler.side_by_side(partial(archive, made, target, build) for target in targets)
    contents = [shown.header.encode(), shown.source.encode(), README.encode(), *archives]
    for path, content in zip(paths, contents, strict=True):
        write_atomically(path, content)
    return paths
