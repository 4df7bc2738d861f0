"""Types of the translator: what an expression of a component is in C."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from twin.component import Role


class Kind(IntEnum):
    """Kinds of number; two that meet become the greater one."""

    boolean = 0
    integer = 1
    real = 2


@dataclass(frozen=True, slots=True)
class Scalar:
    """One number."""

    kind: Kind


@dataclass(frozen=True, slots=True)
class Array:
    """A block of numbers of known shape, held by a pointer. `storage`: C type of an element; `constant`: a table."""

    storage: str
    shape: tuple[int, ...]
    constant: bool = False


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a struct; `struct` where it is one itself."""

    name: str
    storage: str
    shape: tuple[int, ...]
    offset: int
    size: int
    comment: str = ""
    role: Role | None = None
    struct: Struct | None = None


@dataclass(eq=False, slots=True)
class Struct:
    """A record's type in C: fields by the name they have in Python. `overlays` lie over them."""

    name: str
    size: int
    fields: dict[str, Field] = field(default_factory=dict)
    overlays: dict[str, Field] = field(default_factory=dict)

    @property
    def prefix(self) -> str:
        """What the names of its functions begin with."""
        return self.name.removesuffix("_t")


@dataclass(frozen=True, slots=True)
class Record:
    """A component's memory, held by a pointer."""

    struct: Struct


@dataclass(frozen=True, slots=True)
class Tuple:
    """What a function with several results returns."""

    items: tuple[Type, ...]


@dataclass(frozen=True, eq=False, slots=True)
class StaticObject:
    """A Python object that is known while translating: a function, a module, None. It leaves no trace in C."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StaticObject) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


@dataclass(frozen=True, slots=True)
class Nothing:
    """No value: a function that returns none."""


@dataclass(frozen=True, slots=True)
class UnknownType:
    """Not known yet: a variable that is read in a loop before the line that sets it was reached."""


Type = Scalar | Array | Record | Tuple | StaticObject | Nothing | UnknownType

BOOLEAN, INTEGER, REAL = (Scalar(kind) for kind in Kind)
NOTHING, UNKNOWN = Nothing(), UnknownType()

C_NAMES = {BOOLEAN: "bool", INTEGER: "int64_t", REAL: "double"}
LETTERS = {BOOLEAN: "b", INTEGER: "i", REAL: "d"}

# how numbers lie in a record: C type, and what they are computed as
STORAGE = {
    "float64": ("double", REAL),
    "int64": ("int64_t", INTEGER),
    "int32": ("int32_t", INTEGER),
    "int8": ("int8_t", INTEGER),
    "bool": ("bool", BOOLEAN),
}
COMPUTED = dict(STORAGE.values())


@dataclass(slots=True)
class MixedError(Exception):
    """Two types that cannot be one variable."""

    types: tuple[Type, Type] = field(default=(UNKNOWN, UNKNOWN))


def join(a: Type, b: Type) -> Type:
    """The type of what may be either; MixedError if there is none."""
    if isinstance(a, UnknownType) or a == b:
        return b
    if isinstance(b, UnknownType):
        return a
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return Scalar(max(a.kind, b.kind))
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return Tuple(tuple(map(join, a.items, b.items)))
    raise MixedError((a, b))


def describe(kind: Type) -> str:
    """A type in words, for messages."""
    if isinstance(kind, Scalar):
        return {BOOLEAN: "a Boolean", INTEGER: "a whole number", REAL: "a real number"}[kind]
    if isinstance(kind, Array):
        return f"an array [{', '.join(map(str, kind.shape))}]"
    if isinstance(kind, Tuple):
        return f"{len(kind.items)} values"
    if isinstance(kind, Record):
        return "a component"
    return "nothing" if isinstance(kind, Nothing) else "no number"


def of_constant(value: Any) -> Type:
    """The type of an object of a module or closure."""
    if isinstance(value, bool | np.bool_):
        return BOOLEAN
    if isinstance(value, int | np.integer):
        return INTEGER
    if isinstance(value, float | np.floating):
        return REAL
    table = as_table(value)
    return StaticObject(value) if table is None else Array(STORAGE[table.dtype.name][0], table.shape, constant=True)


def as_table(value: Any) -> np.ndarray[Any, Any] | None:
    """A tuple or array of numbers as an array of a type that records have; None if it is something else."""
    if not isinstance(value, tuple | np.ndarray) or not len(value):
        return None
    try:
        table = np.array(value)
    except ValueError:  # rows of different length
        return None
    kinds = {"f": np.float64, "i": np.int64, "u": np.int64, "b": np.bool_}
    return table.astype(kinds[table.dtype.kind]) if table.dtype.kind in kinds else None
