"""System description as pure data (SSP terms): members with their variables, and connections between connectors.

A connection of two terminals stands for one connection of each pair of their members. `check` lists all problems at once;
`links` returns the resolved connections for the algorithm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin import clock
from twin.component import unit
from twin.coupling import terminals
from twin.coupling.member import MemberVariable
from twin.errors import CouplingError, nearest
from twin.graph import ordered_groups

Catalog = Mapping[str, Mapping[str, MemberVariable]]

READABLE = ("output", "local", "calculatedParameter", "parameter", "structuralParameter")


@dataclass(frozen=True, slots=True)
class Connection:
    """Connection from `member.variable` to `member.variable`; an array element is `member.variable[2]` (counted from 1).

    It may also connect two terminals, `member.terminal`. `terminals`: the connection of terminals that it is part of.
    target = factor * source + offset, after conversion of units, unless `convert` is false; `offset_unit`: "" for that
    of the target. `bond`: name shared by the connections of a power bond, one with an effort and one with the flow in the other direction. `hold`: the input is
    constant over a step, whatever the algorithm's order.
    """

    source: str
    target: str
    where: str = field(default="", compare=False)
    factor: float = 1.0
    offset: float = 0.0
    convert: bool = True
    bond: str = ""
    hold: bool = False
    terminals: str = ""
    offset_unit: str = ""

    @property
    def message_prefix(self) -> str:
        """Location of the connection, as the prefix of a message."""
        return "".join(f"{part}: " for part in (self.where, self.terminals) if part)


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference to a variable of a member, or to one element of it (`first` counts scalars from 0)."""

    member: str
    variable: MemberVariable
    first: int
    size: int

    @property
    def key(self) -> tuple[str, str]:
        """Member and variable name."""
        return self.member, self.variable.name

    @property
    def element(self) -> int | None:
        """Element of an array, counted from 0; None for a complete variable."""
        return self.first if self.size != self.variable.size else None


@dataclass(frozen=True, slots=True)
class ResolvedConnection:
    """Resolved and valid connection: target = factor * source + offset.

    `bond`: name of its declared power bond; `terminals`: connection of terminals that it is part of.
    """

    source: Reference
    target: Reference
    factor: float = 1.0
    offset: float = 0.0
    bond: str = ""
    terminals: str = ""
    hold: bool = False


def find(path: str, catalog: Catalog) -> Reference:
    """Resolve `member.variable` or `member.variable[2]`; CouplingError with a suggestion if it does not exist."""
    member, dot, name = path.partition(".")
    if not dot and member in catalog:
        own = sorted(catalog[member], key=lambda name: catalog[member][name].causality != "output")
        examples = ", ".join(f"{member}.{name}" for name in own[:3])
        raise CouplingError(f"{path!r} is a member. Name a variable of it, such as {examples}.")
    if not dot or member not in catalog:
        raise CouplingError(f"{path!r}: no member {member!r}. {nearest(member, catalog)}")
    variables = catalog[member]
    if name in variables:
        variable = variables[name]
        return Reference(member, variable, 0, variable.size)
    element = terminals.ELEMENT.fullmatch(name)
    if element and element[1] in variables:
        variable = variables[element[1]]
        if (index := variable.index_of(element[2])) is not None:
            return Reference(member, variable, index, 1)
        raise CouplingError(f"{path!r}: {element[1]} has shape {list(variable.shape)}, elements count from 1.")
    names = [*variables, *terminals.names(variables)]
    raise CouplingError(f"{path!r}: {member} has no variable {name!r}. {nearest(name, names)}")


@dataclass
class CoupledSystem:
    """Variables of members, and connections between them."""

    catalog: Catalog
    connections: list[Connection] = field(default_factory=list)

    def check(self) -> list[str]:
        """Return all problems of the connections, one line each."""
        return self._resolve()[1]

    def links(self) -> list[ResolvedConnection]:
        """Return the links of a valid system; CouplingError with all problems otherwise."""
        links, problems = self._resolve()
        if problems:
            raise CouplingError(problems)
        return links

    def single(self) -> tuple[list[Connection], list[str]]:
        """Expand connections of terminals to connections of variables; return these and the problems."""
        connections: list[Connection] = []
        problems: list[str] = []
        for connection in self.connections:
            try:
                connections += self._single(connection)
            except CouplingError as error:
                text = f"{connection.source} -> {connection.target}"
                problems += [f"{connection.message_prefix}{text}: {problem}" for problem in error.problems]
        return connections, problems

    def _single(self, connection: Connection) -> list[Connection]:
        """Expand a connection of terminals; any other one is returned as it is."""
        paths = connection.source, connection.target
        ends = [terminals.find(path, self.catalog) for path in paths]
        if ends == [None, None]:
            return [connection]
        a, b = ends
        if a is None or b is None:
            terminal, variable = (paths[0], paths[1]) if b is None else (paths[1], paths[0])
            find(variable, self.catalog)  # raises if the name does not exist
            raise CouplingError(f"{terminal} is a terminal, {variable} is a variable. Connect two of one kind.")
        text = f"{connection.source} -> {connection.target}"
        return [replace(connection, source=x, target=y, terminals=text) for x, y in terminals.expand(a, b)]

    def _resolve(self) -> tuple[list[ResolvedConnection], list[str]]:
        links: list[ResolvedConnection] = []
        connections, problems = self.single()
        sources: dict[tuple[str, str, int], Connection] = {}
        for connection in connections:
            try:
                link = self._link(connection)
            except CouplingError as error:
                problems += [f"{connection.message_prefix}{problem}" for problem in error.problems]
                continue
            target = link.target
            for i in range(target.first, target.first + target.size):
                other = sources.setdefault((*target.key, i), connection)
                if other.source != connection.source:
                    first = ", ".join(part for part in (other.where, other.terminals) if part)
                    problems.append(
                        f"{connection.message_prefix}{connection.target} has two sources, {other.source} and "
                        f"{connection.source}{f' (the first: {first})' if first else ''}. Keep one."
                    )
                    break
            links.append(link)
        return links, problems

    def _link(self, connection: Connection) -> ResolvedConnection:
        source, target = self._ends(connection)
        text = f"{connection.source} -> {connection.target}"
        if source.size != target.size:
            raise CouplingError(f"{text}: {source.size} values do not fit {target.size}. Connect elements, like x[1].")
        ends = source.variable, target.variable
        if any(end.type == "Clock" or not end.connectable for end in ends):
            return make_object_link(source, target, connection, text)
        check_items(source.variable, target.variable, text)
        if is_real(source.variable) and not is_real(target.variable):
            raise CouplingError(
                f"{text}: {source.variable.type} does not fit {target.variable.type}. Round it in a component."
            )
        if not is_real(source.variable) and not is_real(target.variable):
            a, b = (np.iinfo(v.dtype) if v.dtype.kind != "b" else None for v in (source.variable, target.variable))
            if b is None and source.variable.type != "Boolean":
                raise CouplingError(f"{text}: {source.variable.type} does not fit Boolean. Compare it in a component.")
            if (
                a is not None
                and b is not None
                and source.variable.type != "Boolean"
                and (a.min < b.min or a.max > b.max)
            ):
                raise CouplingError(f"{text}: {source.variable.type} may overflow {target.variable.type}.")
        factor, offset = 1.0, 0.0
        if connection.convert:
            factor, offset = unit.conversion(source.variable.unit, target.variable.unit, text)
        if (factor, offset) != (1.0, 0.0) and not is_real(target.variable):
            raise CouplingError(f"{text}: units of whole numbers are not converted. Use one unit on both sides.")
        if (connection.factor, connection.offset) != (1.0, 0.0):
            if not is_real(target.variable):
                raise CouplingError(f"{text}: factor and offset are for real numbers. Leave them out.")
            own_offset = connection.offset
            if connection.offset_unit:
                own_unit = target.variable.unit or "1"
                own_offset *= unit.conversion(connection.offset_unit, own_unit, f"{text}: offset")[0]
            factor, offset = factor * connection.factor, offset * connection.factor + own_offset
        return ResolvedConnection(
            source, target, factor, offset, connection.bond, connection.terminals, connection.hold
        )

    def _ends(self, connection: Connection) -> tuple[Reference, Reference]:
        """Resolve both ends of a connection; CouplingError with the problems of both."""
        text = f"{connection.source} -> {connection.target}"
        references, problems = [], []
        for number, path in enumerate((connection.source, connection.target)):
            try:
                references.append(find(path, self.catalog))
            except CouplingError as error:
                problems += error.problems
                continue
            causality = references[-1].variable.causality
            is_clock = references[-1].variable.type == "Clock"  # A time-based clock may be the source of others.
            if number == 0 and causality not in READABLE and not (is_clock and references[-1].variable.interval):
                problems.append(f"{text}: the source is an {causality}. Connect from an output.")
            elif number == 1 and causality != "input":
                problems.append(f"{text}: the target is no input but {causality}. Connect to an input.")
        if problems:
            raise CouplingError(problems)
        return references[0], references[1]


def make_object_link(source: Reference, target: Reference, connection: Connection, text: str) -> ResolvedConnection:
    """Return a link of strings, binaries or clocks, which are not converted; CouplingError if they do not fit.

    The target of a link of clocks ticks when the source does, so it must be a triggered clock.
    """
    a, b = source.variable, target.variable
    if a.type != b.type:
        advice = "Connect two clocks" if "Clock" in (a.type, b.type) else "Connect two of one type"
        raise CouplingError(f"{text}: {a.type} does not fit {b.type}. {advice}.")
    if b.interval:
        raise CouplingError(f"{text}: the target ticks by itself ({b.interval}). Connect to a triggered clock.")
    if (connection.factor, connection.offset) != (1.0, 0.0):
        raise CouplingError(f"{text}: factor and offset are for real numbers. Leave them out.")
    return ResolvedConnection(source, target)


def check_periods(periods: Mapping[str, clock.Time], step: clock.Time) -> None:
    """Raise CouplingError for periods [ns] that are no multiples of the communication step [ns]."""
    problems = []
    for name, period in periods.items():
        if period % step:
            low = period // step * step
            choice = clock.text(low + step) if low == 0 else f"{clock.text(low)} or {clock.text(low + step)}"
            problems.append(
                f"{name}: period {clock.text(period)} is not a multiple of {clock.text(step)}. Use {choice}, "
                f"or a communication step of {clock.text(clock.common_step([period, step]))}."
            )
    if problems:
        raise CouplingError(problems)


def check_items(source: MemberVariable, target: MemberVariable, text: str) -> None:
    """Raise CouplingError unless two enumerations agree: they are transferred as numbers."""
    target_items = dict(target.items)
    mismatches = [(name, number) for name, number in source.items if target_items and target_items.get(name) != number]
    if mismatches:
        name, number = mismatches[0]
        other = (
            f"is {target_items[name]}" if name in target_items else f"is not there: there are {', '.join(target_items)}"
        )
        raise CouplingError(
            f"{text}: `{name}` is {number} in the source, and {other} in the target. Convert it between."
        )


def is_real(variable: MemberVariable) -> bool:
    """Whether the values are floating-point numbers."""
    return variable.dtype.kind == "f"


def feeds(link: ResolvedConnection, output: MemberVariable) -> bool:
    """Whether an output of the link's target member depends directly on the link's input."""
    return output.dependencies is None or link.target.variable.name in output.dependencies


def direct_followers(links: list[ResolvedConnection], catalog: Catalog) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return for each connected output the connected outputs that depend on it directly, through one member."""
    return followers_of(by_source(links), lambda link, key: feeds(link, catalog[key[0]][key[1]]))


def by_source(links: Iterable[ResolvedConnection]) -> dict[tuple[str, str], list[ResolvedConnection]]:
    """Return the connections that start at each variable."""
    sources: dict[tuple[str, str], list[ResolvedConnection]] = {}
    for link in links:
        sources.setdefault(link.source.key, []).append(link)
    return sources


def followers_of(
    sources: Mapping[tuple[str, str], Sequence[ResolvedConnection]],
    depends: Callable[[ResolvedConnection, tuple[str, str]], bool],
) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return for each source the other ones in the members that it leads to for which `depends(connection, other)` holds."""
    return {
        key: [other for link in links for other in sources if other[0] == link.target.member and depends(link, other)]
        for key, links in sources.items()
    }


def stepping_order(
    members: list[str], links: list[ResolvedConnection], catalog: Catalog, together: Mapping[str, str] | None = None
) -> list[str]:
    """Return the Gauss-Seidel order: along the connections; inside a loop, along direct feedthrough; else as declared.

    `together`: for members that step together with others, the representative of their group.
    """
    representative = {name: (together or {}).get(name, name) for name in members}
    nodes = list(dict.fromkeys(representative.values()))
    followers: dict[str, list[str]] = {name: [] for name in nodes}
    direct: dict[str, list[str]] = {name: [] for name in nodes}
    for link in links:
        source, target = representative[link.source.member], representative[link.target.member]
        if source == target and together:
            continue
        followers[source].append(target)
        if any(v.causality == "output" and feeds(link, v) for v in catalog[link.target.member].values()):
            direct[source].append(target)
    order: list[str] = []
    for group in ordered_groups(nodes, followers):
        inside = {name: [f for f in direct[name] if f in group] for name in group}
        for part in ordered_groups(group, inside):
            order += part
    return order
