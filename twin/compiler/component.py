"""A component, a group or the co-simulation loop as C: header and source."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import numpy as np

import twin
from twin.compiler.autodiff import Tangents, tangents
from twin.compiler.codegen import number, wrapped
from twin.compiler.component_source import Sources, source_location
from twin.compiler.resolve import TranslationError
from twin.compiler.structs import WIDTH, block_comment, clean, flat_struct, struct_of, struct_of_dtype, struct_text
from twin.compiler.translation_unit import RECORD, Entry, TranslationUnit
from twin.compiler.types import REAL, Struct
from twin.component import Component, PythonComponent, evaluation, functions
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Iterator

# sums and products are rounded one by one, as in Python, whatever the options; reals that are compared for equality are
# meant to be equal to the bit
ROUNDING = """\
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wfloat-equal"
#endif"""

INCLUDES = ("#include <stdbool.h>", "#include <stddef.h>", "#include <stdint.h>")

HEADER = """\
{head}
#ifndef {guard}
#define {guard}

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

/* what the functions return, as int32_t: compilers do not agree on the size of an enum */
#ifndef TWIN_STATUS
#define TWIN_STATUS
typedef enum {{ TWIN_OK, TWIN_WARNING, TWIN_DISCARD, TWIN_ERROR, TWIN_FATAL }} twin_status;
#endif

{struct}

/* Start values; then parameters and inputs may be set. */
void {name}_init({name}_t *self);

/* States and outputs at time t [s] follow from parameters and inputs. */
int32_t {name}_start({name}_t *self, double t);

/* From t to t + h [s], with the inputs as they are. */
int32_t {name}_step({name}_t *self, double t, double h);
{more}
#ifdef __cplusplus
}}
#endif
#endif
"""

DERIVATIVES = """
/* Derivatives and outputs at time t [s], from states and inputs: for a solver outside. */
int32_t {name}_derivatives({name}_t *self, double t);
"""

TANGENTS = """
/* The same with tangents: `dot` has those of states and inputs, and gets those of derivatives and outputs. */
int32_t {name}_tangent({name}_t *self, {name}_t *dot, double t, double dot_t);

/* Tangents of what `start` computes. */
int32_t {name}_first_tangent({name}_t *self, {name}_t *dot, double t, double dot_t);
"""


def entries(cls: type[Component], name: str) -> tuple[Entry, ...]:
    """The functions of a component that others call."""
    start, step = functions(cls)
    public_entries = [
        Entry(f"{name}_start", start, (REAL,), ("t",)),
        Entry(f"{name}_step", step, (REAL, REAL), ("t", "h")),
    ]
    evaluate = evaluation(cls)
    if evaluate is not None:
        public_entries.append(Entry(f"{name}_derivatives", evaluate, (REAL,), ("t",)))
        slopes = tangents(cls)
        if isinstance(slopes, Tangents):
            arguments = (RECORD, REAL, REAL), ("dot", "t", "dot_t")
            public_entries.append(Entry(f"{name}_tangent", slopes.at, *arguments))
            public_entries.append(Entry(f"{name}_first_tangent", slopes.first, *arguments))
    return tuple(public_entries)


def translate(cls: type[Component], name: str, *, line_directives: bool = False) -> Sources:
    """A component as C; BuildError with file, line and remedy if it cannot be one."""
    if issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: is Python-side and cannot be compiled. Derive it from Component instead.")
    if not name.isidentifier() or not name.isascii():
        raise BuildError(f"{cls.__name__}: {name!r} is no name in C. Use letters a to z, digits and _.")
    record = struct_of(cls, name)
    public = flat_struct(cls, name) if getattr(cls, "parts", None) else None
    unit = TranslationUnit(record, public, line_directives=line_directives)
    own = entries(cls, name)
    try:
        source = unit.text(
            own,
            about(cls, f"{name}.c"),
            [f'#include "{name}.h"', "", *INCLUDES, "", ROUNDING],
            [start_values(cls, name, record)],
        )
    except TranslationError as error:
        raise BuildError("\n".join(f"{cls.__name__} {part}" for part in str(error).split("\n"))) from None
    return Sources(name, header(cls, name, public or record, own), source)


def header(cls: type[Component], name: str, struct: Struct, own: tuple[Entry, ...]) -> str:
    """`NAME.h`: the struct and what can be called."""
    symbols = {entry.symbol for entry in own}
    more = "".join(
        text.format(name=name)
        for symbol, text in (("derivatives", DERIVATIVES), ("tangent", TANGENTS))
        if f"{name}_{symbol}" in symbols
    )
    words = {"head": about(cls, f"{name}.h"), "guard": f"{name.upper()}_H", "name": name}
    return HEADER.format(struct=struct_text(struct), more=more, **words)


def about(cls: type[Component], file: str) -> str:
    """The comment at the begin of a file: docstring, and where it comes from."""
    lines = [clean(line).rstrip() for line in inspect.cleandoc(cls.__doc__ or cls.__name__).splitlines()]
    by, source = (
        f"{file}, written by twin {twin.__version__}",
        f"from {cls.__qualname__} ({source_location(cls)}). SI units.",
    )
    origin = f"{by} {source}" if len(by) + len(source) < WIDTH else f"{by}\n   {source}"
    return "\n".join([f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:]), "", f"   {origin} */"])


def start_values(cls: type[Component], name: str, struct: Struct) -> str:
    """`NAME_init`: all memory zero, then what is not."""
    kind = f"{name}_t"
    inner = f"    {struct.name} *const record = ({struct.name} *)(void *)self;" if struct.name != kind else ""
    target = "record" if inner else "self"
    lines = [
        f"void {name}_init({kind} *self)",
        "{",
        "    unsigned char *const bytes = (unsigned char *)self;",
        f"    for (size_t i = 0; i < sizeof({kind}); i++) {{",
        "        bytes[i] = 0;",
        "    }",
    ]
    body = list(_assignments(struct, cls().record[0], f"{target}->"))
    return "\n".join([*lines, *([inner] if inner and body else []), *body, "}"])


def _assignments(struct: Struct, record: Any, prefix: str) -> Iterator[str]:
    """A statement for every field that is not zero."""
    for key, own in struct.fields.items():
        if own.struct is not None:
            yield from _assignments(own.struct, record[key], f"{prefix}{own.name}.")
            continue
        values = np.asarray(record[key])
        if (
            not values.view(np.uint8).any()
            if values.flags.c_contiguous and values.ndim
            else not values.tobytes().strip(b"\0")
        ):
            continue
        for index in np.ndindex(values.shape):
            value = values[index].item()
            if value or str(value) == "-0.0":
                subscript = "".join(f"[{i}]" for i in index)
                yield from wrapped(f"    {prefix}{own.name}{subscript} = {number(value).text};")


def translate_record(dtype: np.dtype[Any], name: str, function: Any, head: str) -> str:
    """One function over a plain record, `NAME_run(record)`, as a C file of its own."""
    struct = struct_of_dtype(dtype, name)
    unit = TranslationUnit(struct, None)
    entry = Entry(f"{name}_run", function, ())
    try:
        return unit.text((entry,), "\n".join(block_comment(head)), [*INCLUDES, "", struct_text(struct)])
    except TranslationError as error:
        raise BuildError(f"{name} {error}") from None
