"""The struct of a record: a field per variable, with unit and description.

The layout is that of the numpy record. What lies between fields is written out, so that no compiler pads otherwise. A
group's record holds the structs of its members; the header shows the same memory flat, `member.variable` as
`member_variable`.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler.names import safe
from twin.compiler.types import STORAGE, Field, Struct
from twin.component import Role
from twin.errors import BuildError

if TYPE_CHECKING:
    from twin.component import Component, Variable

WIDTH = 120
SIZES = {"double": 8, "int64_t": 8, "int32_t": 4, "int8_t": 1, "bool": 1}

TITLES = {
    Role.input: "inputs",
    Role.output: "outputs",
    Role.state: "states",
    Role.derivative: "derivatives of the states",
    Role.local: "local variables",
    Role.parameter: "parameters",
}

# the engine's own fields: name in the record -> what it is
ENGINE = {
    "_x0": "states at the begin of the substep",
    "_k": "slopes of the method's stages",
    "_jacobian": "I - gamma h J, then its factors",
    "_nominal": "nominal values of the states",
    "_begin": "begin of the run [ns]",
    "_tick": "number of the present tick; whether it has taken its inputs",
    "_count": "communication points so far",
}
OVERLAYS = {"_x": "state_array", "_dx": "derivative_array"}  # all states and all derivatives as flat arrays


def comment_of(variable: Variable) -> str:
    """Unit, description, source of a variable, as its declaration says."""
    unit = f"[{variable.unit}] " if variable.unit and variable.unit != "1" else ""
    source = f"; source: {variable.source}" if variable.source else ""
    return clean(f"{unit}{variable.description}{source}")


def clean(text: str) -> str:
    """Text that may stand in a C comment: ASCII, no end of comment, no continued line."""
    text = text.replace("*/", "* /").replace("/*", "/ *").replace("??", "?")
    return text.encode("ascii", "backslashreplace").decode().rstrip("\\")


def scalar_field(name: str, kind: np.dtype[Any], offset: int, comment: str = "", role: Role | None = None) -> Field:
    """A field that holds a number or an array of numbers."""
    storage = STORAGE[kind.base.name][0]
    return Field(name, storage, kind.shape, offset, SIZES[storage] * int(np.prod(kind.shape, dtype=int)), comment, role)


def struct_of_dtype(dtype: np.dtype[Any], name: str) -> Struct:
    """The struct of a plain record."""
    struct = Struct(f"{name}_t", dtype.itemsize)
    for key, (kind, offset, *_) in (dtype.fields or {}).items():
        struct.fields[key] = scalar_field(safe(key), kind, offset)
    return struct


def struct_of(cls: type[Component], name: str, structs: dict[type[Component], Struct] | None = None) -> Struct:
    """The struct of a component's record; those of a group's members are made with it."""
    structs = {} if structs is None else structs
    if cls in structs:
        return structs[cls]
    parts = getattr(cls, "parts", {})
    struct = structs[cls] = Struct(f"{name}_record_t" if parts else f"{name}_t", cls.layout.size)
    variables = {variable.name: variable for variable in cls.variables}
    if parts:
        variables.update({f"_border{i}": v for i, v in enumerate(v for v in cls.variables if v.role is Role.input)})
    taken: set[str] = set()
    for key, (kind, offset, *_) in (cls.layout.dtype.fields or {}).items():
        variable = variables.get(key)
        if key in parts:
            inner = struct_of(parts[key].component, part_name(name, parts, key), structs)
            struct.fields[key] = Field(unique(name, safe(key), taken), inner.name, (), offset, inner.size, struct=inner)
        elif key in OVERLAYS:
            struct.overlays[key] = scalar_field(OVERLAYS[key], kind, offset)
        elif variable is not None:
            own = unique(name, field_name(variable), taken)
            struct.fields[key] = scalar_field(own, kind, offset, comment_of(variable), variable.role)
        else:
            own = unique(name, f"engine{key}".replace("__", "_"), taken)
            struct.fields[key] = scalar_field(own, kind, offset, ENGINE.get(key, ""))
    return struct


def flat_struct(cls: type[Component], name: str) -> Struct:
    """The same memory with all variables at the top: what a group's header shows."""
    struct = Struct(f"{name}_t", cls.layout.size)
    taken: set[str] = set()
    for variable in sorted(cls.variables, key=lambda entry: cls.layout.offset(entry.name)):
        kind = np.dtype((variable.dtype, variable.shape)) if variable.shape else variable.dtype
        text = clean(f"{variable.role}: ") + comment_of(variable)
        own = unique(name, field_name(variable), taken)
        struct.fields[variable.name] = scalar_field(own, kind, cls.layout.offset(variable.name), text)
    return struct


def part_name(group: str, parts: dict[str, Any], member: str) -> str:
    """Name of the struct of a group's member: members of one class share that of the first."""
    cls = parts[member].component
    return f"{group}_{next(name for name, part in parts.items() if part.component is cls)}"


def field_name(variable: Variable) -> str:
    """A variable's name in C; `member.variable` of a group is `member_variable`."""
    return safe(variable.name.replace(".", "_"))


def unique(struct: str, name: str, taken: set[str]) -> str:
    """The name, unless the struct has it already."""
    if name in taken:
        raise BuildError(
            f"{struct}: two variables would be the C field {name!r}. Rename one, or a member of the group."
        )
    taken.add(name)
    return name


# ---------------------------------------------------------------------------------------------------------- writing


def declaration(own: Field) -> str:
    """`double x[3];`."""
    return f"{own.storage} {own.name}{''.join(f'[{size}]' for size in own.shape)};"


def lines_of(own: Field) -> list[str]:
    """A field's lines: its comment behind it where there is room, else before it."""
    line = f"    {declaration(own)}"
    if not own.comment:
        return [line]
    aligned = f"{line:<44} /* {own.comment} */"
    return [aligned] if len(aligned) <= WIDTH else [*block_comment(own.comment, "    "), line]


def block_comment(text: str, indent: str = "") -> list[str]:
    """Text as a comment of as many lines as it takes."""
    wrapped = textwrap.wrap(text, WIDTH - len(indent) - 6, break_long_words=False, break_on_hyphens=False) or [""]
    if len(wrapped) == 1:
        return [f"{indent}/* {wrapped[0]} */"]
    return [
        f"{indent}/* {wrapped[0]}",
        *(f"{indent}   {line}" for line in wrapped[1:-1]),
        f"{indent}   {wrapped[-1]} */",
    ]


def struct_text(struct: Struct) -> str:
    """The typedef of a struct: fields in the order of memory, under the titles of their roles."""
    lines: list[str] = []
    at, gaps, title = 0, 0, ""
    for own in sorted(struct.fields.values(), key=lambda field: field.offset):
        if own.offset > at:
            lines.append(f"    uint8_t hidden{gaps}[{own.offset - at}];")
            gaps += 1
        now = TITLES[own.role] if own.role is not None else "members" if own.struct else ""
        if own.name.startswith("engine_"):
            now = "the solver's own"
        if now and now != title:
            lines += [*([""] if lines else []), f"    /* {now} */"]
            title = now
        lines += lines_of(own)
        at = own.offset + own.size
    if struct.size > at:
        lines.append(f"    uint8_t hidden{gaps}[{struct.size - at}];")
    return "\n".join(["typedef struct {", *lines, f"}} {struct.name};"])


def nested(struct: Struct) -> list[Struct]:
    """Return the struct and its nested structs in order of definition in C."""
    ordered: list[Struct] = []
    for own in struct.fields.values():
        ordered += [inner for inner in nested(own.struct) if inner not in ordered] if own.struct is not None else []
    return [*ordered, struct]


def layout_checks(struct: Struct) -> list[str]:
    """Assertions that the compiler lays the struct out as the engine does: one at the begin of each run of fields."""
    lines = [f'_Static_assert(sizeof({struct.name}) == {struct.size}, "size of the record");']
    storage = ""
    for own in sorted(struct.fields.values(), key=lambda field: field.offset):
        if own.storage != storage or own.shape:
            condition = f"offsetof({struct.name}, {own.name}) == {own.offset}"
            lines.append(f'_Static_assert({condition}, "place in the record");')
        storage = own.storage
    return lines
