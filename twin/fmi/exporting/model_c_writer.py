"""Writer of `model.c`, the description of a component for the FMU's state machine, as readable C.

`twin/fmi/exporting/c/model.h` declares what is defined here. The token is part of it, so that a description fits one binary.
"""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING

from twin.component import Role
from twin.fmi.exporting import model_description_writer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.component import Component, Variable
    from twin.fmi.exporting.model_description_writer import Exposed

ACCESS = {Role.input: "INPUT", Role.parameter: "TUNABLE"}


SEEDED = "void *tangents, double t, double tangent_of_t"
ARGUMENTS = {  # of the functions that return a status, after the record
    "start": "double t",
    "step": "double t, double h",
    "derivatives": "double t",
    "tangent": SEEDED,
    "first_tangent": SEEDED,
}


def _functions(cls: type[Component]) -> list[str]:
    exchange = ["derivatives"] if model_description_writer.is_continuous(cls) else []
    return [
        "start",
        "step",
        *exchange,
        *(["tangent", "first_tangent"] if model_description_writer.offers_derivatives(cls) else []),
    ]


def source_code(cls: type[Component], name: str) -> str:
    """The functions of `NAME.c`, which take the struct of `NAME.h`, as functions of its memory."""
    lines = [
        f'#include "{name}.h"',
        "",
        f'_Static_assert(sizeof({name}_t) == RECORD_SIZE, "the struct has the size of the record");',
        "",
        f"static void init(void *record) {{ {name}_init(record); }}",
    ]
    for function in _functions(cls):
        passed = ", ".join(["record", *(word.split()[-1].strip("*") for word in ARGUMENTS[function].split(","))])
        head = f"static int32_t {function}(void *record, {ARGUMENTS[function]})"
        lines.append(f"{head} {{ return {name}_{function}({passed}); }}")
    return "\n".join(lines)


# --------------------------------------------------------------------------------------------------------------- words


def string(text: str) -> str:
    """Format a C string literal: non-ASCII text as octal bytes of UTF-8, `?` escaped against trigraphs."""
    letters = []
    for byte in text.encode():
        letter = chr(byte)
        if letter in '"\\?':
            letters.append(f"\\{letter}")
        else:
            letters.append(letter if 32 <= byte < 127 else f"\\{byte:03o}")
    return f'"{"".join(letters)}"'


def comment(text: str) -> str:
    """Format a one-line C comment; the text can neither end it nor open another."""
    plain = (
        "".join(letter if letter.isprintable() else " " for letter in text).replace("*/", "* /").replace("/*", "/ *")
    )
    return f"/* {' '.join(plain.split())} */"


def _aligned(rows: list[list[str]]) -> list[str]:
    """Cells of rows as lines of a table."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [" ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _array(kind: str, name: str, values: Iterable[str]) -> list[str]:
    """Definition of an array, if it has elements."""
    joined = ", ".join(values)
    return [f"static const {kind} {name}[] = {{{joined}}};", ""] if joined else []


# ---------------------------------------------------------------------------------------------------------- the fields


def _access(exposed: Exposed) -> str:
    if exposed.variability == "fixed":
        return "FIXED"
    if exposed.causality == "input" and exposed.variability == "continuous":
        return "SIGNAL"
    return ACCESS.get(exposed.variable.role, "EXACT" if exposed.has_start else "CALCULATED")


def _row(
    index: int, name: str, offset: str, count: int, kind: str, access: str, is_intermediate: bool, about: str
) -> list[str]:
    last = f".access = {access}, .is_intermediate = true}}," if is_intermediate else f".access = {access}}},"
    first = [f"    [{index}]", f"= {{.name = {string(name)},", f".offset = {offset},", f".count = {count},"]
    return [*first, f".type = {kind},", last, about]


def _fields(cls: type[Component], exposed: list[Exposed], has_time: bool, has_clock: bool) -> list[str]:
    """One row per value reference, with its unit and meaning."""
    first = [_row(0, "time", "TIME", 1, "FLOAT64", "CALCULATED", False, "/* [s] independent variable */")]
    rows = first if has_time else []
    for e in exposed:
        variable = e.variable
        unit = f"[{variable.unit}] " if variable.unit else ""
        is_intermediate = has_time and model_description_writer.is_intermediate(cls, e)
        about = comment(f"{unit}{variable.description}")
        kind = variable.type.upper()
        rows.append(_row(e.reference, e.name, str(e.offset), len(e.start), kind, _access(e), is_intermediate, about))
    if has_clock:
        name, about = model_description_writer.SAMPLE_CLOCK, "/* of the sample period */"
        rows.append(_row(len(exposed) + 1, name, "0", 1, "CLOCK", "INPUT", False, about))
    return ["static const Field fields[FIELD_COUNT] = {", *_aligned(rows), "};", ""] if rows else []


# ------------------------------------------------------------------------------------------------------------- the file


def _offsets(cls: type[Component], variables: Iterable[Variable]) -> list[str]:
    """Where each element of some real variables lies in the record."""
    return [str(cls.layout.offset(v.name) + 8 * i) for v in variables for i in range(v.size)]


def model_c(
    cls: type[Component],
    name: str,
    token: str,
    exposed: list[Exposed],
    has_time: bool,
    code: str,
    has_clock: bool = False,
) -> str:
    """`model.c`: identity, functions, one row per value reference, and the memory of instances."""
    states = [v for v in cls.variables if v.role is Role.state]
    derivatives = [v for v in cls.variables if v.role is Role.derivative]
    nominals = [repr(float(v.nominal or 1.0)) for v in states for _ in range(v.size)]
    indicators = _offsets(cls, model_description_writer.switches(cls))
    fields = _fields(cls, exposed, has_time, has_clock)
    members = _model_members(cls, name, token, len(nominals), len(indicators), has_fields=bool(fields))
    if has_clock:
        members["has_clock"] = "true"
    width = max(map(len, members))
    lines = [
        comment(f"{name}: {model_description_writer.summary(cls)}"),
        "/* Identity, variables and memory of the FMU, written by twin. */",
        "",
        '#include "model.h"',
        "",
        "enum {",
        f"    RECORD_SIZE = {cls.layout.dtype.itemsize},",
        f"    FIELD_COUNT = {len(exposed) + has_time + has_clock},",
        f"    SLOT = SLOT_SIZE(RECORD_SIZE, FIELD_COUNT, {3 if model_description_writer.offers_derivatives(cls) else 1}),",
        "};",
        "",
        code,
        "",
        *fields,
        *_array("double", "nominals", nominals),
        *_array("int32_t", "states", _offsets(cls, states)),
        *_array("int32_t", "derivatives_of_states", _offsets(cls, derivatives)),
        *_array("int32_t", "indicators", indicators),
        "static _Alignas(64) unsigned char pool[(size_t)SLOT * SLOT_COUNT(SLOT)];",
        "",
        "HIDDEN const Model model = {",
        *(f"    .{member.ljust(width)} = {value}," for member, value in members.items()),
        "};",
        "",
    ]
    return "\n".join(lines)


def _model_members(
    cls: type[Component],
    name: str,
    token: str,
    state_count: int,
    indicator_count: int,
    *,
    has_fields: bool,
) -> dict[str, str]:
    """Return the initializers of `model` by member."""
    offset, own = cls.layout.offset, _functions(cls)
    high, low = divmod(uuid.UUID(token.strip("{}")).int, 2**64)
    members = {
        "name": string(name),
        "token": string(token),
        "identity": f"{{0x{high:016x}, 0x{low:016x}}}",
        "record_size": "RECORD_SIZE",
        "field_count": "FIELD_COUNT",
        "fields": "fields" if has_fields else "NULL",
        "init": "init",
        **{function: function if function in own else "NULL" for function in ARGUMENTS},
    }
    if cls.period_ns:
        members |= {"period": str(cls.period_ns), "begin": str(offset("_begin")), "tick": str(offset("_tick"))}
    if state_count:
        members |= {
            "substep": repr(float(cls.method.substep)),
            "state_count": str(state_count),
            "states": "states",
            "derivatives_of_states": "derivatives_of_states",
            "nominals": "nominals",
        }
    if indicator_count:
        members |= {"indicator_count": str(indicator_count), "indicators": "indicators"}
    members |= {"pool": "pool", "pool_size": "sizeof pool", "slot_size": "SLOT"}
    return members
