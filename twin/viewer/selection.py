"""Which signals and cases of runs are meant by patterns, a variant and a seed; and which ones are worth showing if nothing is."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from twin.errors import ScenarioError, TwinError, UnknownNameError, nearest
from twin.viewer.verdicts import Verdicts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.viewer.runs import Runs

MOST = 8  # signals that a page shows where nobody said which


def chosen_signals(runs: Runs, patterns: Sequence[str]) -> list[str]:
    """Columns that patterns name, and expressions; without patterns those of the scenario's plots and of what failed."""
    if not patterns:
        return worth(runs)
    known = {column: name for run in runs.runs for name, one in run.variables.items() for column in one.columns}
    found: dict[str, None] = {}
    for one in patterns:
        own = (
            [one] if one in known else [c for c, name in known.items() if fnmatchcase(c, one) or fnmatchcase(name, one)]
        )
        found.update(dict.fromkeys(own or [expressed(runs, one)]))
    return list(found)


def expressed(runs: Runs, text: str) -> str:
    """An expression that some run has the signals of."""
    for run in runs.runs:
        try:
            return run.parsed(text).text
        except (ScenarioError, UnknownNameError) as error:
            problem = error
    known = [name for run in runs.runs for name in run.variables]
    told = (
        str(problem) if any(sign in text for sign in "(+-/ ") else f"{text!r} was not recorded. {nearest(text, known)}"
    )
    raise TwinError(f"{runs.runs[0].folder}: {told}")


def worth(runs: Runs) -> list[str]:
    """What failed first, then the scenario's plots, else the first signals."""
    found: dict[str, None] = {}
    for run in runs.runs:
        verdicts = Verdicts(run)
        failed = [one.signal for one in verdicts.expectations() if one.verdict == "fail" and one.signal]
        drawn = [name for plot in verdicts.plots() for name in (*plot["signals"], plot["x"]) if name]
        found.update(dict.fromkeys([*failed, *drawn]))
    return list(found or runs.runs[0].recording.places.keys() - {"variant", "seed", "time"})[:MOST]


def chosen_cases(runs: Runs, variant: str, seed: int | None) -> list[int]:
    """Numbers of the cases of a variant and a seed; without them the first seed of every variant of every run."""
    cases = runs.cases
    first = {(one.run, one.variant): one.seed for one in reversed(cases)}
    found = [
        number
        for number, one in enumerate(cases)
        if variant in ("", one.variant) and one.seed == (first[one.run, one.variant] if seed is None else seed)
    ]
    if not found:
        names, seeds = dict.fromkeys(one.variant for one in cases), dict.fromkeys(one.seed for one in cases)
        raise TwinError(
            f"{runs.runs[0].folder}: has no such case. Variants: {', '.join(names)}; seeds: {', '.join(map(str, seeds))}."
        )
    return found
