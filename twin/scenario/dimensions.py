"""Units of what a scenario computes: whether they fit, and in which unit that is shown which states none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.results import dimension
from twin.scenario.quantities import short

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.coupling import Catalog, MemberVariable
    from twin.results import Expression, Plot
    from twin.scenario.spec import Scenario

Variables = dict[str, "tuple[MemberVariable, bool]"]  # member.variable -> variable, whether it is a foreign FMU's


@dataclass(frozen=True)
class Stated:
    """An expression of a scenario and the unit that is stated for it, which may be none.

    `key` is what to correct, `name` what the expression is called instead of by its text.
    """

    where: str
    what: str
    expression: Expression
    unit: str = ""
    variants: tuple[str, ...] = ()
    key: str = "unit"
    name: str = ""


def stated(scenario: Scenario) -> Iterable[Stated]:
    """Every expression of a scenario with its unit."""
    for analysis in scenario.analyses:
        for name, one in analysis.inputs.items():
            yield Stated(analysis.where, f"analyses.{analysis.name}.{name}", one, variants=analysis.variants)
    for name, metric in scenario.metrics.items():
        where = str(scenario.tree.find(("metrics", name, "unit")).place)
        yield Stated(where, f"metrics.{name}", metric.signal, metric.unit, metric.variants)
    for expectation in scenario.expectations:
        what = f"expect {expectation.name}".rstrip()
        judged = scenario.metrics.get(expectation.metric or "")
        if judged is not None and expectation.unit != judged.unit:  # one problem is told once
            name = f"metric `{judged.name}`"
            yield Stated(expectation.where, what, judged.signal, expectation.unit, judged.variants, "limits", name)
        elif expectation.signal is not None:
            yield Stated(expectation.where, what, expectation.signal, expectation.unit, expectation.variants, "limits")
    for plot in scenario.plots:
        what = f"plot `{plot.title}`"
        for curve in plot.curves:
            yield Stated(place(scenario, plot, "unit"), what, curve.signal, plot.unit, plot.variants)
            if curve.x is not None:
                yield Stated(place(scenario, plot, "x_unit"), what, curve.x, plot.x_unit, plot.variants, "x_unit")
    for scene in scenario.scenes:
        what = f"scene `{scene.title}`"
        yield from (Stated(scene.where, what, one, "m", scene.variants, "length") for one in scene.lengths)
        yield from (Stated(scene.where, what, one.signal, scene.unit, scene.variants) for one in scene.curves)


def place(scenario: Scenario, plot: Plot, key: str) -> str:
    """file:line of a plot's key."""
    items = scenario.tree.find(("plots",)).items
    return next((str(one.find((key,)).place) for one in items if str(one.place) == plot.where), plot.where)


def check_units(scenario: Scenario, catalogs: Mapping[str, Catalog]) -> list[str]:
    """Sums and comparisons of different kinds, and stated units that do not fit; what has no known unit is not judged."""
    problems = []
    for one in stated(scenario):
        named = {
            name: variables
            for name in one.variants or catalogs
            if (variables := variables_of(one.expression, scenario, catalogs, name)) is not None
        }
        told: dict[tuple[tuple[str, bool], ...], str] = {}  # by units: nearly all variants have the same
        found = {}
        for name, variables in named.items():
            units = tuple((variable.unit, is_foreign) for variable, is_foreign in variables.values())
            if units not in told:
                told[units] = problem(one, variables)
            if told[units]:
                found[name] = told[units]
        for name, reason in list(found.items())[:1]:
            variant = "" if len(found) == len(named) else f"in variant `{name}`: "
            problems.append(f"{one.where}: {one.what}: {variant}{reason}")
    for plot in scenario.plots:
        over_time = plot.x_unit and all(curve.x is None for curve in plot.curves)
        if over_time and not dimension.of_unit(plot.x_unit).fits(dimension.of_unit("s")):
            reason = f"time is in s, which does not convert to {plot.x_unit}. Use s, ms or min for x_unit."
            problems.append(f"{place(scenario, plot, 'x_unit')}: plot `{plot.title}`: {reason}")
    return problems


def variables_of(
    expression: Expression, scenario: Scenario, catalogs: Mapping[str, Catalog], variant: str
) -> Variables | None:
    """The variables that an expression reads in a variant; None if it has not all of them."""
    case = next(case for case in scenario.variants if case.variant == variant)
    found = {}
    for signal in expression.signals:
        owner, _, name = signal.name.partition(".")
        variable = catalogs[variant].get(owner, {}).get(name)
        if variable is None:
            return None
        member = case.members.get(owner)
        found[signal.name] = variable, member is not None and member.component.endswith(".fmu")
    return found


def measure(expression: Expression, variables: Variables) -> dimension.Measure:
    """What an expression measures. A number without a unit in a foreign FMU may be anything."""
    return dimension.of(
        expression,
        {
            name: None if is_foreign and not variable.unit and variable.type != "Boolean" else variable.unit
            for name, (variable, is_foreign) in variables.items()
        },
    )


def problem(one: Stated, variables: Variables) -> str:
    """What is wrong with the units of an expression and the one stated for it, or nothing."""
    try:
        found = measure(one.expression, variables)
    except ScenarioError as error:
        return str(error)
    if not one.unit or found.fits(dimension.of_unit(one.unit)):
        return ""
    own = preferred(found, variables)
    if one.key == "length":
        advice = "Name a length"
    elif one.key == "limits":
        advice = f"Give limits in {own}" if own else "Give limits without a unit"
    else:
        advice = f"Use {one.key}: {own}" if own else f"Leave {one.key} out"
    return (
        f"{one.name or f'`{short(one.expression.text)}`'} {found.text}, which does not convert to {one.unit}. {advice}."
    )


def preferred(found: dimension.Measure, variables: Variables) -> str:
    """The unit to show a value in."""
    units = {name: variable.unit for name, (variable, _) in variables.items()}
    displays = {name: variable.display_unit for name, (variable, _) in variables.items()}
    return dimension.preferred(found, units, displays)


def displayed(scenario: Scenario, catalogs: Mapping[str, Catalog]) -> Scenario:
    """The scenario with a unit for everything that states none and has one."""
    every = {variant: {**catalog, **scenario.derived(variant)} for variant, catalog in catalogs.items()}

    def shown(expressions: Sequence[Expression], variants: tuple[str, ...]) -> str:
        """The first one's unit if all are of one kind."""
        found = []
        for one in expressions:
            named = (variables_of(one, scenario, every, name) for name in variants or every)
            if (variables := next((found for found in named if found is not None), None)) is not None:
                found.append((measure(one, variables), variables))
        same = len({(one.exponents, one.factors == ()) for one, _ in found}) == 1
        return preferred(*found[0]) if same else ""

    def plotted(plot: Plot) -> Plot:
        across = [curve.x for curve in plot.curves if curve.x is not None]
        return replace(
            plot,
            unit=plot.unit or shown([curve.signal for curve in plot.curves], plot.variants),
            x_unit=plot.x_unit or shown(across, plot.variants),
        )

    metrics = {
        name: replace(one, unit=one.unit or shown([one.signal], one.variants)) for name, one in scenario.metrics.items()
    }
    expectations = tuple(
        replace(
            one,
            unit=one.unit
            or (metrics[one.metric].unit if one.metric else shown([one.signal], one.variants) if one.signal else ""),
        )
        for one in scenario.expectations
    )
    plots = tuple(plotted(plot) for plot in scenario.plots)
    return replace(scenario, metrics=metrics, expectations=expectations, plots=plots)
