"""Measured inputs as members: a column of a file drives what an output or an input of the model was."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twin.compiler import read_float
from twin.component import Component, Int64, local, output, parameter, unit
from twin.coupling import Catalog, declared_variables, find
from twin.errors import TwinError
from twin.graph import reached
from twin.scenario import Case, ConnectionSpec, MemberSpec, Node, RecordSpec, ScenarioSpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.identify.problem import Unknown


class Replay(Component):
    """A recorded column: one value for every communication point, read from memory that the caller owns."""

    value = output("", "the value now, in the unit of what it drives")
    table = parameter(0, "", "address of the values", type=Int64, fixed=True)
    count = parameter(1, "", "how many there are; the last one is held", type=Int64, minimum=1, fixed=True)
    row = local(0, "", "current row of the table", type=Int64)

    def initialize(self) -> None:
        """Begin with the first value."""
        self.row = 0
        self.value = read_float(self.table)

    def step(self, t: float, h: float) -> None:  # noqa: ARG002 - the form of a component
        """Go to the next value."""
        if self.row + 1 < self.count:
            self.row += 1
        self.value = read_float(self.table + 8 * self.row)


def member_name(number: int) -> str:
    """Name of the member that replays an input; no member of a scenario can have it."""
    return f"recorded {number + 1}"


def with_recorded_inputs(case: Case, catalog: Catalog, signals: Sequence[str]) -> Case:
    """The case with recorded members that replace `signals`: outputs that others read, or inputs.

    TwinError if one of them is read by nothing.
    """
    connections = [
        ConnectionSpec(
            connection.source,
            connection.target,
            connection.where,
            connection.factor,
            connection.offset,
            connection.convert,
            connection.bond,
            connection.hold,
        )
        for connection in case.system(catalog).single()[0]
    ]
    members = dict(case.members)
    for number, signal in enumerate(signals):
        source = f"{member_name(number)}.value"
        if find(signal, catalog).variable.causality == "input":
            connections = [connection for connection in connections if connection.target != signal]
            connections.append(ConnectionSpec(source, signal))
        else:
            if not any(connection.source == signal for connection in connections):
                raise TwinError(f"{signal}: nothing in the model reads it, so it cannot drive anything. Name an input.")
            connections = [
                redirected(connection, source, catalog) if connection.source == signal else connection
                for connection in connections
            ]
        members[member_name(number)] = MemberSpec("recorded", made=Replay)
    return replace(case, members=members, connections=tuple(connections))


def redirected(connection: ConnectionSpec, source: str, catalog: Catalog) -> ConnectionSpec:
    """The connection from a recorded member, whose value is in the unit of the source that it replaces."""
    given, wanted = (find(name, catalog).variable.unit for name in (connection.source, connection.target))
    factor, offset = unit.conversion(given, wanted, connection.target) if connection.convert else (1.0, 0.0)
    if (factor, offset) == (1.0, 0.0):
        return replace(connection, source=source)
    offset = offset * connection.factor + connection.offset
    return replace(connection, source=source, factor=factor * connection.factor, offset=offset, convert=False)


def with_influence(case: Case, outputs: Iterable[str]) -> Case:
    """The case with those members alone that have influence on what is compared, and with what happens to them."""
    sources: dict[str, list[str]] = {name: [] for name in case.members}
    for connection in case.connections:
        sources[connection.target.partition(".")[0]].append(connection.source.partition(".")[0])
    for condition in case.conditions:
        for target in condition.targets:
            sources[target].extend(condition.sources)
    compared = {signal.partition(".")[0] for signal in outputs}
    influential_members = compared | reached(sources, compared)
    signals = tuple(dict.fromkeys(signal.partition("[")[0] for signal in outputs))
    return replace(
        case,
        members={name: member for name, member in case.members.items() if name in influential_members},
        connections=tuple(
            connection for connection in case.connections if connection.target.partition(".")[0] in influential_members
        ),
        events=tuple(event for event in case.events if event.variable.partition(".")[0] in influential_members),
        conditions=tuple(
            replace(
                condition,
                actions=tuple(
                    each for each in condition.actions if each.variable.partition(".")[0] in influential_members
                ),
            )
            for condition in case.conditions
            if condition.sources <= influential_members
        ),
        faults=(),
        record=RecordSpec(signals),
    )


def bind_tables(case: Case, tables: Sequence[np.ndarray[tuple[int], np.dtype[np.float64]]]) -> Case:
    """Return the case whose recorded members read these values; the caller must keep them in memory during the run."""
    members = dict(case.members)
    for number, table in enumerate(tables):
        name = member_name(number)
        if name in members:
            values = {"table": int(table.ctypes.data), "count": len(table)}
            members[name] = replace(members[name], parameters=values)
    return replace(case, members=members)


def catalog_of(case: Case, catalog: Catalog) -> Catalog:
    """Variables of the case's members."""
    own = declared_variables(Replay)
    return {name: own if member.made is Replay else catalog[name] for name, member in case.members.items()}


def fixed_in_scenario(scenario: ScenarioSpec, case: Case, unknowns: list[Unknown]) -> list[str]:
    """Where a scenario's member says itself what is looked for: there a parameter set does not count."""
    problems = []
    for unknown in unknowns:
        inside = ("members", unknown.member, "parameters")
        for path in (inside, ("variants", case.variant, *inside)) if unknown.member else ():
            entries = scenario.source_tree.find(path).entries if reaches(scenario.source_tree, path) else {}
            problems += [
                f"{node.location}: {unknown.member}.{name} is set there, which wins over a parameter set. Remove it there."
                for name, node in entries.items()
                if name.partition("[")[0] == unknown.variable.partition("[")[0]
            ]
    return problems


def reaches(node: Node, path: tuple[str, ...]) -> bool:
    """Whether there is something at the end of a path."""
    for step in path:
        if step not in node.entries:
            return False
        node = node.entries[step]
    return True
