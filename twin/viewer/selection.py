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


def select_signals(runs: RunCollection, patterns: Sequence[str]) -> list[str]:
    """Return the columns of patterns, and expressions; without patterns failed signals and those of the plots."""
    if not patterns:
        return suggest_signals(runs)
    columns = {
        column: name for run in runs.runs for name, variable in run.variables.items() for column in variable.columns
    }
    selected: dict[str, None] = {}
    for pattern in patterns:
        own = (
            [pattern]
            if pattern in columns
            else [c for c, name in columns.items() if fnmatchcase(c, pattern) or fnmatchcase(name, pattern)]
        )
        selected.update(dict.fromkeys(own or [check_expression(runs, pattern)]))
    return list(selected)


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


def select_cases(runs: RunCollection, variant: str, seed: int | None) -> list[int]:
    """Return the numbers of the cases of a variant and a seed; by default the first seed of each variant of each run."""
    cases = runs.cases
    first = {(case.run, case.variant): case.seed for case in reversed(cases)}
    selected = [
        number
        for number, case in enumerate(cases)
        if variant in ("", case.variant) and case.seed == (first[case.run, case.variant] if seed is None else seed)
    ]
    if not selected:
        names, seeds = dict.fromkeys(case.variant for case in cases), dict.fromkeys(case.seed for case in cases)
        raise TwinError(
            f"{runs.runs[0].folder}: has no such case. Variants: {', '.join(names)}; seeds: {', '.join(map(str, seeds))}."
        )
    return selected
