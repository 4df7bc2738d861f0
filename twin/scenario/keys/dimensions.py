"""Dimensional analysis of a scenario's expressions, and default display units where none are declared."""

from __future__ import annotations

import ast
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.results import dimension
from twin.scenario.keys.quantities import short

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.coupling import Catalog, MemberVariable
    from twin.results import Expression, Plot
    from twin.scenario.spec import ScenarioSpec

# `member.variable` -> its variable, and whether it belongs to a third-party FMU.
Variables = dict[str, "tuple[MemberVariable, bool]"]


@dataclass(frozen=True)
class ExpressionUse:
    """An expression of a scenario and its declared unit, "" if none. No `variants`: all variants that have its signals.

    `needed`: variants that require its signals; None: their names are checked elsewhere. `key`: the YAML key to correct;
    `name`: replaces the expression's text in messages; `unit_where`: location of the unit, if it is not `where`.
    """

    where: str
    what: str
    expression: Expression
    unit: str = ""
    variants: tuple[str, ...] = ()
    needed: tuple[str, ...] | None = ()
    key: str = "unit"
    name: str = ""
    unit_where: str = ""


def expression_uses(scenario: ScenarioSpec) -> Iterable[ExpressionUse]:
    """Yield every expression of analyses, metrics, expectations, conditions, plots and scenes."""
    for analysis in scenario.analyses:
        what, variants = f"analyses.{analysis.name}", analysis.variants
        for name, expression in analysis.inputs.items():
            yield ExpressionUse(analysis.where, f"{what}.{name}", expression, "", variants, variants)
    for name, metric in scenario.metrics.items():
        expectations = [item for item in scenario.expectations if item.metric == name]
        lists = [(item.ordered if item.excluded else (*item.variants, *item.ordered)) for item in expectations]
        tested = tuple(dict.fromkeys(variant for variants in lists for variant in variants))
        where, variants = str(scenario.tree.find(("metrics", name, "unit")).location), metric.variants
        yield ExpressionUse(
            metric.where, f"metrics.{name}", metric.signal, metric.unit, variants, variants or tested, unit_where=where
        )
    for item in scenario.expectations:
        what = f"expect {item.name}".rstrip()
        judged = scenario.metrics.get(item.metric or "")
        if judged is not None and item.unit != judged.unit:  # otherwise the metric reports the problem
            name = f"metric `{judged.name}`"
            yield ExpressionUse(item.where, what, judged.signal, item.unit, judged.variants, None, "limits", name)
        elif item.signal is not None:
            needed = () if item.excluded else item.variants
            yield ExpressionUse(item.where, what, item.signal, item.unit, item.variants, needed, "limits")
    for case in scenario.variants:
        variants = (case.variant,)
        for condition in case.conditions:
            for each in condition.condition.comparisons:
                yield ExpressionUse(condition.where, "when", each.expression, each.unit, variants, variants, "limits")
    for plot in scenario.plots:
        for curve in plot.curves:
            for key, operand, unit in (("unit", curve.signal, plot.unit), ("x_unit", curve.x, plot.x_unit)):
                if operand is not None:
                    where = plot_location(scenario, plot, key)
                    what = f"plot `{plot.title}`"
                    yield ExpressionUse(plot.where, what, operand, unit, plot.variants, key=key, unit_where=where)
    for scene in scenario.scenes:
        what, variants = f"scene `{scene.title}`", scene.variants
        for expression in scene.lengths:
            yield ExpressionUse(scene.where, what, expression, "m", variants, key="length")
        for key, expression, unit, _ in scene.space.expressions if scene.space else ():
            yield ExpressionUse(scene.where, f"{what}: space", expression, unit, variants, None, key)
        for curve in scene.curves:
            yield ExpressionUse(scene.where, what, curve.signal, scene.unit, variants)


def plot_location(scenario: ScenarioSpec, plot: Plot, key: str) -> str:
    """Return file:line of a plot's key."""
    items = scenario.tree.find(("plots",)).items
    return next(
        (str(plot_node.find((key,)).location) for plot_node in items if str(plot_node.location) == plot.where),
        plot.where,
    )


def check_units(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> list[str]:
    """Report sums and comparisons of different dimensions, and declared units of another dimension; unknown units are skipped."""
    problems = []
    for declaration in expression_uses(scenario):
        variables_by_variant = {
            name: variables
            for name in declaration.variants or catalogs
            if (variables := variables_of(declaration.expression, scenario, catalogs, name)) is not None
        }
        # Cached, because nearly all variants have the same units.
        reason_by_units: dict[tuple[tuple[str, bool], ...], str] = {}
        reason_by_variant = {}
        for name, variables in variables_by_variant.items():
            units = tuple((variable.unit, is_foreign) for variable, is_foreign in variables.values())
            if units not in reason_by_units:
                reason_by_units[units] = problem(declaration, variables)
            if reason_by_units[units]:
                reason_by_variant[name] = reason_by_units[units]
        for name, reason in list(reason_by_variant.items())[:1]:
            variant = "" if len(reason_by_variant) == len(variables_by_variant) else f"in variant `{name}`: "
            where = declaration.unit_where or declaration.where
            problems.append(f"{where}: {declaration.what}: {variant}{reason}")
    for plot in scenario.plots:
        over_time = plot.x_unit and all(curve.x is None for curve in plot.curves)
        if over_time and not dimension.unit_measure(plot.x_unit).is_compatible(dimension.unit_measure("s")):
            reason = f"time is in s, which does not convert to {plot.x_unit}. Use s, ms or min for x_unit."
            problems.append(f"{plot_location(scenario, plot, 'x_unit')}: plot `{plot.title}`: {reason}")
    return problems


def variables_of(
    expression: Expression, scenario: ScenarioSpec, catalogs: Mapping[str, Catalog], variant: str
) -> Variables | None:
    """Return the variables that an expression reads in a variant; None if one is missing."""
    case = next(case for case in scenario.variants if case.variant == variant)
    variables = {}
    for signal in expression.signals:
        owner, _, name = signal.name.partition(".")
        variable = catalogs[variant].get(owner, {}).get(name)
        if variable is None:
            return None
        member = case.members.get(owner)
        variables[signal.name] = variable, member is not None and member.component.endswith(".fmu")
    return variables


def measure(expression: Expression, variables: Variables) -> dimension.Measure:
    """Compute the dimension of an expression. A unitless number of a third-party FMU has an unknown dimension."""
    return dimension.expression_measure(
        expression,
        {
            name: None if is_foreign and not variable.unit and variable.type != "Boolean" else variable.unit
            for name, (variable, is_foreign) in variables.items()
        },
    )


def problem(declaration: ExpressionUse, variables: Variables) -> str:
    """Return why the units of an expression or its declared unit are inconsistent, or ""."""
    try:
        measured = measure(declaration.expression, variables)
    except ScenarioError as error:
        return str(error)
    if not declaration.unit or measured.converts_to(declaration.unit, is_scaled(declaration.expression)):
        return ""
    suggested_unit = preferred(measured, variables)
    if not dimension.is_readable(suggested_unit):  # N^0.5 can be shown, but no limit can have it
        suggested_unit = ""
    if declaration.key == "length":
        advice = "Name a length"
    elif declaration.key == "limits":
        advice = f"Give limits in {suggested_unit}" if suggested_unit else "Give limits without a unit"
    else:
        advice = f"Use {declaration.key}: {suggested_unit}" if suggested_unit else f"Leave {declaration.key} out"
    return f"{declaration.name or f'`{short(declaration.expression.text)}`'} {measured.text}, which does not convert to {declaration.unit}. {advice}."


def is_scaled(expression: Expression) -> bool:
    """Whether an expression multiplies or divides: `6.2832 * heart.rate` is an angle per time."""
    return any(isinstance(node, ast.Mult | ast.Div) for node in ast.walk(expression.tree))


def preferred(measured: dimension.Measure, variables: Variables) -> str:
    """Choose the display unit of a value."""
    units = {name: variable.unit for name, (variable, _) in variables.items()}
    displays = {name: variable.display_unit for name, (variable, _) in variables.items()}
    return dimension.preferred_unit(measured, units, displays)


def displayed(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> ScenarioSpec:
    """Return the scenario with display units for metrics, expectations and plots that declare none."""
    all_catalogs = scenario.with_derived(catalogs)

    def common_unit(expressions: Sequence[Expression], variants: tuple[str, ...]) -> str:
        """Return the display unit of the first expression if all have the same dimension."""
        measured = []
        for item in expressions:
            candidates = (variables_of(item, scenario, all_catalogs, name) for name in variants or all_catalogs)
            if (variables := next((candidate for candidate in candidates if candidate is not None), None)) is not None:
                measured.append((measure(item, variables), variables))
        is_uniform = len({(item.exponents, item.factors == ()) for item, _ in measured}) == 1
        return preferred(*measured[0]) if is_uniform else ""

    def with_units(plot: Plot) -> Plot:
        x_expressions = [curve.x for curve in plot.curves if curve.x is not None]
        return replace(
            plot,
            unit=plot.unit or common_unit([curve.signal for curve in plot.curves], plot.variants),
            x_unit=plot.x_unit or common_unit(x_expressions, plot.variants),
        )

    metrics = {
        name: replace(item, unit=item.unit or common_unit([item.signal], item.variants))
        for name, item in scenario.metrics.items()
    }
    expectations = tuple(
        replace(
            item,
            unit=item.unit
            or (
                metrics[item.metric].unit
                if item.metric
                else common_unit([item.signal], item.variants)
                if item.signal
                else ""
            ),
        )
        for item in scenario.expectations
    )
    plots = tuple(with_units(plot) for plot in scenario.plots)
    return replace(scenario, metrics=metrics, expectations=expectations, plots=plots)
