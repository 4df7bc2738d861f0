"""What the members of a scenario turn out to be: the second half of its checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import TwinError
from twin.scenario.check import check_against

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.member import MemberVariable
    from twin.scenario.scenario import Catalog, Scenario


def look_up(scenario: Scenario) -> tuple[dict[str, Catalog], list[str]]:
    """(variant -> member -> variables, every problem that can be found without running)."""
    from twin import members
    from twin.system import Connection, System

    known: dict[str, Mapping[str, MemberVariable]] = {}
    problems: dict[str, None] = {}
    catalogs: dict[str, Catalog] = {}
    for case in scenario.variants:
        for name, member in case.members.items():
            if member.component in known:
                continue
            try:
                known[member.component] = members.variables(member.component)
            except TwinError as error:
                problems[f"{member.where}: member `{name}`: {error}"] = None
        if all(member.component in known for member in case.members.values()):
            catalogs[case.variant] = {name: known[member.component] for name, member in case.members.items()}
    if len(catalogs) < len(scenario.variants):
        return catalogs, list(problems)
    for case in scenario.variants:
        connections = [Connection(one.source, one.target, one.where) for one in case.connections]
        problems |= dict.fromkeys(System(catalogs[case.variant], connections).check())
    problems |= dict.fromkeys(check_against(scenario, catalogs))
    return catalogs, list(problems)
