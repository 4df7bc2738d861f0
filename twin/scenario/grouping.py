"""Any part of a system as one component: the members of a scenario that are named, with what couples them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import catalog
from twin.coupling import Link, Part, compose, direct_followers, stepping_order
from twin.errors import CouplingError, ScenarioError, nearest
from twin.graph import ordered_groups, reached
from twin.scenario.members import communication, component_of, whole
from twin.scenario.resolve_variables import look_up

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component
    from twin.coupling import Catalog
    from twin.scenario.spec import Case, Scenario

KEPT = 64  # groups
_composed: dict[tuple[Any, ...], type[Component]] = {}  # who reads a scenario again need not write its groups again


def group(name: str, case: Case, variables: Catalog, chosen: list[str]) -> type[Component]:
    """The chosen members of a case as one component class.

    Inputs: what the members read from outside or nobody drives. Outputs: what others read of them; all of their
    outputs if nobody does.
    """
    for member in chosen:
        if member not in case.members:
            raise CouplingError(f"{name}: there is no member {member!r}. {nearest(member, case.members)}")
        if case.members[member].component.endswith(".fmu"):
            raise CouplingError(f"{name}: member {member!r} is a finished FMU and cannot be compiled in. Leave it out.")
        if case.members[member].isolate:
            raise CouplingError(
                f"{name}: member {member!r} has `isolate: true`, and a group is one piece of code. Remove that key, or "
                f"leave the member out."
            )
    links = case.system(variables).links()
    check_border(name, links, variables, chosen)
    parts = {}
    for member in case.members:
        if member in chosen:
            spec = case.members[member]
            made = component_of(spec)
            cls = catalog.component(made) if isinstance(made, str) else made
            period = whole(communication(spec) or cls.period_ns or case.step_ns, f"{name}: {member}")
            parts[member] = Part(cls, case.values(member, variables[member]), period)
    inside = [link for link in links if link.source.member in parts and link.target.member in parts]
    leaving = [link for link in links if link.source.member in parts and link.target.member not in parts]
    outputs = list(dict.fromkeys(link.source.key for link in leaving))
    if not outputs:
        outputs = [(m, v.name) for m in parts for v in variables[m].values() if v.causality == "output"]
    order = [list(parts)]
    if case.algorithm.is_sequential:
        every = stepping_order(list(case.members), links, variables)
        check_order(name, every, links, chosen)
        order = [[one] for one in every if one in parts]
    step = whole(case.step_ns, f"{name}: step")
    key = (name, *map(content, parts.items()), *map(way, inside), step, str(order), str(outputs))
    if key not in _composed:
        if len(_composed) >= KEPT:
            _composed.pop(next(iter(_composed)))
        _composed[key] = compose(name, parts, inside, step, order, outputs)
    return _composed[key]


def content(item: tuple[str, Part]) -> tuple[Any, ...]:
    """A member of a group as a key: what is equal gives the same group."""
    name, part = item
    arrays = [(key, np.asarray(value)) for key, value in part.values.items()]
    return name, part.component, part.period, *((key, a.dtype.str, a.shape, a.tobytes()) for key, a in arrays)


def way(link: Link) -> tuple[Any, ...]:
    """A connection in a group as a key."""
    ends = ((end.key, end.first, end.size) for end in (link.source, link.target))
    return *ends, link.factor, link.offset


def part(scenario: Scenario, chosen: Sequence[str], named: str | None, variant: str | None = None) -> type[Component]:
    """The chosen members, or a group that the scenario names, as one component; its first variant if none is given."""
    if bool(chosen) == bool(named):
        known = f" or --group {next(iter(scenario.groups))}" if scenario.groups else ""
        raise ScenarioError(f"{scenario.path}: say which part of it, either --members estimate,controller{known}.")
    if named and named not in scenario.groups:
        hint = nearest(named, scenario.groups) if scenario.groups else "Name it under `groups`, or give --members."
        raise ScenarioError(f"{scenario.path}: there is no group `{named}`. {hint}")
    members = list(scenario.groups[named]) if named else list(chosen)
    catalogs, problems = look_up(scenario)
    if problems:
        raise ScenarioError(problems)
    case = scenario.cases([variant] if variant else [])[0]
    return group(named or "_".join(members)[:60], case, catalogs[case.variant], members)


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
