"""What the files of an SSP say, as plain data in SSP's own words; every part knows where it stands."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from twin.component import unit
from twin.errors import CouplingError

SOURCES = {  # (owner, kind) that a value may come from, and go to: SSP 2.0, "Allowed Connections"
    *(("system", kind) for kind in ("structuralParameter", "parameter", "input")),
    *(("element", kind) for kind in ("constant", "calculatedParameter", "output", "local", "inout", "unspecified")),
}
TARGETS = {
    *(("element", kind) for kind in ("structuralParameter", "parameter", "input", "inout", "unspecified")),
    *(("system", kind) for kind in ("constant", "calculatedParameter", "output", "local")),
}

KINDS = {kind for _, kind in SOURCES | TARGETS}
ROLES_1 = {"local": "output", "structuralParameter": "parameter"}  # SSP 1.0 has no words for these


@dataclass
class Units:
    """The units that one file defines, as the texts by which they are known here."""

    texts: dict[str, str] = field(default_factory=dict)

    def text(self, name: str | None) -> str | None:
        """A unit's text; CouplingError if the file does not define it and nobody knows it."""
        if name is None or name in self.texts:
            return None if name is None else self.texts[name]
        unit.describe(name)
        return name


@dataclass(frozen=True)
class Linear:
    """target = factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def then(self, other: Linear) -> Linear:
        """What comes of it and then of another."""
        return Linear(other.factor * self.factor, other.factor * self.offset + other.offset)

    def of(self, value: float) -> float:
        """The value that it makes of another; the same bits where there is nothing to do."""
        return value if self == Linear() else self.factor * value + self.offset


@dataclass(frozen=True)
class Table:
    """Values by values; what is not in it stays."""

    entries: dict[Any, Any]


@dataclass
class Connector:
    """`kind` is SSP's: input, output, parameter, ...; `unit` its text, None where it is not said."""

    name: str
    kind: str
    unit: str | None
    where: str


@dataclass
class End:
    """An end of a connection: of the system itself, if no element is named."""

    element: str | None
    connector: str


@dataclass
class Connection:
    """Of two connectors, whose kinds say in which direction."""

    start: End
    end: End
    change: Linear | Table | None
    suppress: bool  # no conversion of units
    where: str
    annotations: list[bytes] = field(default_factory=list)

    @property
    def text(self) -> str:
        """For messages."""
        ends = (".".join(part for part in (one.element, one.connector) if part) for one in (self.start, self.end))
        return " -> ".join(ends)


@dataclass
class Parameter:
    """One value of a parameter set, as Python's own: a list for an array."""

    name: str
    value: Any
    unit: str | None
    where: str


@dataclass
class Entry:
    """One line of a parameter mapping."""

    source: str
    target: str
    change: Linear | Table | None
    suppress: bool
    where: str


@dataclass
class Binding:
    """A parameter set that is applied to an element, by a mapping if there is one."""

    parameters: list[Parameter]
    mapping: list[Entry] | None
    where: str


@dataclass
class Element:
    """A component, a system or a reference to a signal dictionary."""

    kind: str  # component, system, dictionary
    name: str
    where: str
    connectors: dict[str, Connector] = field(default_factory=dict)
    bindings: list[Binding] = field(default_factory=list)
    elements: list[Element] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    dictionaries: dict[str, dict[str, str | None]] = field(default_factory=dict)  # name -> entry -> unit
    dictionary: str = ""  # that is referred to
    fmu: str = ""  # path of the file
    implementation: str = "any"  # of FMI
    annotations: list[bytes] = field(default_factory=list)


def known(units: Units, name: str | None, where: str, problems: list[str]) -> str | None:
    """A unit's text; one that nobody knows is told and counts as none."""
    try:
        return units.text(name)
    except CouplingError as error:
        problems.append(f"{where}: {error} Or define it under Units in this file.")
        return None
