"""A description with systems inside systems as members and wires between them.

A wire is a chain of connections through the connectors of systems and the entries of signal dictionaries, its units
and linear transformations put together. A value that is set on a system's connector goes to all that hang on it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.fmi import FMUMember
from twin.ssp.model import ROLES_1, SOURCES, TARGETS, Connection, Element, End, Linear, Table
from twin.ssp.names import member_name
from twin.ssp.parameters import Given, apply, find, settle

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import MemberVariable
    from twin.ssp.package import Variant

Path = tuple[str, ...]
Node = tuple[Path, str]  # where the element is, and its connector


@dataclass(frozen=True)
class Facts:
    """What an FMU says of itself."""

    variables: Mapping[str, MemberVariable]
    step: float | None
    stop: float | None


@dataclass
class Member:
    """An FMU of the system; `parameters`: value in the variable's unit, and where it is said."""

    element: str
    fmu: str
    where: str
    facts: Facts | None
    implementation: str = "any"
    parameters: dict[str, tuple[Any, str]] = field(default_factory=dict)
    annotations: list[bytes] = field(default_factory=list)


@dataclass(frozen=True)
class Wire:
    """`change`: what is done to a value instead of converting units; None: these are converted as ever."""

    source: str
    target: str
    change: Linear | None
    where: str
    annotations: tuple[bytes, ...] = ()


@dataclass
class Flat:
    """Members by name, wires, and what was found on the way."""

    members: dict[str, Member] = field(default_factory=dict)
    wires: list[Wire] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def facts(path: str, found: dict[str, Facts | None]) -> Facts | None:
    """What an FMU says, asked once; None if it cannot be read, which is told when its member is made."""
    if path not in found:
        try:
            member = FMUMember("member", path)
        except TwinError:
            found[path] = None
        else:
            member.close()
            told = member.default_experiment
            found[path] = Facts(member.variables, member.fixed_step or told.step_size, told.stop)
    return found[path]


def flattened(variant: Variant, known: dict[str, Facts | None]) -> Flat:
    """A variant's members and wires; `known`: what is known of FMUs already."""
    made = Flattener(known)
    made.visit(variant.system, (), [])
    made.wire()
    return made.flat


class Flattener:
    """Walks a system, then follows each connection back to where its values come from."""

    def __init__(self, known: dict[str, Facts | None]) -> None:
        self.known, self.flat = known, Flat()
        self.members: dict[Path, Member] = {}
        self.elements: dict[Path, Element] = {}
        self.aliases: dict[Path, Path] = {}  # of references to the dictionary that they mean
        self.units: dict[Node, str | None] = {}
        self.inbound: dict[Node, tuple[Node, Connection]] = {}
        self.given: dict[Node, Given] = {}

    def visit(self, element: Element, path: Path, scopes: list[tuple[Path, Element]]) -> None:
        """Take an element and all that is in it; what is inside comes first, so that outer values win."""
        self.elements[path] = element
        if element.fmu:
            self.member(element, path)
        elif element.kind == "dictionary":
            self.reference(element, path, scopes)
        for name, connector in element.connectors.items():
            self.units.setdefault((path, name), connector.unit)
        scopes = [*scopes, (path, element)]
        for child in element.elements:
            if child.name:
                self.visit(child, (*path, child.name), scopes)
        for connection in element.connections:
            self.connect(element, path, connection)
        for binding in element.bindings:
            apply(binding, path, self.elements, self.members, self.given, self.flat)

    def member(self, element: Element, path: Path) -> None:
        """A component that is an FMU, and whether its connectors are the FMU's variables."""
        told = facts(element.fmu, self.known)
        place = ".".join(path)
        name = member_name(place)
        if name in self.flat.members:
            self.flat.problems.append(f"{element.where}: there are two elements `{place}`. Rename one.")
        member = Member(
            place, element.fmu, element.where, told, element.implementation, annotations=element.annotations
        )
        self.members[path] = self.flat.members[name] = member
        if told is None:
            return
        for connector in element.connectors.values():
            variable = find(connector.name, told.variables)
            text = f"{connector.where}: `{place}` has the connector `{connector.name}`"
            if variable is None:
                hint = nearest(connector.name, told.variables, "`")
                self.flat.problems.append(f"{text}, but its FMU has no such variable. {hint}")
                continue
            causes = {variable.causality, ROLES_1.get(variable.causality, ""), "inout", "unspecified", ""}
            if connector.kind not in causes:
                self.flat.problems.append(
                    f"{text} as {connector.kind}, but it is {variable.causality} in the FMU. Correct the kind."
                )
            own = variable.unit or None
            if connector.unit and own and not same(connector.unit, own):
                self.flat.problems.append(
                    f"{text} in {unit.shown(connector.unit)}, but it is in {unit.shown(own)} in the FMU. Correct the unit."
                )
            self.units[path, connector.name] = own or connector.unit

    def reference(self, element: Element, path: Path, scopes: list[tuple[Path, Element]]) -> None:
        """A reference to a signal dictionary of this system or of one around it."""
        for owner, system in reversed(scopes):
            if element.dictionary in system.dictionaries:
                alias = self.aliases[path] = (*owner, f"#{element.dictionary}")
                for entry, text in system.dictionaries[element.dictionary].items():
                    self.units.setdefault((alias, entry), text)
                return
        known = [name for _, system in scopes for name in system.dictionaries]
        hint = nearest(element.dictionary, known, "`") if known else "Define it under SignalDictionaries."
        self.flat.problems.append(f"{element.where}: there is no signal dictionary `{element.dictionary}`. {hint}")

    def end(self, end: End, system: Element, path: Path, where: str) -> tuple[Node, str, str] | None:
        """(connector, whose it is, its kind) of an end of a connection; else a problem.

        A component that lists no connectors has its FMU's variables: some tools leave them out.
        """
        place = path if end.element is None else (*path, end.element)
        owner = system if end.element is None else self.elements.get(place)
        if owner is None or end.element == "":
            hint = nearest(end.element or "", [one.name for one in system.elements], "`")
            self.flat.problems.append(f"{where}: there is no element `{end.element}`. {hint}")
            return None
        whole = end.connector.partition("[")[0]
        name = end.connector if end.connector in owner.connectors else whole
        member = self.members.get(place)
        found = find(end.connector, member.facts.variables) if member and member.facts else None
        if name in owner.connectors:
            kind = owner.connectors[name].kind
        elif found is not None and not owner.connectors:
            kind = found.causality
            self.units[place, end.connector] = found.unit or None
        else:
            hint = nearest(name, owner.connectors, "`") if owner.connectors else "It has none: add it."
            called = f"`{owner.name}`" if end.element is not None else "the system"
            self.flat.problems.append(f"{where}: {called} has no connector `{name}`. {hint}")
            return None
        self.units.setdefault((place, end.connector), self.units.get((place, name)))
        return (self.aliases.get(place, place), end.connector), "system" if end.element is None else "element", kind

    def connect(self, system: Element, path: Path, connection: Connection) -> None:
        """One connection, in the direction that the kinds of its connectors say."""
        where = f"{connection.where}: {connection.text}"
        first, second = (self.end(one, system, path, where) for one in (connection.start, connection.end))
        if first is None or second is None:
            return
        a, b = first[0], second[0]
        forward = first[1:] in SOURCES and second[1:] in TARGETS
        backward = second[1:] in SOURCES and first[1:] in TARGETS
        if not forward and not backward:
            kinds = " and ".join(f"{kind} of the {owner}" for _, owner, kind in (first, second))
            self.flat.problems.append(f"{where}: {kinds} cannot be connected. Connect an output to an input.")
            return
        source, target = (a, b) if forward else (b, a)
        if target in self.inbound:
            other = self.inbound[target][1]
            text = f"it has another source already, {other.text} ({other.where}). Keep one."
            self.flat.problems.append(f"{where}: {text}")
            return
        self.inbound[target] = (source, connection)

    def wire(self) -> None:
        """Follow every connection into a member back to its source, then settle the values."""
        for target in [node for node in self.inbound if node[0] in self.members]:
            chain, origin = self.chain(target)
            if origin[0] in self.members:
                self.add(origin, target, chain)
                continue
            reached = [origin, *(node for node, _ in chain)]
            for number, node in enumerate(reached[:-1]):
                if node in self.given and target not in self.given:
                    self.hand_down(node, chain[number:], target)
                    break
        for (path, name), one in self.given.items():
            if path in self.members:
                member = self.members[path]
                variable = find(name, member.facts.variables) if member.facts else None
                try:
                    value = settle(one, (variable.unit or None) if variable else one.unit, name)
                except CouplingError as error:
                    self.flat.problems += [f"{one.where}: {text}" for text in error.problems]
                    continue
                member.parameters[name] = (value, one.where)

    def chain(self, target: Node) -> tuple[list[tuple[Node, Connection]], Node]:
        """The connections from a source to a target in their order, each with where it leads; and the source."""
        found: list[tuple[Node, Connection]] = []
        node, seen = target, {target}
        while node in self.inbound and (node == target or node[0] not in self.members):
            source, connection = self.inbound[node]
            found.append((node, connection))
            if source in seen:
                text = f"{connection.where}: {connection.text}: leads in a circle. Break it."
                self.flat.problems.append(text)
                break
            seen.add(source)
            node = source
        return found[::-1], node

    def add(self, origin: Node, target: Node, chain: list[tuple[Node, Connection]]) -> None:
        """The wire of a chain of connections."""
        names = [f"{member_name('.'.join(path))}.{name}" for path, name in (origin, target)]
        total, here = Linear(), self.units.get(origin)
        for node, one in chain:
            there = self.units.get(node)
            try:
                total, here = hop(total, here, there, one)
            except CouplingError as error:
                self.flat.problems += [f"{one.where}: {text}" for text in error.problems]
                return
        is_usual = all(one.change is None and not one.suppress for _, one in chain)
        has_units = all(self.fmu_unit(node) for node in (origin, target))
        change = None if is_usual and (has_units or total == Linear()) else total
        notes = tuple(note for _, one in chain for note in one.annotations)
        self.flat.wires.append(Wire(names[0], names[1], change, chain[-1][1].where, notes))

    def fmu_unit(self, node: Node) -> str:
        """The unit that the FMU itself gives a variable; "" if none."""
        told = self.members[node[0]].facts
        variable = find(node[1], told.variables) if told else None
        return variable.unit if variable else ""

    def hand_down(self, node: Node, chain: list[tuple[Node, Connection]], target: Node) -> None:
        """A value that is set on a system's connector, handed to a member's variable."""
        one = self.given[node]
        here = self.units.get(node)
        try:
            value = settle(one, here, node[1])
            here = here or one.unit
            for following, connection in chain:
                there = self.units.get(following)
                step = Given(value, here, connection.change, connection.suppress, one.where)
                value, here = settle(step, there, node[1]), there or (None if connection.suppress else here)
        except CouplingError as error:
            self.flat.problems += [f"{one.where}: {text}" for text in error.problems]
            return
        self.given[target] = Given(value, here, None, False, one.where)


def hop(total: Linear, here: str | None, there: str | None, connection: Connection) -> tuple[Linear, str | None]:
    """What comes after one more connection, and its unit: units first, then the transformation."""
    if isinstance(connection.change, Table):
        if any(source != target for source, target in connection.change.entries.items()):
            raise CouplingError(
                f"{connection.text}: maps single values, which only a component can do. Put one between."
            )
    if not connection.suppress and here and there:
        total = total.then(Linear(*unit.conversion(here, there, connection.text)))
    if isinstance(connection.change, Linear):
        total = total.then(connection.change)
    return total, there or (None if connection.suppress else here)


def same(one: str, other: str) -> bool:
    """Whether two units are of one kind and size; units that nobody can compute with are not doubted."""
    if one == other:
        return True
    try:
        a, b = unit.describe(one), unit.describe(other)
    except CouplingError:
        return True
    return unit.same_kind(a, b) and abs(a.factor - b.factor) <= 1e-9 * abs(b.factor) and abs(a.offset - b.offset) < 1e-6
