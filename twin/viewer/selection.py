"""Selection of signals and cases by patterns, variant and seed, or by default."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from twin.errors import ScenarioError, TwinError, UnknownNameError, nearest
from twin.viewer import following

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.viewer.runs import RunCollection

MAX_SIGNALS = 8  # signals that a page shows by default
MAX_ELEMENTS = 8  # of an array that a pattern selects


def select_signals(runs: RunCollection, patterns: Sequence[str]) -> list[str]:
    """Return the columns of patterns, and expressions; without patterns failed signals and those of the plots.

    A pattern leaves out long arrays and states of random numbers, unless nothing else matches it.
    """
    if not patterns:
        return suggest_signals(runs)
    columns = {
        column: name for run in runs.runs for name, variable in run.variables.items() for column in variable.columns
    }
    internal = set(internal_variables(runs))
    selected: dict[str, None] = {}
    for pattern in patterns:
        own = (
            [pattern]
            if pattern in columns
            else [c for c, name in columns.items() if fnmatchcase(c, pattern) or fnmatchcase(name, pattern)]
        )
        own = [column for column in own if columns.get(column) not in internal or pattern == column] or own
        selected.update(dict.fromkeys(own or [check_expression(runs, pattern)]))
    return list(selected)


def internal_variables(runs: RunCollection) -> list[str]:
    """Return the names of the recorded variables that are long arrays or states of random numbers."""
    variables = {name: variable for run in runs.runs for name, variable in run.variables.items()}
    return [
        name for name, variable in variables.items() if len(variable.columns) > MAX_ELEMENTS or name.endswith(".stream")
    ]


def left_out(runs: RunCollection, patterns: Sequence[str], signals: Sequence[str]) -> list[str]:
    """Return the internal variables that match patterns and are not among the selected signals."""
    selected = {name.partition("[")[0] for name in signals}
    internal = [name for name in internal_variables(runs) if name not in selected]
    return [name for name in internal if any(fnmatchcase(name, pattern) for pattern in patterns)]


def check_expression(runs: RunCollection, text: str) -> str:
    """Return an expression if some run recorded all of its signals; raise TwinError otherwise."""
    problem = ""
    for run in runs.runs:
        try:
            return run.parse(text).text
        except (ScenarioError, UnknownNameError) as error:
            problem = str(error)
    if not any(sign in text for sign in "(+-/ "):
        columns = [name for run in runs.runs for name in run.variables]
        problem = f"{text!r} was not recorded. {nearest(text, columns)}"
    raise TwinError(f"{runs.runs[0].folder}: {problem}")


def failed_signals(runs: RunCollection) -> list[str]:
    """Return the signals of failed expectations, those that analyses read first."""
    return [
        name
        for run in runs.runs
        for expectation in run.verdicts.expectations()
        if expectation.verdict == "fail" and expectation.signal
        for name in (*run.verdicts.analyzed(expectation.signal), expectation.signal)
    ]


def suggest_signals(runs: RunCollection) -> list[str]:
    """Return signals of failed expectations, then of the scenario's plots, else the first signals; of followed rigs all plots."""
    followed = [name for run in runs.runs if following.is_followed(run) for name in following.first_signals(run)]
    if followed:
        return list(dict.fromkeys(followed))
    plotted = [
        name for run in runs.runs for plot in run.verdicts.plots() for name in (*plot["signals"], plot["x"]) if name
    ]
    selected = dict.fromkeys([*failed_signals(runs), *plotted])
    return list(selected or runs.runs[0].recording.column_indices.keys() - {"variant", "seed", "time"})[:MAX_SIGNALS]


def select_cases(runs: RunCollection, variant: str, seed: int | None, every: bool = False) -> list[int]:
    """Return the numbers of the cases of a variant and a seed; by default every or the first seed of each variant of each run."""
    cases = runs.cases
    first = {(case.run, case.variant): case.seed for case in reversed(cases)}
    selected = [
        number
        for number, case in enumerate(cases)
        if variant in ("", case.variant)
        and ((every and seed is None) or case.seed == (first[case.run, case.variant] if seed is None else seed))
    ]
    if not selected:
        names, seeds = dict.fromkeys(case.variant for case in cases), dict.fromkeys(case.seed for case in cases)
        raise TwinError(
            f"{runs.runs[0].folder}: has no such case. Variants: {', '.join(names)}; seeds: {', '.join(map(str, seeds))}."
        )
    return selected
