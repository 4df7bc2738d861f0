"""Any part of a system as one component: the members of a scenario that are named, with what couples them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import catalog
from twin.algorithm.cosimulation import Algorithm
from twin.errors import CouplingError
from twin.group import Part, compose
from twin.system import Connection, System, nearest, stepping_order

if TYPE_CHECKING:
    from twin.component import Component
    from twin.scenario.scenario import Case, Catalog


def group(name: str, case: Case, variables: Catalog, chosen: list[str]) -> type[Component]:
    """The chosen members of a case as one component class.

    Inputs: what the members read from outside or nobody drives. Outputs: what others read of them; all of their
    outputs if nobody does.
    """
    for member in chosen:
        if member not in case.members:
            raise CouplingError(f"{name}: there is no member {member!r}. {nearest(member, dict(case.members))}")
        if case.members[member].component.endswith(".fmu"):
            raise CouplingError(f"{name}: member {member!r} is a finished FMU and cannot be compiled in. Leave it out.")
    parts = {}
    for member in case.members:
        if member in chosen:
            spec, cls = case.members[member], catalog.component(case.members[member].component)
            period = spec.period_ns or cls.period_ns or case.step_ns
            parts[member] = Part(cls, case.values(member, variables[member]), period)
    connections = [Connection(one.source, one.target, one.where) for one in case.connections]
    links = System(variables, connections).links()
    inside = [link for link in links if link.source.member in parts and link.target.member in parts]
    leaving = [link for link in links if link.source.member in parts and link.target.member not in parts]
    outputs = list(dict.fromkeys(link.source.key for link in leaving))
    if not outputs:
        outputs = [(m, v.name) for m in parts for v in variables[m].values() if v.causality == "output"]
    order = [list(parts)]
    if case.algorithm == Algorithm.gauss_seidel:
        order = [[one] for one in stepping_order(list(parts), inside, variables)]
    return compose(name, parts, inside, case.step_ns, order, outputs)
