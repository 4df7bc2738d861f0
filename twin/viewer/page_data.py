"""Description of the runs for a page: cases, signals by member, expectations, events, plots."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

from twin.component import unit as units
from twin.errors import TwinError
from twin.results import MetricFormat, MetricResult, common_seeds, expression, metric_formats
from twin.run import event_rows, reached_times
from twin.viewer import following

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from twin.results import EventLine
    from twin.scenario import ScenarioSpec
    from twin.viewer.runs import OpenRun, RunCollection
    from twin.viewer.verdicts import ExpectationView, Verdicts

MAX_SIGNALS = 20_000  # in the tree
ORDER = {"fail": 0, "skipped": 2}  # of expectations
REPEAT_INTERVAL = 0.2  # longest time between merged settings of one variable [s]
CUT = "cut"  # verdict of a metric whose run ended before its window


def about(runs: RunCollection) -> dict[str, Any]:
    """Return the description as JSON data; times in seconds."""
    verdicts = [run.verdicts for run in runs.runs]
    numbers = {(case.run, *case.key): number for number, case in enumerate(runs.cases)}
    return {
        "runs": [
            {
                "letter": ascii_uppercase[number],
                "name": run.summary["scenario"]["name"],
                "title": run.summary["scenario"]["title"] or run.summary["scenario"]["name"],
                "folder": run.folder.resolve().name,
                "started": run.summary["started"],
                "status": run.summary["status"],
                "overrides": list(run.summary["overrides"]),
                "problem": verdicts[number].problem,
            }
            for number, run in enumerate(runs.runs)
        ],
        "growing": bool(runs.growing),
        "cases": [vars(case) | {"label": runs.label(case)} for case in runs.cases],
        "signals": signals(runs),
        "expectations": [
            vars(expectation)
            | {
                "run": number,
                "spans": {str(numbers[number, *case]): spans for case, spans in (expectation.spans or {}).items()},
            }
            for number, expectation in sort_expectations(verdicts)
        ],
        "metrics": [
            metric | {"run": number}
            for number, compared in enumerate(compare_metrics(verdicts))
            for metric in verdicts[number].metrics(compared)
        ],
        "events": [event | {"run": number} for number, run in enumerate(runs.runs) for event in events(run)],
        "functions": list(expression.FUNCTIONS),
        # runs of one scenario share plots; the last run's are used if they differ
        "plots": list({plot["title"]: plot for verdict in verdicts for plot in verdict.plots()}.values()),
        "following": runs.following(),
    }


@dataclass(frozen=True)
class MetricOfRun:
    """A metric of a variant over the seeds that all runs have. `seeds`: their number if a run has others, too; else 0.

    `first`: the same metric of the first of two runs.
    """

    result: MetricResult
    style: MetricFormat
    first: MetricResult | None
    seeds: int

    def row(self) -> dict[str, Any]:
        """Return the values as texts."""
        result, style = self.result, self.style
        numbers = [number for number in result.values.values() if number is not None]
        low, high = (style.number(edge(numbers), result.scale) if numbers else "" for edge in (min, max))
        return {
            "variant": result.variant,
            "verdict": result.verdict,
            "value": style.number(result.mean, result.scale),
            "reference": None if result.paper is None else style.number(result.paper),
            "range": f"{low} to {high}" if low != high else "",
            "change": self.change(),
            "seeds": self.seeds,
        }

    def change(self) -> str:
        """Return by how much the mean is above that of the first run, with the digits of both.

        Empty where a run ended before the window of the metric: the values are of different windows.
        """
        first, mean = self.first.mean if self.first else None, self.result.mean
        if first is None or mean is None or CUT in (self.result.verdict, self.first and self.first.verdict):
            return ""
        text = replace(self.style, is_difference=True).number(mean - first, max(abs(mean), abs(first)))
        return text if text.strip("-0.") else text.removeprefix("-")


def compare_metrics(verdicts: Sequence[Verdicts]) -> list[dict[tuple[str, str], MetricOfRun]]:
    """Return the metrics of each run by name and variant: of several runs over their common seeds, with common digits."""
    runs = [{(result.metric.name, result.variant): result for result in own.results()} for own in verdicts]
    keys = list(dict.fromkeys(key for run in runs for key in run))
    pools: dict[tuple[str, str], list[Mapping[int, Any]]] = {
        key: [run[key].values if key in run else own.seeds(key[1]) for run, own in zip(runs, verdicts, strict=True)]
        for key in keys
    }
    seeds = {
        key: common_seeds(*(own for own in pool if own)) for key, pool in pools.items()
    }  # one rule where a run lacks a metric
    is_part = {key: any(key in run and len(run[key].values) > len(seeds[key]) for run in runs) for key in keys}
    common = [
        {key: replace(own, values={n: own.values[n] for n in seeds[key] or own.values}) for key, own in run.items()}
        for run in runs
    ]
    styles = metric_formats([run[key] for key in keys for run in common if key in run])
    first = common[0] if len(runs) == 2 else {}
    return [
        {
            key: MetricOfRun(
                own,
                styles[key[0]],
                first.get(key) if number and seeds[key] else None,
                len(seeds[key]) * is_part[key],
            )
            for key, own in run.items()
        }
        for number, run in enumerate(common)
    ]


def events(viewed: OpenRun) -> list[dict[str, Any]]:
    """Return the events and faults of a run's scenario, and the targets that an operator reached."""
    scenario = viewed.verdicts.scenario
    if following.is_followed(viewed) or scenario is None:
        return following.events(viewed)
    rows = event_rows(scenario.variants, viewed.summary.get("conditions", ()))
    marks = merge_repeated(name_controls([row.annotation for row in rows], viewed, scenario))
    times = reached_times(viewed.summary.get("operation", {}))
    reached = [{"time": at, "name": f"{name} reached", "variants": [], "first": True} for name, at in times.items()]
    return sorted([*marks, *reached], key=lambda mark: mark["time"])


def name_controls(marks: Iterable[EventLine], viewed: OpenRun, scenario: ScenarioSpec) -> Iterator[EventLine]:
    """Yield events of inputs under the labels of their controls, in the unit of their range; without what is set along with them."""
    own = {control.input: control for control in scenario.console if control.label}
    along = {name for control in own.values() for name in control.along} - own.keys()
    parts = [(mark, *mark.name.removeprefix("set ").partition(" = ")[::2]) for mark in marks]
    times = {mark.time for mark, name, _ in parts if name in own}
    for mark, name, value in parts:
        if name in along and mark.time in times:
            continue
        variable = viewed.variables.get(name.partition("[")[0])
        if name not in own or variable is None:
            yield mark
            continue
        label, shown = own[name].label, str(own[name].range or "").partition(" ")[2] or variable.unit
        with suppress(TwinError, ValueError):  # a value with a unit of its own stays as it is
            factor, offset = units.conversion(variable.unit, shown, name)
            yield replace(mark, name=f"{label} = {factor * float(value) + offset:.4g} {shown}".rstrip())
            continue
        yield replace(mark, name=f"{label} = {value}")


def merge_repeated(marks: Iterable[EventLine]) -> list[dict[str, Any]]:
    """Return events for a page; rapidly repeated settings, e.g. by a joystick, become one with a count."""
    merged: list[dict[str, Any]] = []
    last: dict[tuple[str, tuple[str, ...]], tuple[dict[str, Any], float, int]] = {}
    for mark in marks:
        name = mark.name.removeprefix("set ")
        key = (name.partition(" =")[0], mark.variants)
        if key in last and mark.time == last[key][1]:  # the later setting holds
            last[key][0]["name"] = name
            continue
        if key in last and mark.time - last[key][1] < REPEAT_INTERVAL:
            entry, _, count = last[key]
            entry["name"] = f"{key[0]}, {count + 1} times until {mark.time:g} s"
            last[key] = entry, mark.time, count + 1
            continue
        merged.append({"time": mark.time, "name": name, "variants": list(mark.variants)})
        last[key] = merged[-1], mark.time, 1
    return merged


def sort_expectations(verdicts: Iterable[Verdicts]) -> list[tuple[int, ExpectationView]]:
    """Return all expectations with the numbers of their runs: failed ones first, by the time at which they fail."""
    pairs = [(number, view) for number, verdict in enumerate(verdicts) for view in verdict.expectations()]
    return sorted(
        pairs, key=lambda pair: (ORDER.get(pair[1].verdict, 1), pair[1].failed_at is None, pair[1].failed_at or 0.0)
    )


def signals(runs: RunCollection) -> list[dict[str, Any]]:
    """Return every column with the cases that recorded it: `all`, or their numbers."""
    columns: dict[str, dict[str, Any]] = {}
    for number, case in enumerate(runs.cases):
        viewed = runs.run_of(case)
        for variable in viewed.variables.values():
            for name in variable.columns:
                if name not in columns and len(columns) < MAX_SIGNALS:
                    unit = units.shown(viewed.display_unit(name))
                    columns[name] = {"name": name, "unit": unit, "about": variable.description, "cases": []}
                if name in columns and viewed.recording.has(case.key, name):
                    columns[name]["cases"].append(number)
    all_cases = list(range(len(runs.cases)))
    return [
        column | {"cases": "all" if column["cases"] == all_cases else column["cases"]}
        for column in columns.values()
        if column["cases"]
    ]
