"""Comparison of the summaries of two runs: cases, metrics, status, verdicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from twin.component import unit as units
from twin.errors import CouplingError
from twin.results.evaluation.metric_format import display_units
from twin.results.recording.signals import format_value, si_conversion

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

SMALLEST_SPREAD = 1e-3  # of the largest value in the same unit: what a metric around zero may change without meaning


@dataclass(frozen=True)
class Missing:
    """Entries of a kind, such as `signal`, that only the `first` or the `second` run has; `of`: the case, if not of all."""

    kind: str
    run: str
    names: tuple[str, ...]
    of: str = ""

    def text(self, limit: int) -> str:
        """`14 signals only in the first run: a, b, c and 11 more`; with at most `limit` names; those of cases contain commas."""
        more = f" and {len(self.names) - limit} more" if len(self.names) > limit else ""
        where = f" of {self.of}" if self.of else ""
        separator = "; " if any("," in name for name in self.names) else ", "
        return f"{self.count}{where} only in the {self.run} run: {separator.join(self.names[:limit])}{more}"

    @property
    def count(self) -> str:
        """`14 signals`."""
        return f"{len(self.names)} {self.kind}{'s' * (len(self.names) > 1)}"


@dataclass(frozen=True)
class MetricChange:
    """Values of a metric of a variant in both runs, in `unit`: means over the seeds of both; None without a value.

    `spread`: standard deviation over the seeds, the larger of both runs, and at least a thousandth of the largest value in this unit.
    """

    metric: str
    variant: str
    unit: str
    first: float | None
    second: float | None
    spread: float = 0.0

    @property
    def change(self) -> float | None:
        """Value of the second run less that of the first, in `unit`."""
        return None if self.first is None or self.second is None else self.second - self.first

    @property
    def relative(self) -> float | None:
        """Change over the magnitude of the first run's value."""
        if self.change is None or self.first is None:
            return None
        return self.change / abs(self.first) if self.first else self.change and float(np.copysign(inf, self.change))

    @property
    def significance(self) -> float:
        """Magnitude of the change over the spread of the seeds; infinite with a value in one run only."""
        if self.change is None:
            return 0.0 if self.first is self.second else inf
        return abs(self.change) / self.spread if self.spread else inf if self.change else 0.0


class VerdictChange(NamedTuple):
    """Verdict of a requirement in both runs, or of a metric that has a reference value: `force of PI`."""

    name: str
    first: str
    second: str


def select_variants(summary: Mapping[str, Any], pairs: Mapping[str, tuple[str, str]], at: int) -> dict[str, Any]:
    """Return a summary with the variants `pairs[name][at]` alone, under the names of the pairs."""
    own = {name: pair[at] for name, pair in pairs.items()}
    cases = [
        {**case, "variant": name} for name, old in own.items() for case in summary["cases"] if case["variant"] == old
    ]
    metrics = {}
    for metric, entry in summary["metrics"].items():
        values = {name: entry["variants"][old] for name, old in own.items() if old in entry["variants"]}
        metrics[metric] = {**entry, "variants": values}
    return {**summary, "cases": cases, "metrics": metrics}


def metric_changes(first: Mapping[str, Any], second: Mapping[str, Any]) -> tuple[MetricChange, ...]:
    """Return the metrics that both summaries have, in the units of the tables, the largest change over the seeds' spread first."""
    changes = []
    shown = display_units({name: metric["unit"] for name, metric in first["metrics"].items()})
    for name, metric in first["metrics"].items():
        if (other := second["metrics"].get(name)) is None:
            continue
        unit = shown[name]
        (factor, offset), (other_factor, other_offset) = map(si_conversion, (metric["unit"], other["unit"]))
        is_scale = is_convertible(metric["unit"], other["unit"]) and offset == other_offset
        scales = [own / si_conversion(unit)[0] for own in (factor, other_factor)]
        for variant in metric["variants"]:
            if variant not in other["variants"]:
                continue
            values, other_values = (entry["variants"][variant]["values"] for entry in (metric, other))
            seeds = common_seeds(values, other_values)
            mean = mean_value([values[seed] for seed in seeds], scales[0])
            other_mean = mean_value([other_values[seed] for seed in seeds], scales[1]) if is_scale else None
            spread = 0.0
            if mean is not None and other_mean is not None:
                own, its = ([entry[seed] for seed in seeds] for entry in (values, other_values))
                spread = max(float(np.std(own)) * scales[0], float(np.std(its)) * scales[1])
            changes.append(MetricChange(name, variant, unit, mean, other_mean, spread))
    sizes: dict[str, float] = {}
    for change in changes:
        sizes[change.unit] = max(
            sizes.get(change.unit, 0.0), *(abs(v) for v in (change.first, change.second, 0.0) if v is not None)
        )
    changes = [replace(change, spread=max(change.spread, SMALLEST_SPREAD * sizes[change.unit])) for change in changes]
    return tuple(sorted(changes, key=lambda change: -change.significance))


def common_seeds(first: Mapping[Any, Any], *others: Mapping[Any, Any]) -> list[Any]:
    """Return the seeds that all values of a metric have: only over these are runs compared."""
    return [seed for seed in first if all(seed in other for other in others)]


def verdict_changes(first: Mapping[str, Any], second: Mapping[str, Any]) -> tuple[VerdictChange, ...]:
    """Return the verdicts that differ, of requirements and of metrics with a reference value, new failures first."""
    outcomes: list[dict[str, str]] = [
        {entry["name"]: entry["verdict"] for entry in summary["expectations"]}
        | {
            f"{name} of {variant}": result["verdict"]
            for name, metric in summary["metrics"].items()
            for variant, result in metric["variants"].items()
            if result.get("verdict")
        }
        for summary in (first, second)
    ]
    changes = [
        VerdictChange(name, verdict, outcomes[1][name])
        for name, verdict in outcomes[0].items()
        if outcomes[1].get(name, verdict) != verdict
    ]
    return tuple(sorted(changes, key=lambda change: (change.second != "fail", change.first != "fail")))


def mean_value(values: Sequence[float | None], scale: float) -> float | None:
    """Return the mean of values times `scale`; None if one is missing or there are none."""
    numbers = [value for value in values if value is not None]
    if not numbers or len(numbers) < len(values):
        return None
    mean = float(np.mean(numbers))
    return mean if scale == 1.0 else units.round_trip(mean * scale)


def list_missing(kind: str, first: Iterable[str], second: Iterable[str]) -> list[Missing]:
    """Return the entries of only one run, for each run that has any."""
    names_first, names_second = list(first), list(second)
    return [
        Missing(kind, run, names)
        for own, other, run in ((names_first, names_second, "first"), (names_second, names_first, "second"))
        if (names := tuple(name for name in own if name not in other))
    ]


def is_convertible(first: str, second: str) -> bool:
    """Whether two units measure the same quantity."""
    try:
        return first == second or units.same_kind(units.describe(first), units.describe(second))
    except CouplingError:
        return False


def compare_summaries(
    first: Mapping[str, Any],
    second: Mapping[str, Any],
    tolerance: float,
    *,
    metrics: bool,
    with_verdicts: bool,
) -> tuple[list[str], list[Missing]]:
    """List the differences in cases and, with `metrics`, in metrics; `with_verdicts` also in status and requirements."""
    cases = [[(entry["variant"], str(entry["seed"])) for entry in summary["cases"]] for summary in (first, second)]
    missing = list_missing("case", *([f"{variant}, seed {seed}" for variant, seed in own] for own in cases))
    if not metrics:
        return [], missing
    missing += list_missing("metric", first["metrics"], second["metrics"])
    units = display_units({name: metric["unit"] for name, metric in first["metrics"].items()})
    common = [case for case in cases[0] if case in cases[1]]
    metric_problems = [
        entry
        for name, metric in first["metrics"].items()
        if name in second["metrics"]
        and (entry := metric_problem(name, metric, second["metrics"][name], common, tolerance, units[name]))
    ]
    problems = [line for _, line in sorted(metric_problems, key=lambda entry: -entry[0])]
    if not with_verdicts:
        return problems, missing
    if first["status"] != second["status"]:
        problems.insert(0, f"status: {first['status']} and {second['status']}.")
    outcomes = [{entry["name"]: entry["verdict"] for entry in summary["expectations"]} for summary in (first, second)]
    missing += list_missing("requirement", *outcomes)
    problems += [
        f"requirement {name}: {verdict} and {outcomes[1][name]}."
        for name, verdict in outcomes[0].items()
        if outcomes[1].get(name, verdict) != verdict
    ]
    return problems, missing


def metric_problem(
    name: str,
    first: Mapping[str, Any],
    second: Mapping[str, Any],
    cases: Sequence[tuple[str, str]],
    tolerance: float,
    unit: str,
) -> tuple[float, str] | None:
    """Return the largest relative difference of a metric that differs, and a line: its case, and the number of others."""
    different = []
    for variant, seed in cases:
        a, b = (entry["variants"].get(variant, {}).get("values", {}).get(seed) for entry in (first, second))
        if first["unit"] != second["unit"] or not is_close(a, b, tolerance):
            part = abs(a - b) / (max(abs(a), abs(b)) or 1.0) if a is not None and b is not None else np.inf
            different.append((part, f"{variant}, seed {seed}", a, b))
    if not different:
        return None
    largest, where, a, b = max(different, key=lambda entry: entry[0])
    texts = metric_texts(((a, first["unit"]), (b, second["unit"])), unit)
    count = len(different) - 1
    more = f"; also in {count} other case{'s' * (count > 1)}" if count else ""
    return largest, f"metric {name} of {where}: {' and '.join(texts)}{more}."


def metric_texts(values: Sequence[tuple[float | None, str]], unit: str) -> list[str]:
    """Format values, each in a unit, in one unit if they convert, with as many digits as it takes to tell them apart."""
    for digits in (4, 6, 17):
        texts = []
        for value, own in values:
            shown = unit if is_convertible(own, unit) else own
            factor, offset = si_conversion(own)
            texts.append("no value" if value is None else format_value(value * factor + offset, shown, digits=digits))
        if len(set(texts)) > 1:
            break
    return texts


def is_close(first: float | None, second: float | None, tolerance: float) -> bool:
    """Whether two numbers differ by no more than a fraction of the larger; None equals None only."""
    if first is None or second is None:
        return first is second
    return abs(first - second) <= tolerance * max(abs(first), abs(second))
