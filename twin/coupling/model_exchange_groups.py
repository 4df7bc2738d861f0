"""Groups of connected `continuous` members (Model Exchange), whose equations are integrated together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.errors import CouplingError
from twin.graph import ordered_groups

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection


def between(members: Mapping[str, Member], links: list[ResolvedConnection]) -> list[ResolvedConnection]:
    """Return the connections of numbers between continuous members."""
    numbers = [link for link in links if link.source.variable.connectable]
    return [link for link in numbers if all(members[end.member].continuous for end in (link.source, link.target))]


def together(members: Mapping[str, Member], links: list[ResolvedConnection]) -> dict[str, str]:
    """Return the first member of the group for each member that is integrated with others."""
    graph: dict[str, list[str]] = {}
    for link in between(members, links):
        graph.setdefault(link.source.member, []).append(link.target.member)
        graph.setdefault(link.target.member, []).append(link.source.member)
    groups = ordered_groups([name for name in members if name in graph], graph)
    return {name: min(group, key=list(members).index) for group in groups for name in group if len(group) > 1}


def integrated_with(name: str, members: Mapping[str, Member], links: list[ResolvedConnection]) -> list[str]:
    """Return the members of the group of a member, with itself; itself alone if it is in none."""
    leaders = together(members, links)
    return [other for other in members if other == name or leaders.get(other, other) == leaders.get(name)]


def join(members: Mapping[str, Member], links: list[ResolvedConnection], periods: Mapping[str, clock.Time]) -> None:
    """Join the members of each group; CouplingError if their periods differ."""
    inside = between(members, links)
    first = together(members, links)
    for leader in dict.fromkeys(first.values()):
        names = [name for name in members if first.get(name) == leader]
        if len({periods[name] for name in names}) > 1:
            steps = ", ".join(f"{name} {clock.text(periods[name])}" for name in names)
            raise CouplingError(
                f"{', '.join(names)}: are connected and integrated together, but step differently ({steps}). "
                "Give them one communication step."
            )
        own = [link for link in inside if link.source.member in names]
        members[leader].join([members[name] for name in names], own)
