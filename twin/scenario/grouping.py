"""Any part of a system as one component: the members of a scenario that are named, with what couples them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.component import catalog
from twin.coupling import Algorithm, Connection, Link, Part, System, compose, direct_followers, nearest, stepping_order
from twin.errors import CouplingError
from twin.graph import ordered_groups, reached

if TYPE_CHECKING:
    from twin.component import Component
    from twin.coupling import Catalog
    from twin.scenario.spec import Case


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
    links = links_of(case, variables)
    check_border(name, links, variables, chosen)
    parts = {}
    for member in case.members:
        if member in chosen:
            spec = case.members[member]
            cls = spec.made or catalog.component(spec.component)
            period = spec.period_ns or cls.period_ns or case.step_ns
            parts[member] = Part(cls, case.values(member, variables[member]), period)
    inside = [link for link in links if link.source.member in parts and link.target.member in parts]
    leaving = [link for link in links if link.source.member in parts and link.target.member not in parts]
    outputs = list(dict.fromkeys(link.source.key for link in leaving))
    if not outputs:
        outputs = [(m, v.name) for m in parts for v in variables[m].values() if v.causality == "output"]
    order = [list(parts)]
    if case.algorithm == Algorithm.gauss_seidel:
        every = stepping_order(list(case.members), links, variables)
        check_order(name, every, links, chosen)
        order = [[one] for one in every if one in parts]
    return compose(name, parts, inside, case.step_ns, order, outputs)


def links_of(case: Case, variables: Catalog) -> list[Link]:
    """The connections of a case, checked."""
    return System(variables, [Connection(one.source, one.target, one.where) for one in case.connections]).links()


def check_border(name: str, links: list[Link], variables: Catalog, chosen: list[str]) -> None:
    """A loop without delay must be solved as one: it may not be cut by the border of the group."""
    followers = direct_followers(links, variables)
    for keys in ordered_groups(list(followers), followers):
        members = list(dict.fromkeys(member for member, _ in keys))
        outside = [member for member in members if member not in chosen]
        if len(members) > 1 and outside and len(outside) < len(members):
            path = ", ".join(map(".".join, keys))
            inside = [member for member in members if member in chosen]
            raise CouplingError(
                f"{name}: the algebraic loop through {path} crosses the border of the group. Put {', '.join(outside)} "
                f"into the group too, leave out {', '.join(inside)}, or break the loop with a sampled component."
            )


def check_order(name: str, order: list[str], links: list[Link], chosen: list[str]) -> None:
    """Gauss-Seidel: the group steps as one, so no member outside may have to step between two inside."""
    after: dict[str, list[str]] = {}  # member -> those that step later and read it
    for link in links:
        if order.index(link.source.member) < order.index(link.target.member):
            after.setdefault(link.source.member, []).append(link.target.member)
    leaving = [one for member in chosen for one in after.get(member, ()) if one not in chosen]
    for member in dict.fromkeys(leaving):
        back = [one for one in chosen if one in reached(after, [member])]
        if back:
            raise CouplingError(
                f"{name}: with gauss_seidel {member} steps after one member of the group and before {back[0]}, which "
                f"reads it in the same step. Put {member} into the group too, leave out {back[0]}, or use jacobi."
            )
