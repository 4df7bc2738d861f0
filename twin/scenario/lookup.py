"""What the members of a scenario turn out to be: the second half of its checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.errors import TwinError
from twin.scenario import value
from twin.scenario.check import check_against

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import Catalog, MemberVariable
    from twin.scenario.names import Variables
    from twin.scenario.spec import MemberSpec, Scenario


def look_up(scenario: Scenario) -> tuple[dict[str, Catalog], list[str]]:
    """(variant -> member -> variables, every problem that can be found without running)."""
    from twin.coupling import Connection, System
    from twin.scenario import members

    known: dict[str, Mapping[str, MemberVariable]] = {}  # by component, and by what changes its shapes
    problems: dict[str, None] = {}
    catalogs: dict[str, Catalog] = {}
    for case in scenario.variants:
        catalog: dict[str, Mapping[str, MemberVariable]] = {}
        for name, member in case.members.items():
            try:
                if member.component not in known:
                    known[member.component] = members.variables(member.made or member.component)
                if sizes := structural(name, member, known[member.component]):
                    key = f"{member.component} {sizes}"
                    known.setdefault(key, members.variables(member.component, sizes))
                    catalog[name] = known[key]
                else:
                    catalog[name] = known[member.component]
            except TwinError as error:
                problems[f"{member.where}: member `{name}`: {error}"] = None
        if len(catalog) == len(case.members):
            catalogs[case.variant] = catalog
    if len(catalogs) < len(scenario.variants):
        return catalogs, list(problems)
    for case in scenario.variants:
        connections = [Connection(one.source, one.target, one.where) for one in case.connections]
        problems |= dict.fromkeys(System(catalogs[case.variant], connections).check())
    problems |= dict.fromkeys(check_against(scenario, catalogs))
    return catalogs, list(problems)


def structural(member: str, spec: MemberSpec, variables: Variables) -> dict[str, Any]:
    """What a member sets of its structural parameters."""
    return {
        name: value.resolve(written, variables[name], f"{member}.{name}")
        for name, written in spec.parameters.items()
        if name in variables and variables[name].causality == "structuralParameter"
    }
