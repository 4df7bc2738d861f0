"""Checks of conditions of events, first without and then with the variables of the members."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.errors import CouplingError
from twin.scenario.resolution.variable_names import find

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.coupling import Catalog
    from twin.scenario.keys.conditions import Comparison
    from twin.scenario.spec import Case

READABLE = ("output", "local")


def check_times(case: Case) -> list[str]:
    """Report conditions that are not evaluated before the end of the run."""
    return [
        f"{condition.tree.find(('after',)).location}: after {clock.text(condition.after_ns)} is not before the end of the run, "
        f"{clock.text(case.stop_ns)}. Change it or stop_time."
        for condition in case.conditions
        if condition.after_ns is not None and condition.after_ns >= case.stop_ns
    ]


def check_conditions(case: Case, catalog: Catalog) -> list[str]:
    """Report signals of conditions that are no outputs, and values without a comparison that are no Booleans."""
    return [
        f"{condition.where}: {problem}"
        for condition in case.conditions
        for comparison in condition.condition.comparisons
        for problem in comparison_problems(comparison, catalog)
    ]


def comparison_problems(comparison: Comparison, catalog: Catalog) -> Iterable[str]:
    """Yield the problems of a comparison; unknown names are reported with those of all expressions."""
    for signal in comparison.expression.signals:
        try:
            variable, _ = find(str(signal), catalog)
        except CouplingError:
            continue
        kind = "an input" if variable.causality == "input" else f"a {variable.causality}"
        if variable.causality not in READABLE:
            advice = "Name the output that it is connected to" if variable.causality == "input" else "Name an output"
            yield f"{signal} is {kind}: conditions read outputs. {advice}."
        elif comparison.is_boolean and variable.type != "Boolean":
            yield f"{signal} is {variable.type}, neither true nor false. Compare it, as in {signal} > 0."
