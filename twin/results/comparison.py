"""Comparison of two runs: cases, signals sample by sample, metrics, verdicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError, nearest
from twin.installed import import_optional
from twin.results.evaluation.metric_format import display_units, larger_unit
from twin.results.recording.run_folder import RecordedVariable
from twin.results.recording.signal_reader import list_recorded_variables, read_variables
from twin.results.recording.signals import format_value, si_conversion
from twin.results.resampling import common_times, excursion, resample
from twin.results.summary_comparison import (
    MetricChange,
    Missing,
    VerdictChange,
    compare_summaries,
    is_convertible,
    list_missing,
    metric_changes,
    select_variants,
    verdict_changes,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.results.metric_table import MetricTable
    from twin.results.recording.signals import Signals

MAX_VALUES_IN_MEMORY = 20_000_000  # numbers of one file in memory
SIGNALS_IN_CARD = 8
DIFFERENT_TIMES = (
    "sample times differ; compared at those of the coarser recording. Between them counts what leaves the range of the "
    "two neighboring samples, of real numbers by more than the signal's largest step between samples."
)


@dataclass(frozen=True)
class Difference:
    """Largest difference of a signal in a case. `value` [SI]; `part`: relative to the signal's largest magnitude in both.

    `time`: first time at which it exceeds the tolerance [s]; `peak_time`: at which it is largest. `unit`: in which it is shown.
    """

    name: str
    variant: str
    seed: int
    value: float
    part: float
    time: float = 0.0
    unit: str = ""
    peak_time: float = 0.0

    @property
    def text(self) -> str:
        """Difference in the unit in which the signal is shown."""
        if not np.isfinite(self.value):
            return "no number in one"
        return format_value(self.value, larger_unit([self.value], self.unit), is_difference=True)


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison. `differences`: of the signals in both runs; `problems`: different otherwise; `missing`: in one run only.

    `changes`: of the metrics of both runs, also of those within the tolerance. `verdicts`: those that differ. `signals` and
    `metrics` are the tables of differences and changes.
    """

    differences: tuple[Difference, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    tolerance: float
    missing: tuple[Missing, ...] = ()
    changes: tuple[MetricChange, ...] = ()
    verdicts: tuple[VerdictChange, ...] = ()

    def __repr__(self) -> str:
        return f"<Comparison: {self.headline}>"

    def _repr_html_(self) -> str:
        """Return changed verdicts, the signals that differ most and the metrics, relative changes in percent, for notebooks."""
        import_optional("pandas", "python", "a DataFrame")
        from twin.results.metric_table import MetricTable

        verdicts = MetricTable(self.verdicts, columns=["verdict of", "first", "second"])
        tables = [verdicts, self.signals.head(min(len(self.differing), SIGNALS_IN_CARD)), self.metrics]
        for table in tables:
            for column in table.columns[table.columns.str.startswith("relative")]:
                table[column] = [f"{100.0 * part:.3g} %" if not np.isnan(part) else "-" for part in table[column]]
        return f"<p>{self.headline}</p>{''.join(table._repr_html_() for table in tables if len(table))}"

    @property
    def metrics(self) -> MetricTable:
        """A row for each metric and variant in the units of `Run.metrics`, changes that are large over the seeds' spread first; values are means over the seeds."""
        import_optional("pandas", "python", "a DataFrame")
        from twin.results.metric_table import MetricTable

        keys = ("metric", "variant", "unit", "first", "second", "change", "relative")
        rows = [[getattr(change, key) for key in keys] for change in self.changes]
        numbers = dict.fromkeys((*keys[3:6], "relative change"), float)
        table: MetricTable = MetricTable(rows, columns=[*keys[:6], "relative change"]).astype(numbers)
        return table

    @property
    def signals(self) -> MetricTable:
        """A row for each signal and case, those beyond the tolerance first, the largest relative difference on top.

        `difference`: the largest, in `unit`; `from`: first time at which it exceeds the tolerance [s].
        """
        import_optional("pandas", "python", "a DataFrame")
        from twin.results.metric_table import MetricTable

        beyond = self.differing
        rows = [
            [
                each.name,
                each.variant,
                each.seed,
                each.unit,
                each.value / si_conversion(each.unit)[0],
                each.part,
                each.time,
            ]
            for each in (*beyond, *(each for each in self.differences if each.part <= self.tolerance))
        ]
        columns = ["signal", "variant", "seed", "unit", "difference", "relative difference", "from"]
        table: MetricTable = MetricTable(rows, columns=columns).astype(dict.fromkeys(columns[4:], float))
        return table

    @property
    def differing(self) -> list[Difference]:
        """Signals beyond the tolerance, the largest relative difference first, then the earliest."""
        differing = [difference for difference in self.differences if not difference.part <= self.tolerance]
        return sorted(
            differing,
            key=lambda difference: (
                -difference.part if difference.part == difference.part else -np.inf,
                difference.time,
                difference.name,
                difference.variant,
                difference.seed,
            ),
        )

    @property
    def identical_count(self) -> int:
        """Number of bit-identical signals."""
        return sum(difference.part == 0 for difference in self.differences)

    @property
    def agrees(self) -> bool:
        """Whether there is anything to compare, and nothing differs by more than the tolerance."""
        is_compared = bool(self.differences or self.changes)
        return is_compared and not self.problems and not self.differing and not self.missing

    @property
    def headline(self) -> str:
        """Whether the runs agree, and in how much they differ."""
        count, differing, equal = len(self.differences), len(self.differing), self.identical_count
        within = f"{equal} equal to the bit, {count - equal - differing} within {self.tolerance:g}"
        if self.agrees:
            return f"The runs agree: {count} signals, {within}."
        parts = [f"{differing} of {count} signals ({within})" if count else "no signal in common"]
        kinds = [
            next(filter(line.startswith, ("metric ", "requirement ")), "other difference ") for line in self.problems
        ]
        parts += [f"{kinds.count(kind)} {kind.strip()}{'s' * (kinds.count(kind) > 1)}" for kind in dict.fromkeys(kinds)]
        parts += [f"{entry.count} only in the {entry.run}" for entry in self.missing]
        return f"{'The runs differ' if len(parts) > 1 or count else 'Nothing is compared'}: {', '.join(parts)}."

    @property
    def largest(self) -> Difference | None:
        """The difference that is largest relative to its signal; None if all are within the tolerance."""
        return next(iter(self.differing), None)


def compare_runs(
    folders: tuple[Path, Path],
    summaries: tuple[Mapping[str, Any], Mapping[str, Any]],
    tolerance: float,
    patterns: Sequence[str] = (),
    variants: Sequence[str] = (),
) -> Comparison:
    """Compare two runs. `patterns`: signals to compare, such as `heart.*`; all if there are none.

    `variants`: those to compare; `A=B` compares A of the first run with B of the second.

    Where times differ, both are compared at the times of the coarser recording (`common_times`). Status and expectations, which are of a
    whole run, are compared without `patterns` and `variants`. TwinError for a variant or a signal that neither run has.
    """
    pairs = variant_pairs(summaries, variants)
    if variants:
        summaries = select_variants(summaries[0], pairs, 0), select_variants(summaries[1], pairs, 1)
    paths = (folders[0] / "signals.parquet", folders[1] / "signals.parquet")
    all_variables = [list_recorded_variables(path) for path in paths]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for variables in all_variables for name in variables):
            raise TwinError(f"{pattern!r}: not recorded in either run. {nearest(pattern, all_variables[0])}")
    first, second = (
        {name: entry for name, entry in variables.items() if is_selected(name, patterns)} for variables in all_variables
    )
    problems, missing = compare_summaries(*summaries, tolerance, metrics=not patterns, with_verdicts=not variants)
    notes: dict[str, dict[str, None]] = {}  # text -> its cases
    spans: dict[str, dict[str, None]] = {}
    differences: list[Difference] = []
    recorded: tuple[dict[str, list[str]], ...] = ({}, {})  # signals by case, in cases of both runs
    samples = max((sum(entry["samples"] for entry in summary["cases"]) for summary in summaries), default=0)
    for names in batches([*first, *(name for name in second if name not in first)], first | second, samples):
        read = [
            read_variables(path, [own[name] for name in names if name in own])
            for path, own in zip(paths, (first, second), strict=True)
        ]
        if variants:
            read = [
                {
                    (name, seed): signals
                    for name, pair in pairs.items()
                    for (own, seed), signals in cases.items()
                    if own == pair[at]
                }
                for at, cases in enumerate(read)
            ]
        for case in read[0]:
            if case not in read[1]:
                continue
            a, b = read[0][case], read[1][case]
            where = f"{case[0]}, seed {case[1]}"
            if not np.array_equal(a.time, b.time):
                if span := describe_length_difference(a.time, b.time):
                    spans.setdefault(span, {})[where] = None
                if not span or not is_same_while_both(a.time, b.time):
                    notes.setdefault(DIFFERENT_TIMES, {})[where] = None
            for own, signals in zip(recorded, (a, b), strict=True):
                own.setdefault(where, []).extend(name for name in names if name in signals.values)
            differences += [
                largest_difference(name, case, a, b, tolerance)
                for name in names
                if name in a.values and name in b.values
            ]
    problems += by_case(spans, len(recorded[0]))
    missing += missing_signals(*recorded)
    changes = metric_changes(*summaries)
    verdicts = () if patterns or variants else verdict_changes(*summaries)
    metric_units = {f"metric {name}": metric["unit"] for name, metric in summaries[0]["metrics"].items()}
    units = display_units(metric_units | {name: entry.display_unit or entry.unit for name, entry in first.items()})
    shown = tuple(replace(entry, unit=units[entry.name]) for entry in differences)
    return Comparison(
        shown, tuple(problems), tuple(by_case(notes, len(recorded[0]))), tolerance, tuple(missing), changes, verdicts
    )


def variant_pairs(
    summaries: tuple[Mapping[str, Any], Mapping[str, Any]], variants: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """Return the variants of the first and the second run that `A` and `A=B` name; TwinError for one that is not there."""
    own = [list(dict.fromkeys(entry["variant"] for entry in summary["cases"])) for summary in summaries]
    pairs: dict[str, tuple[str, str]] = {}
    for text in variants:
        first, equals, second = text.partition("=")
        if text in own[0] or text in own[1]:
            pairs[text] = (text, text)
        elif not equals:
            raise TwinError(f"{text!r}: neither run has this variant. {nearest(text, own[0] + own[1])}")
        else:
            pairs[text] = (first.strip(), second.strip())
            for name, names, run in zip(pairs[text], own, ("first", "second"), strict=True):
                if name not in names:
                    raise TwinError(f"{text!r}: the {run} run has no variant {name!r}. {nearest(name, names)}")
    return pairs


def missing_signals(first: Mapping[str, Sequence[str]], second: Mapping[str, Sequence[str]]) -> list[Missing]:
    """Return the signals that only one run recorded, from those of each case: once for cases in which they are the same."""
    cases: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for case in first:
        for entry in list_missing("signal", first[case], second[case]):
            cases.setdefault((entry.run, entry.names), []).append(case)
    return [
        Missing("signal", run, names, "" if len(own) == len(first) else " and ".join(own))
        for (run, names), own in cases.items()
    ]


def by_case(texts: Mapping[str, Mapping[str, None]], count: int) -> list[str]:
    """Return each text once, with its cases, of `count` that are compared."""
    return [
        f"{f'all {count} cases' if 1 < len(cases) == count else '; '.join(cases)}: {text}"
        for text, cases in texts.items()
    ]


def is_same_while_both(first: Any, second: Any) -> bool:
    """Whether two recordings have the same sample times while both are recorded."""
    if not (len(first) and len(second)):
        return True
    begin, end = max(first[0], second[0]), min(first[-1], second[-1])
    return np.array_equal(*(times[(times >= begin) & (times <= end)] for times in map(np.asarray, (first, second))))


def is_selected(name: str, patterns: Sequence[str]) -> bool:
    """Whether a signal is to be compared."""
    return not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def batches(names: Sequence[str], variables: Mapping[str, RecordedVariable], samples: int) -> Iterator[list[str]]:
    """Group the names so that the signals of a group fit into memory."""
    group: list[str] = []
    for name in names:
        group.append(name)
        if sum(len(variables[member_name].columns) for member_name in group) * max(samples, 1) >= MAX_VALUES_IN_MEMORY:
            yield group
            group = []
    if group:
        yield group


def describe_length_difference(first: Any, second: Any) -> str:
    """Describe that one recording began later, or ended earlier, by more than a sample interval; empty otherwise."""
    begins, ends = ([float(times[at]) if len(times) else 0.0 for times in (first, second)] for at in (0, -1))
    step = max((float(np.max(np.diff(times))) for times in (first, second) if len(times) > 1), default=0.0)
    longest = step * (1 + 1e-9)
    texts = [f"from {begins[0]:g} s and from {begins[1]:g} s"] * (abs(begins[0] - begins[1]) > longest)
    texts += [f"to {ends[0]:g} s and to {ends[1]:g} s"] * (abs(ends[0] - ends[1]) > longest)
    return f"recorded {', '.join(texts)}." if texts else ""


def largest_difference(name: str, case: tuple[str, int], a: Signals, b: Signals, tolerance: float) -> Difference:
    """Return the largest difference of a signal; infinite for incompatible units or shapes."""
    x, y = np.asarray(a.values[name]), np.asarray(b.values[name])
    unit, other = a.units.get(name, ""), b.units.get(name, "")
    where = (name, *case)
    if x.shape[1:] != y.shape[1:] or not is_convertible(unit, other):
        return Difference(*where, np.inf, np.inf)
    is_real = x.dtype.kind == "f" and y.dtype.kind == "f"
    x, y = (signals.to_si({name})[name] for signals in (a, b))
    own_times, other_times = np.asarray(a.time), np.asarray(b.time)
    time = common_times(own_times, other_times)
    if not len(time):
        return Difference(*where, np.inf, np.inf)
    recordings = ((own_times, x), (other_times, y))
    excursions = [
        excursion(time, *recordings[1 - i], *recordings[i], is_real)
        for i in (0, 1)
        if not np.array_equal(time, recordings[i][0])
    ]
    x, y = (
        values if np.array_equal(time, times) else resample(time, times, values, is_real)
        for times, values in recordings
    )
    same = (x == y) | (np.isnan(x) & np.isnan(y))
    with np.errstate(invalid="ignore"):
        distance = np.where(same, 0.0, np.abs(x - y))
    distance = np.where(np.isnan(distance), np.inf, distance)
    distance = distance.reshape(len(distance), -1).max(axis=1, initial=0.0)
    time = np.concatenate([time, *(times for times, _ in excursions)])
    distance = np.concatenate([distance, *(values for _, values in excursions)])
    order = np.argsort(time, kind="stable")
    time, distance = time[order], distance[order]
    value = float(distance.max())
    size = max((float(np.max(np.abs(array[np.isfinite(array)]), initial=0.0)) for array in (x, y)), default=0.0)
    part = 0.0 if value == 0 else value / size if size else np.inf
    begin, peak = (float(time[np.argmax(rows)]) for rows in (distance > tolerance * size, distance))
    return Difference(*where, value, part, begin, unit, peak)
