"""Declarations of variables, and the memory layout that follows from a list of them.

The record's dtype, both modelDescription.xml, value references, documentation and command-line help are generated
from the declarations; a unit, a sign or a meaning stands there and nowhere else. Words are those of FMI 3.0.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import prod
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np

from twin.component import unit
from twin.errors import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

Start = float | int | bool | tuple[Any, ...]


class Type(StrEnum):
    """The variable types a component can have, by their FMI 3.0 names."""

    Float64 = "Float64"
    Int32 = "Int32"
    Int64 = "Int64"
    Boolean = "Boolean"


TypeName: TypeAlias = Type  # the field of Variable called `type` hides the name

Float64, Int32, Int64, Boolean = Type.Float64, Type.Int32, Type.Int64, Type.Boolean

DTYPES: dict[Type, np.dtype[Any]] = {
    Float64: np.dtype(np.float64),
    Int32: np.dtype(np.int32),
    Int64: np.dtype(np.int64),
    Boolean: np.dtype(np.bool_),
}


def storage(kind: Type, shape: tuple[int, ...]) -> np.dtype[Any]:
    """Type of a scalar in the record: Booleans of an array are bytes of 0 and 1, which have a value each in C."""
    return np.dtype(np.int8) if kind is Boolean and shape else DTYPES[kind]


WORD = 8  # alignment of every block and of every array [byte]


class Role(StrEnum):
    """What a variable is to its component; the order is the order of the blocks in the record."""

    input = "input"
    output = "output"
    state = "state"
    derivative = "derivative"
    local = "local"
    parameter = "parameter"


@dataclass(frozen=True, slots=True)
class Variable:
    """A declared variable. Read from an instance it is the value, read from the class it is the declaration.

    `start` is a number, or nested tuples of the array's shape. `unit` is a coherent SI unit (`N/m`); `display_unit`
    is what people prefer to read (`N/mm`). `source` says where a parameter's value comes from.
    """

    role: Role
    unit: str
    description: str
    start: Start = 0.0
    type: TypeName = Float64
    shape: tuple[int, ...] = ()
    display_unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    fixed: bool = False
    source: str = ""
    name: str = ""

    def __repr__(self) -> str:
        name = f"{self.name} = {self.start}" if self.role is Role.parameter and not self.shape else self.name
        return unit.declaration(self.role, name, self.shape, self.unit, self.description)

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        if instance is None:
            return self
        view = instance.views[self.name]
        if self.shape:
            return view
        # whole numbers as Python's own: compiled code computes with 64 bit too, where numpy would wrap at 32
        return view[()] if self.type is Float64 else view.item()

    def __set__(self, instance: Any, value: Any) -> None:
        instance.views[self.name][...] = value

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of one scalar in the record."""
        return storage(self.type, self.shape)

    def start_array(self) -> np.ndarray[Any, Any]:
        """Start value as an array of the variable's shape and type."""
        start = np.asarray(self.start, dtype=self.dtype)
        return np.broadcast_to(start, self.shape) if self.shape else start

    def elements(self) -> list[str]:
        """Names of the scalars, as FMI 2.0 needs them: `r[1]`, `r[2]`; `a[1,2]`. Counted from 1 as in Modelica."""
        if not self.shape:
            return [self.name]
        return [f"{self.name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(self.shape)]


def _declare(role: Role, unit: str, description: str, start: Start, options: dict[str, Any]) -> Any:
    """Make a variable, taking shape and Boolean type from the start value where they are not given."""
    kind = options.get("type", Boolean if np.asarray(start).dtype.kind == "b" else Float64)
    if kind not in DTYPES:
        raise DeclarationError(f"type {kind!r} of {description!r} is not known. Use one of {', '.join(DTYPES)}.")
    options["type"] = Type(kind)  # a name as text becomes the type itself, with which the engine compares
    if "shape" not in options:
        options["shape"] = np.asarray(start, dtype=DTYPES[options["type"]]).shape
    if options["shape"]:
        start = tuple(np.broadcast_to(np.asarray(start), options["shape"]).tolist())
    return Variable(role, unit, description, start, **options)


# for type checkers: the type of the values, so that `self.force = "1 N"` is an error; any where `type` is given
@overload
def input(unit: str, description: str, *, shape: tuple[int, ...], **options: Any) -> NDArray[Any]: ...  # noqa: A001
@overload
def input(unit: str, description: str, *, type: TypeName, **options: Any) -> Any: ...  # noqa: A001
@overload
def input(unit: str, description: str, *, start: tuple[Any, ...], **options: Any) -> NDArray[Any]: ...  # noqa: A001
@overload
def input(unit: str, description: str, *, start: float = ..., **options: Any) -> float: ...  # noqa: A001
def input(unit: str, description: str, *, start: Start = 0.0, **options: Any) -> Any:  # noqa: A001 - FMI's own word
    """Declare an input; `start` is its value while nothing is connected."""
    return _declare(Role.input, unit, description, start, options)


@overload
def output(unit: str, description: str, *, shape: tuple[int, ...], **options: Any) -> NDArray[Any]: ...
@overload
def output(unit: str, description: str, *, type: TypeName, **options: Any) -> Any: ...
@overload
def output(unit: str, description: str, *, start: tuple[Any, ...], **options: Any) -> NDArray[Any]: ...
@overload
def output(unit: str, description: str, *, start: float = ..., **options: Any) -> float: ...
def output(unit: str, description: str, *, start: Start = 0.0, **options: Any) -> Any:
    """Declare an output: written by the component's functions, read by others."""
    return _declare(Role.output, unit, description, start, options)


@overload
def parameter(start: Start, unit: str, description: str, *, shape: tuple[int, ...], **options: Any) -> NDArray[Any]: ...
@overload
def parameter(start: Start, unit: str, description: str, *, type: TypeName, **options: Any) -> Any: ...
@overload
def parameter(start: tuple[Any, ...], unit: str, description: str, **options: Any) -> NDArray[Any]: ...
@overload
def parameter(start: float, unit: str, description: str, **options: Any) -> float: ...
def parameter(start: Start, unit: str, description: str, **options: Any) -> Any:
    """Declare a parameter. `fixed=True` if it may only be set before the run; else it is tunable."""
    return _declare(Role.parameter, unit, description, start, options)


@overload
def local(start: Start, unit: str, description: str, *, shape: tuple[int, ...], **options: Any) -> NDArray[Any]: ...
@overload
def local(start: Start, unit: str, description: str, *, type: TypeName, **options: Any) -> Any: ...
@overload
def local(start: tuple[Any, ...], unit: str, description: str, **options: Any) -> NDArray[Any]: ...
@overload
def local(start: float, unit: str, description: str, **options: Any) -> float: ...
def local(start: Start, unit: str, description: str, **options: Any) -> Any:
    """Declare a local variable: memory that only the component writes, visible from outside."""
    return _declare(Role.local, unit, description, start, options)


@overload
def state(start: Start, unit: str, description: str, *, shape: tuple[int, ...], **options: Any) -> NDArray[Any]: ...
@overload
def state(start: Start, unit: str, description: str, *, type: TypeName, **options: Any) -> Any: ...
@overload
def state(start: tuple[Any, ...], unit: str, description: str, **options: Any) -> NDArray[Any]: ...
@overload
def state(start: float, unit: str, description: str, **options: Any) -> float: ...
def state(start: Start, unit: str, description: str, **options: Any) -> Any:
    """Declare a continuous state `x`; its derivative `der_x` is declared with it and written by `derivatives`."""
    return _declare(Role.state, unit, description, start, options)


@dataclass(frozen=True, slots=True)
class Terminal:
    """Variables that are connected together, such as both quantities at the end of a rod.

    `members`: by the name that the same quantity has in a terminal at the other side. `rule`: FMI's matching rule,
    "plug" if all members must be there at the other side, "bus" if some may be missing.
    """

    description: str
    members: dict[str, Variable]
    rule: str = "plug"


def terminal(description: str, /, *, rule: str = "plug", **members: Any) -> Any:
    """Declare a terminal, such as `terminal("end of the rod", position=position, force=load_force)`."""
    return Terminal(description, members, rule)


def derivative(of: Variable) -> Variable:
    """The declaration of a state's derivative."""
    unit = "1/s" if of.unit in ("", "1") else f"{of.unit}/s"
    zero = replace(of, role=Role.derivative, unit=unit, name=f"der_{of.name}", start=0.0)
    return replace(
        zero,
        description=f"derivative of {of.name}",
        display_unit="",
        minimum=None,
        maximum=None,
        nominal=None,
        source="",
    )


@dataclass(frozen=True, slots=True)
class MemoryLayout:
    """Memory of a component: one C struct. Hidden fields start with an underscore and may overlay a block.

    `offsets`: offsets of variables that are no fields of the struct itself, as in a group of components. `_x`, `_dx` [n]: all states and derivatives as flat arrays.
    """

    variables: tuple[Variable, ...]
    dtype: np.dtype[Any]
    state_size: int
    offsets: dict[str, int] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Length of the record [byte]."""
        return self.dtype.itemsize

    def offset(self, name: str) -> int:
        """Place of a field in the record [byte]."""
        assert self.dtype.fields is not None
        return self.offsets[name] if name in self.offsets else int(self.dtype.fields[name][1])


def layout(variables: Sequence[Variable], hidden: dict[str, tuple[Type, tuple[int, ...]]]) -> MemoryLayout:
    """Lay out blocks in the order of `Role`, each on a multiple of 8 byte, then the hidden fields."""
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    position = 0
    begin: dict[Role, int] = {}
    end: dict[Role, int] = {}

    def add(name: str, kind: Type, shape: tuple[int, ...], at: int) -> int:
        names.append(name)
        formats.append((storage(kind, shape), shape) if shape else storage(kind, shape))
        offsets.append(at)
        return at + DTYPES[kind].itemsize * prod(shape)

    def align(at: int, size: int) -> int:
        return -(-at // size) * size

    for role in Role:
        begin[role] = position
        for variable in variables:
            if variable.role is role:
                position = align(position, WORD if variable.shape else variable.dtype.itemsize)
                position = add(variable.name, variable.type, variable.shape, position)
        position = end[role] = align(position, WORD)
    for name, (kind, shape) in hidden.items():
        position = align(add(name, kind, shape, position), WORD)

    state_size = (end[Role.state] - begin[Role.state]) // WORD
    if state_size:
        add("_x", Float64, (state_size,), begin[Role.state])
        add("_dx", Float64, (state_size,), begin[Role.derivative])
    fields = {"names": names, "formats": formats, "offsets": offsets, "itemsize": max(position, WORD)}
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DeclarationError(f"variable {twice!r} is declared twice. Rename one of them.")
    dtype: np.dtype[Any] = np.dtype(fields, align=True)  # type: ignore[call-overload]
    return MemoryLayout(tuple(variables), dtype, state_size)
