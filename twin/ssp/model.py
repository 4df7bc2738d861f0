"""Data model of the files of an SSP in the terms of the standard; `where` is the file:line of each item."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from twin.component import unit
from twin.errors import CouplingError

SOURCES = {  # (owner, kind) of valid sources, and of valid targets below: SSP 2.0, "Allowed Connections"
    *(("system", kind) for kind in ("structuralParameter", "parameter", "input")),
    *(("element", kind) for kind in ("constant", "calculatedParameter", "output", "local", "inout", "unspecified")),
}
TARGETS = {
    *(("element", kind) for kind in ("structuralParameter", "parameter", "input", "inout", "unspecified")),
    *(("system", kind) for kind in ("constant", "calculatedParameter", "output", "local")),
}

KINDS = {kind for _, kind in SOURCES | TARGETS}
ROLES_1 = {"local": "output", "structuralParameter": "parameter"}  # SSP 1.0 does not define these kinds


@dataclass
class Messages:
    """Messages about an SSP: problems prevent a run; deviations break a rule of SSP but have only one sensible reading."""

    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    deviations: list[str] = field(default_factory=list)

    def extend(self, other: Messages) -> None:
        """Append the messages of a part."""
        self.problems += other.problems
        self.notes += other.notes
        self.deviations += other.deviations


@dataclass(frozen=True)
class Linear:
    """Linear transformation: target = factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def then(self, other: Linear) -> Linear:
        """Compose with a transformation that is applied afterwards."""
        return Linear(other.factor * self.factor, other.factor * self.offset + other.offset)

    def of(self, value: float) -> float:
        """Transform a value; the identity returns the same bits."""
        return value if self == Linear() else self.factor * value + self.offset


@dataclass(frozen=True)
class ValueTable:
    """Mapping of discrete values; a value without an entry is unchanged."""

    entries: dict[Any, Any]


@dataclass
class Connector:
    """A connector. `kind` is SSP's: input, output, parameter, ...; `unit`: its text, None if unspecified."""

    name: str
    kind: str
    unit: str | None
    where: str


@dataclass
class End:
    """An end of a connection: on the system itself if `element` is None."""

    element: str | None
    connector: str


@dataclass
class SspConnection:
    """A connection of two connectors, whose kinds determine its direction."""

    start: End
    end: End
    change: Linear | ValueTable | None
    suppress: bool  # no conversion of units
    where: str
    annotations: list[bytes] = field(default_factory=list)

    @property
    def text(self) -> str:
        """`element.connector -> element.connector`, for messages."""
        ends = (".".join(part for part in (end.element, end.connector) if part) for end in (self.start, self.end))
        return " -> ".join(ends)


@dataclass
class Parameter:
    """One value of a parameter set as a Python value: a list for an array."""

    name: str
    value: Any
    unit: str | None
    where: str


@dataclass
class ParameterMappingEntry:
    """One line of a parameter mapping."""

    source: str
    target: str
    change: Linear | ValueTable | None
    suppress: bool
    where: str


@dataclass
class Binding:
    """A parameter set that is applied to an element, by a mapping if there is one."""

    parameters: list[Parameter]
    mapping: list[ParameterMappingEntry] | None
    where: str


@dataclass
class SspElement:
    """A component, a system or a reference to a signal dictionary."""

    kind: str  # component, system, dictionary
    name: str
    where: str
    connectors: dict[str, Connector] = field(default_factory=dict)
    bindings: list[Binding] = field(default_factory=list)
    elements: list[SspElement] = field(default_factory=list)
    connections: list[SspConnection] = field(default_factory=list)
    dictionaries: dict[str, dict[str, str | None]] = field(default_factory=dict)  # name -> entry -> unit
    dictionary: str = ""  # name of the referenced dictionary
    fmu: str = ""  # path of the file
    implementation: str = "any"  # FMI interface
    communication_step: float | None = None  # [s]; None: that of the system
    annotations: list[bytes] = field(default_factory=list)


def resolve_unit(units: dict[str, str], typed: Any, where: str, deviations: list[str]) -> str | None:
    """Return the text of a typed element's unit, by the definitions of its file or by its name; None without a unit.

    An unknown unit is reported as a deviation, and None is returned: values are not converted.
    """
    name = None if typed is None else typed.get("unit")
    if name is None:
        return None
    if name in units:
        return units[name]
    try:
        unit.describe(name)
    except CouplingError as error:
        deviations.append(f"{where}: {error} Or define it under Units in this file. Values are not converted.")
        return None
    return str(name)
