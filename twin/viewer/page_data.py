"""Description of the runs for a page: cases, signals by member, expectations, events, plots."""

from __future__ import annotations

from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

from twin.component import unit as units
from twin.viewer.verdicts import Verdicts

if TYPE_CHECKING:
    from twin.viewer.runs import Runs

MAX_SIGNALS = 20_000  # in the tree


def about(runs: Runs) -> dict[str, Any]:
    """Return the description as JSON data; times in seconds."""
    verdicts = [Verdicts(one) for one in runs.runs]
    numbers = {(case.run, *case.key): number for number, case in enumerate(runs.cases)}
    return {
        "runs": [
            {
                "letter": ascii_uppercase[number],
                "name": one.summary["scenario"]["name"],
                "title": one.summary["scenario"]["title"] or one.summary["scenario"]["name"],
                "folder": one.folder.resolve().name,
                "started": one.summary["started"],
                "status": one.summary["status"],
                "overrides": list(one.summary["overrides"]),
                "problem": verdicts[number].problem,
            }
            for number, one in enumerate(runs.runs)
        ],
        "growing": bool(runs.growing),
        "cases": [vars(case) | {"label": runs.label(case)} for case in runs.cases],
        "signals": signals(runs),
        "expectations": [
            vars(one)
            | {
                "run": number,
                "spans": {str(numbers[number, *case]): spans for case, spans in (one.spans or {}).items()},
            }
            for number, verdict in enumerate(verdicts)
            for one in verdict.expectations()
        ],
        "events": [one | {"run": number} for number, verdict in enumerate(verdicts) for one in verdict.events()],
        # runs of one scenario share plots; the last run's are used if they differ
        "plots": list({one["title"]: one for verdict in verdicts for one in verdict.plots()}.values()),
    }


def signals(runs: Runs) -> list[dict[str, Any]]:
    """Return every column with the cases that recorded it: `all`, or their numbers."""
    columns: dict[str, dict[str, Any]] = {}
    for number, case in enumerate(runs.cases):
        viewed = runs.run_of(case)
        for variable in viewed.variables.values():
            for name in variable.columns:
                if name not in columns and len(columns) < MAX_SIGNALS:
                    unit = units.shown(variable.display_unit or variable.unit)
                    columns[name] = {"name": name, "unit": unit, "about": variable.description, "cases": []}
                if name in columns and viewed.recording.has(case.key, name):
                    columns[name]["cases"].append(number)
    all_cases = list(range(len(runs.cases)))
    return [
        one | {"cases": "all" if one["cases"] == all_cases else one["cases"]}
        for one in columns.values()
        if one["cases"]
    ]
