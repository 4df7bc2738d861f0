"""Composition of members of a scenario and their connections into one component."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.coupling import GroupMember, ResolvedConnection, compose, direct_followers, stepping_order
from twin.errors import CouplingError, ScenarioError, nearest
from twin.graph import ordered_groups, reached
from twin.scenario.members import class_of, communication, component_of, whole_nanoseconds
from twin.scenario.resolution.variable_resolution import resolve_variables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.component import Component
    from twin.coupling import Catalog
    from twin.scenario.spec import Case, ScenarioSpec


def group(
    name: str, case: Case, variables: Catalog, member_names: list[str], outputs: Sequence[tuple[str, str]] = ()
) -> type[Component]:
    """Compose the chosen members of a case into one component class.

    Inputs: connected to members outside, or unconnected. `outputs`: as (member, variable), by default those read outside; all
    outputs of the members if none is.
    """
    for member in member_names:
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
    check_border(name, links, variables, member_names)
    parts = {}
    for member in case.members:
        if member in member_names:
            spec = case.members[member]
            cls = class_of(component_of(spec))
            period = whole_nanoseconds(communication(spec) or cls.period_ns or case.step_ns, f"{name}: {member}")
            parts[member] = GroupMember(cls, case.values(member, variables[member]), period)
    inside = [link for link in links if link.source.member in parts and link.target.member in parts]
    leaving = [link for link in links if link.source.member in parts and link.target.member not in parts]
    own_outputs = list(outputs) or list(dict.fromkeys(link.source.key for link in leaving))
    if not own_outputs:
        own_outputs = [(m, v.name) for m in parts for v in variables[m].values() if v.causality == "output"]
    order = [list(parts)]
    if case.algorithm.is_sequential:
        full_order = stepping_order(list(case.members), links, variables)
        check_order(name, full_order, links, member_names)
        order = [[name] for name in full_order if name in parts]
    step = whole_nanoseconds(case.step_ns, f"{name}: step")
    return compose(name, parts, inside, step, order, own_outputs)


def part(
    scenario: ScenarioSpec, member_names: Sequence[str], group_name: str | None, variant: str | None = None
) -> type[Component]:
    """Compose the chosen members or a named group into one component; the first variant by default."""
    if bool(member_names) == bool(group_name):
        group_hint = f" or --group {next(iter(scenario.groups))}" if scenario.groups else ""
        raise ScenarioError(f"{scenario.path}: say which part of it, either --members estimate,controller{group_hint}.")
    if group_name and group_name not in scenario.groups:
        hint = nearest(group_name, scenario.groups) if scenario.groups else "Name it under `groups`, or give --members."
        raise ScenarioError(f"{scenario.path}: there is no group `{group_name}`. {hint}")
    members = list(scenario.groups[group_name]) if group_name else list(member_names)
    catalogs, problems = resolve_variables(scenario)
    if problems:
        raise ScenarioError(problems)
    case = scenario.cases([variant] if variant else [])[0]
    return group(group_name or "_".join(members)[:60], case, catalogs[case.variant], members)


def check_border(name: str, links: list[ResolvedConnection], variables: Catalog, member_names: list[str]) -> None:
    """Raise CouplingError if an algebraic loop crosses the border of the group: it must be solved as a whole."""
    followers = direct_followers(links, variables)
    for keys in ordered_groups(list(followers), followers):
        members = list(dict.fromkeys(member for member, _ in keys))
        outside = [member for member in members if member not in member_names]
        if len(members) > 1 and outside and len(outside) < len(members):
            path = ", ".join(map(".".join, keys))
            inside = [member for member in members if member in member_names]
            raise CouplingError(
                f"{name}: the algebraic loop through {path} crosses the border of the group. Put {', '.join(outside)} "
                f"into the group too, leave out {', '.join(inside)}, or break the loop with a sampled component."
            )


def check_order(name: str, order: list[str], links: list[ResolvedConnection], member_names: list[str]) -> None:
    """Raise CouplingError if Gauss-Seidel order needs a member outside to step between two members of the group."""
    later_readers: dict[str, list[str]] = {}  # member -> those that step later and read it
    for link in links:
        if order.index(link.source.member) < order.index(link.target.member):
            later_readers.setdefault(link.source.member, []).append(link.target.member)
    leaving = [
        reader for member in member_names for reader in later_readers.get(member, ()) if reader not in member_names
    ]
    for member in dict.fromkeys(leaving):
        members_behind = [reader for reader in member_names if reader in reached(later_readers, [member])]
        if members_behind:
            raise CouplingError(
                f"{name}: with gauss_seidel {member} steps after one member of the group and before {members_behind[0]}, which "
                f"reads it in the same step. Put {member} into the group too, leave out {members_behind[0]}, or use jacobi."
            )
