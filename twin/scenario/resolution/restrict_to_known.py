"""Restriction of a scenario to the members whose variables are known, so that the rest can still be checked.

A member may be missing, broken, or not imported; everything that refers to it is removed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from collections.abc import Set as AbstractSet

    from twin.coupling import Catalog
    from twin.results import Expression
    from twin.scenario.spec import Case, ScenarioSpec


def owner(reference: str) -> str:
    """Return the member of `member.variable`."""
    return reference.partition(".")[0]


def restrict(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog], analyses: AbstractSet[str]) -> ScenarioSpec:
    """Remove everything that refers to a member outside its variant's catalog, or to an analysis not in `analyses`."""
    unknown = {case.variant: case.members.keys() - catalogs[case.variant].keys() for case in scenario.variants}
    names = {name for case in scenario.variants for name in case.members} | analyses

    def can_resolve(references: Iterable[str], variants: Iterable[str] = ()) -> bool:
        owners = {owner(item) for item in references}
        unknown_members = {name for variant in variants or unknown for name in unknown.get(variant, ())}
        if any("*" in item for item in owners):
            return not unknown_members
        return owners <= names and not owners & unknown_members

    def can_read(expressions: Iterable[Expression], variants: Iterable[str]) -> bool:
        return can_resolve((item.name for expression in expressions for item in expression.signals), variants)

    readable = [
        item for item in scenario.analyses if item.name in analyses and can_read(item.inputs.values(), item.variants)
    ]
    dropped = {item.name for item in scenario.analyses} - {item.name for item in readable}
    unknown = {variant: members | dropped for variant, members in unknown.items()}
    record = replace(scenario.record, patterns=tuple(item for item in scenario.record.patterns if can_resolve([item])))
    return replace(
        scenario,
        variants=tuple(restrict_case(case, catalogs[case.variant]) for case in scenario.variants),
        record=record,
        analyses=tuple(readable),
        metrics={name: item for name, item in scenario.metrics.items() if can_read([item.signal], item.variants)},
        expectations=tuple(
            item for item in scenario.expectations if item.signal is None or can_read([item.signal], item.variants)
        ),
        plots=tuple(
            item
            if can_read(item.expressions, item.variants)
            else replace(item, curves=(), x_unit="")  # kept, because its index locates it in the file
            for item in scenario.plots
        ),
        scenes=tuple(item for item in scenario.scenes if can_resolve(item.names)),
    )


def restrict_case(case: Case, catalog: Catalog) -> Case:
    """Restrict a variant to the members of a catalog, with their connections and events."""
    return replace(
        case,
        members={name: item for name, item in case.members.items() if name in catalog},
        connections=tuple(
            item for item in case.connections if owner(item.source) in catalog and owner(item.target) in catalog
        ),
        events=tuple(item for item in case.events if owner(item.variable) in catalog),
        conditions=tuple(item for item in case.conditions if item.sources | item.targets <= catalog.keys()),
    )
