"""Flattening of nested systems into members and direct connections between them.

A flat connection is a chain of connections through the connectors of systems and the entries of signal dictionaries, with
its unit conversions and linear transformations combined. A value that is set on a system's connector is propagated to every
variable that is connected to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.fmi import FMUMember
from twin.ssp.model import ROLES_1, SOURCES, TARGETS, End, Linear, SspConnection, SspElement, ValueTable
from twin.ssp.names import member_name
from twin.ssp.parameters import AssignedValue, apply_binding, convert_value, find_variable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import MemberVariable
    from twin.ssp.package import Variant

Path = tuple[str, ...]
Node = tuple[Path, str]  # path of an element and name of its connector


@dataclass(frozen=True)
class FmuInfo:
    """Variables, fixed step [s] and default stop time [s] from an FMU's model description."""

    variables: Mapping[str, MemberVariable]
    step: float | None
    stop: float | None


@dataclass
class FlatMember:
    """An FMU of the system. `parameters`: value in the variable's unit, and its file:line."""

    element: str
    fmu: str
    where: str
    info: FmuInfo | None
    implementation: str = "any"
    parameters: dict[str, tuple[Any, str]] = field(default_factory=dict)
    annotations: list[bytes] = field(default_factory=list)
    communication_step: float | None = None  # [s]; None: that of the system


@dataclass(frozen=True)
class FlatConnection:
    """A direct connection of two variables. `change` replaces the conversion of units; None: units are converted as usual."""

    source: str
    target: str
    change: Linear | None
    where: str
    annotations: tuple[bytes, ...] = ()


@dataclass
class FlatSystem:
    """A flattened system: members by name, connections, and the problems and notes of flattening."""

    members: dict[str, FlatMember] = field(default_factory=dict)
    wires: list[FlatConnection] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def read_fmu_info(path: str, cache: dict[str, FmuInfo | None]) -> FmuInfo | None:
    """Read an FMU's model description once; None if it cannot be read, which is reported when its member is created."""
    if path not in cache:
        try:
            member = FMUMember("member", path)
        except TwinError:
            cache[path] = None
        else:
            member.close()
            experiment = member.default_experiment
            cache[path] = FmuInfo(member.variables, member.fixed_step or experiment.step_size, experiment.stop)
    return cache[path]


def flatten(variant: Variant, cache: dict[str, FmuInfo | None]) -> FlatSystem:
    """Flatten a variant. `cache`: FMU information by path, shared between variants."""
    flattener = SystemFlattener(cache)
    flattener.visit(variant.system, (), [])
    flattener.resolve_connections()
    return flattener.flat


class SystemFlattener:
    """Visits a system, then traces each connection back to its source."""

    def __init__(self, cache: dict[str, FmuInfo | None]) -> None:
        self.fmu_infos, self.flat = cache, FlatSystem()
        self.members: dict[Path, FlatMember] = {}
        self.elements: dict[Path, SspElement] = {}
        self.aliases: dict[Path, Path] = {}  # reference -> dictionary
        self.units: dict[Node, str | None] = {}
        self.inbound: dict[Node, tuple[Node, SspConnection]] = {}
        self.assigned: dict[Node, AssignedValue] = {}

    def visit(self, element: SspElement, path: Path, scopes: list[tuple[Path, SspElement]]) -> None:
        """Visit an element depth first, so that outer parameter values override inner ones."""
        self.elements[path] = element
        if element.fmu:
            self.add_member(element, path)
        elif element.kind == "dictionary":
            self.resolve_reference(element, path, scopes)
        for name, connector in element.connectors.items():
            self.units.setdefault((path, name), connector.unit)
        scopes = [*scopes, (path, element)]
        for child in element.elements:
            if child.name:
                self.visit(child, (*path, child.name), scopes)
        for connection in element.connections:
            self.connect(element, path, connection)
        for binding in element.bindings:
            apply_binding(binding, path, self.elements, self.members, self.assigned, self.flat)

    def add_member(self, element: SspElement, path: Path) -> None:
        """Add the member of an FMU component and check its connectors against the FMU's variables."""
        info = read_fmu_info(element.fmu, self.fmu_infos)
        element_name = ".".join(path)
        name = member_name(element_name)
        if name in self.flat.members:
            self.flat.problems.append(f"{element.where}: there are two elements `{element_name}`. Rename one.")
        member = FlatMember(
            element_name,
            element.fmu,
            element.where,
            info,
            element.implementation,
            annotations=element.annotations,
            communication_step=element.communication_step,
        )
        self.members[path] = self.flat.members[name] = member
        if info is None:
            return
        for connector in element.connectors.values():
            variable = find_variable(connector.name, info.variables)
            text = f"{connector.where}: `{element_name}` has the connector `{connector.name}`"
            if variable is None:
                hint = nearest(connector.name, info.variables, "`")
                self.flat.problems.append(f"{text}, but its FMU has no such variable. {hint}")
                continue
            allowed_kinds = {variable.causality, ROLES_1.get(variable.causality, ""), "inout", "unspecified", ""}
            if connector.kind not in allowed_kinds:
                self.flat.problems.append(
                    f"{text} as {connector.kind}, but it is {variable.causality} in the FMU. Correct the kind."
                )
            fmu_unit = variable.unit or None
            if connector.unit and fmu_unit and not is_same_unit(connector.unit, fmu_unit):
                self.flat.problems.append(
                    f"{text} in {unit.shown(connector.unit)}, but it is in {unit.shown(fmu_unit)} in the FMU. Correct the unit."
                )
            self.units[path, connector.name] = fmu_unit or connector.unit

    def resolve_reference(self, element: SspElement, path: Path, scopes: list[tuple[Path, SspElement]]) -> None:
        """Resolve a reference to a signal dictionary of this system or of an enclosing one."""
        for owner, system in reversed(scopes):
            if element.dictionary in system.dictionaries:
                alias = self.aliases[path] = (*owner, f"#{element.dictionary}")
                for entry, unit_text in system.dictionaries[element.dictionary].items():
                    self.units.setdefault((alias, entry), unit_text)
                return
        dictionary_names = [name for _, system in scopes for name in system.dictionaries]
        hint = (
            nearest(element.dictionary, dictionary_names, "`")
            if dictionary_names
            else "Define it under SignalDictionaries."
        )
        self.flat.problems.append(f"{element.where}: there is no signal dictionary `{element.dictionary}`. {hint}")

    def resolve_end(self, end: End, system: SspElement, path: Path, where: str) -> tuple[Node, str, str] | None:
        """Return (node, owner, kind) of an end of a connection, or None after adding a problem.

        The owner is "system" or "element". A component without connectors has its FMU's variables: some tools omit them.
        """
        element_path = path if end.element is None else (*path, end.element)
        owner = system if end.element is None else self.elements.get(element_path)
        if owner is None or end.element == "":
            hint = nearest(end.element or "", [child.name for child in system.elements], "`")
            self.flat.problems.append(f"{where}: there is no element `{end.element}`. {hint}")
            return None
        base_name = end.connector.partition("[")[0]
        name = end.connector if end.connector in owner.connectors else base_name
        member = self.members.get(element_path)
        if member is not None and member.info is None:  # its FMU cannot be read, which is reported when it is created
            return None
        variable = find_variable(end.connector, member.info.variables) if member and member.info else None
        if name in owner.connectors:
            kind = owner.connectors[name].kind
        elif variable is not None and not owner.connectors:
            kind = variable.causality
            self.units[element_path, end.connector] = variable.unit or None
        else:
            hint = nearest(name, owner.connectors, "`") if owner.connectors else "It has none: add it."
            shown_owner = f"`{owner.name}`" if end.element is not None else "the system"
            self.flat.problems.append(f"{where}: {shown_owner} has no connector `{name}`. {hint}")
            return None
        self.units.setdefault((element_path, end.connector), self.units.get((element_path, name)))
        return (
            (self.aliases.get(element_path, element_path), end.connector),
            "system" if end.element is None else "element",
            kind,
        )

    def connect(self, system: SspElement, path: Path, connection: SspConnection) -> None:
        """Register a connection in the direction that the kinds of its connectors imply."""
        where = f"{connection.where}: {connection.text}"
        first, second = (self.resolve_end(end, system, path, where) for end in (connection.start, connection.end))
        if first is None or second is None:
            return
        first_node, second_node = first[0], second[0]
        forward = first[1:] in SOURCES and second[1:] in TARGETS
        backward = second[1:] in SOURCES and first[1:] in TARGETS
        if not forward and not backward:
            kinds = " and ".join(f"{kind} of the {owner}" for _, owner, kind in (first, second))
            self.flat.problems.append(f"{where}: {kinds} cannot be connected. Connect an output to an input.")
            return
        source, target = (first_node, second_node) if forward else (second_node, first_node)
        if target in self.inbound:
            existing = self.inbound[target][1]
            text = f"it has another source already, {existing.text} ({existing.where}). Keep one."
            self.flat.problems.append(f"{where}: {text}")
            return
        self.inbound[target] = (source, connection)

    def resolve_connections(self) -> None:
        """Trace every connection into a member back to its source, then convert the assigned values."""
        for target in [node for node in self.inbound if node[0] in self.members]:
            chain, origin = self.trace_chain(target)
            if origin[0] in self.members:
                self.add_connection(origin, target, chain)
                continue
            nodes = [origin, *(node for node, _ in chain)]
            for number, node in enumerate(nodes[:-1]):
                if node in self.assigned and target not in self.assigned:
                    self.propagate_value(node, chain[number:], target)
                    break
        for (path, name), assigned in self.assigned.items():
            if path in self.members:
                member = self.members[path]
                variable = find_variable(name, member.info.variables) if member.info else None
                try:
                    value = convert_value(assigned, (variable.unit or None) if variable else assigned.unit, name)
                except CouplingError as error:
                    self.flat.problems += [f"{assigned.where}: {text}" for text in error.problems]
                    continue
                member.parameters[name] = (value, assigned.where)

    def trace_chain(self, target: Node) -> tuple[list[tuple[Node, SspConnection]], Node]:
        """Return the connections from source to target, each with the node it ends at, and the source node."""
        chain: list[tuple[Node, SspConnection]] = []
        node, visited = target, {target}
        while node in self.inbound and (node == target or node[0] not in self.members):
            source, connection = self.inbound[node]
            chain.append((node, connection))
            if source in visited:
                text = f"{connection.where}: {connection.text}: leads in a circle. Break it."
                self.flat.problems.append(text)
                break
            visited.add(source)
            node = source
        return chain[::-1], node

    def add_connection(self, origin: Node, target: Node, chain: list[tuple[Node, SspConnection]]) -> None:
        """Combine a chain of connections into one flat connection."""
        names = [f"{member_name('.'.join(path))}.{name}" for path, name in (origin, target)]
        total, current_unit = Linear(), self.units.get(origin)
        for node, connection in chain:
            next_unit = self.units.get(node)
            try:
                total, current_unit = append_connection(total, current_unit, next_unit, connection)
            except CouplingError as error:
                self.flat.problems += [f"{connection.where}: {text}" for text in error.problems]
                return
        is_usual = all(connection.change is None and not connection.suppress for _, connection in chain)
        has_units = all(self.fmu_unit(node) for node in (origin, target))
        change = None if is_usual and (has_units or total == Linear()) else total
        notes = tuple(note for _, connection in chain for note in connection.annotations)
        self.flat.wires.append(FlatConnection(names[0], names[1], change, chain[-1][1].where, notes))

    def fmu_unit(self, node: Node) -> str:
        """Return the unit that the FMU declares for a variable; "" if none."""
        info = self.members[node[0]].info
        variable = find_variable(node[1], info.variables) if info else None
        return variable.unit if variable else ""

    def propagate_value(self, node: Node, chain: list[tuple[Node, SspConnection]], target: Node) -> None:
        """Propagate a value that is set on a system's connector to a member's variable."""
        assigned = self.assigned[node]
        current_unit = self.units.get(node)
        try:
            value = convert_value(assigned, current_unit, node[1])
            current_unit = current_unit or assigned.unit
            for next_node, connection in chain:
                next_unit = self.units.get(next_node)
                step = AssignedValue(value, current_unit, connection.change, connection.suppress, assigned.where)
                value, current_unit = (
                    convert_value(step, next_unit, node[1]),
                    next_unit or (None if connection.suppress else current_unit),
                )
        except CouplingError as error:
            self.flat.problems += [f"{assigned.where}: {text}" for text in error.problems]
            return
        self.assigned[target] = AssignedValue(value, current_unit, None, False, assigned.where)


def append_connection(
    total: Linear, current_unit: str | None, next_unit: str | None, connection: SspConnection
) -> tuple[Linear, str | None]:
    """Append a connection to a transformation: convert units, then transform. Returns the result and its unit."""
    if isinstance(connection.change, ValueTable):
        if any(source != target for source, target in connection.change.entries.items()):
            raise CouplingError(
                f"{connection.text}: maps single values, which only a component can do. Put one between."
            )
    if not connection.suppress and current_unit and next_unit:
        total = total.then(Linear(*unit.conversion(current_unit, next_unit, connection.text)))
    if isinstance(connection.change, Linear):
        total = total.then(connection.change)
    return total, next_unit or (None if connection.suppress else current_unit)


def is_same_unit(first: str, second: str) -> bool:
    """Whether two units have the same dimension, factor and offset; unknown units count as equal."""
    if first == second:
        return True
    try:
        first_unit, second_unit = unit.describe(first), unit.describe(second)
    except CouplingError:
        return True
    return (
        unit.same_kind(first_unit, second_unit)
        and abs(first_unit.factor - second_unit.factor) <= 1e-9 * abs(second_unit.factor)
        and abs(first_unit.offset - second_unit.offset) < 1e-6
    )
