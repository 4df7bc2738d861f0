"""The part of a scenario that can be checked although some of its members are not known.

A member may be missing, broken, or left alone because its Python must not run: what names it waits, all else is checked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from collections.abc import Set as AbstractSet

    from twin.coupling import Catalog
    from twin.results import Expression
    from twin.scenario.spec import Case, Scenario


def owner(reference: str) -> str:
    """The member of `member.variable`."""
    return reference.partition(".")[0]


def checkable(scenario: Scenario, catalogs: Mapping[str, Catalog], analyses: AbstractSet[str]) -> Scenario:
    """The scenario without all that names a member outside of its variant's catalog, or another analysis."""
    lost = {one.name for one in scenario.analyses} - analyses
    unknown = {case.variant: (case.members.keys() - catalogs[case.variant].keys()) | lost for case in scenario.variants}
    names = {name for case in scenario.variants for name in case.members} | analyses

    def known(references: Iterable[str], variants: Iterable[str] = ()) -> bool:
        owners = {owner(one) for one in references}
        blind = {name for variant in variants or unknown for name in unknown.get(variant, ())}
        if any("*" in one for one in owners):
            return not blind
        return owners <= names and not owners & blind

    def readable(expressions: Iterable[Expression], variants: Iterable[str]) -> bool:
        return known((one.name for expression in expressions for one in expression.signals), variants)

    record = replace(scenario.record, patterns=tuple(one for one in scenario.record.patterns if known([one])))
    return replace(
        scenario,
        variants=tuple(reduced(case, catalogs[case.variant]) for case in scenario.variants),
        record=record,
        analyses=tuple(
            one for one in scenario.analyses if one.name in analyses and readable(one.inputs.values(), one.variants)
        ),
        metrics={name: one for name, one in scenario.metrics.items() if readable([one.signal], one.variants)},
        expectations=tuple(
            one for one in scenario.expectations if one.signal is None or readable([one.signal], one.variants)
        ),
        plots=tuple(
            one
            if readable([part for curve in one.curves for part in (curve.x, curve.signal) if part], one.variants)
            else replace(one, curves=(), x_unit="")  # it stays in its place, by which the file is looked up
            for one in scenario.plots
        ),
        scenes=tuple(one for one in scenario.scenes if known(one.names)),
    )


def reduced(case: Case, catalog: Catalog) -> Case:
    """A variant with the members of a catalog, and what happens between them."""
    return replace(
        case,
        members={name: one for name, one in case.members.items() if name in catalog},
        connections=tuple(
            one for one in case.connections if owner(one.source) in catalog and owner(one.target) in catalog
        ),
        events=tuple(one for one in case.events if owner(one.variable) in catalog),
    )
