"""Comparison of two runs: cases, signals sample by sample, metrics, verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import CouplingError, TwinError, nearest
from twin.results.recording.run_folder import RecordedVariable
from twin.results.recording.signal_reader import list_recorded_variables, read_variables
from twin.results.recording.signals import format_value, si_conversion
from twin.results.resampling import common_times, excursion, resample

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.results.recording.signals import Signals

MAX_VALUES_IN_MEMORY = 20_000_000  # numbers of one file in memory
DIFFERENT_TIMES = (
    "sample times differ; compared at those of the coarser recording. Between them counts what leaves the range of the "
    "two neighboring samples, of real numbers by more than the signal's largest step between samples."
)


@dataclass(frozen=True)
class Difference:
    """Largest difference of a signal in a case. `value` [SI]; `part`: relative to the signal's largest magnitude in both.

    `time`: first time at which it exceeds the tolerance [s].
    """

    name: str
    variant: str
    seed: int
    value: float
    part: float
    time: float = 0.0
    unit: str = ""

    @property
    def text(self) -> str:
        """Difference in the signal's unit."""
        return (
            format_value(self.value, self.unit, is_difference=True) if np.isfinite(self.value) else "no number in one"
        )


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
class Comparison:
    """Result of a comparison. `signals`: in both runs; `problems`: different otherwise; `missing`: in one run only."""

    signals: tuple[Difference, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    tolerance: float
    missing: tuple[Missing, ...] = ()

    def __repr__(self) -> str:
        return f"<Comparison: {self.headline}>"

    @property
    def differing(self) -> list[Difference]:
        """Signals beyond the tolerance, sorted by time of first deviation; the first is the likeliest cause."""
        differing = [difference for difference in self.signals if not difference.part <= self.tolerance]
        return sorted(
            differing,
            key=lambda difference: (
                difference.time,
                -difference.part,
                difference.name,
                difference.variant,
                difference.seed,
            ),
        )

    @property
    def identical_count(self) -> int:
        """Number of bit-identical signals."""
        return sum(difference.part == 0 for difference in self.signals)

    @property
    def agrees(self) -> bool:
        """Whether nothing differs by more than the tolerance."""
        return not self.problems and not self.differing and not self.missing

    @property
    def headline(self) -> str:
        """Whether the runs agree, and in how much they differ."""
        count, differing, equal = len(self.signals), len(self.differing), self.identical_count
        within = f"{equal} equal to the bit, {count - equal - differing} within {self.tolerance:g}"
        if self.agrees:
            return f"The runs agree: {count} signals, {within}."
        parts = [f"{differing} of {count} signals ({within})"]
        if self.problems:
            parts.append(f"{len(self.problems)} other difference{'s' * (len(self.problems) > 1)}")
        parts += [f"{entry.count} only in the {entry.run}" for entry in self.missing]
        return f"The runs differ: {', '.join(parts)}."

    @property
    def largest(self) -> Difference | None:
        """The difference that is largest relative to its signal; None if all are within the tolerance."""
        return max(self.differing, key=lambda difference: difference.part, default=None)


def compare_runs(
    folders: tuple[Path, Path],
    summaries: tuple[Mapping[str, Any], Mapping[str, Any]],
    tolerance: float,
    patterns: Sequence[str] = (),
    variants: Sequence[str] = (),
) -> Comparison:
    """Compare two runs. `patterns`: signals to compare, such as `heart.*`; `variants`: their cases; all if there are none.

    Where times differ, both are compared at the times of the coarser recording (`common_times`). Status and expectations, which are of a
    whole run, are compared without `patterns` and `variants`. TwinError for a variant that neither run has.
    """
    all_variants = {entry["variant"]: None for summary in summaries for entry in summary["cases"]}
    if unknown := [name for name in variants if name not in all_variants]:
        raise TwinError(f"{unknown[0]!r}: neither run has this variant. {nearest(unknown[0], all_variants)}")
    paths = (folders[0] / "signals.parquet", folders[1] / "signals.parquet")
    first, second = (
        {name: entry for name, entry in list_recorded_variables(path).items() if is_selected(name, patterns)}
        for path in paths
    )
    problems, missing = compare_summaries(*summaries, tolerance, metrics=not patterns, variants=variants)
    notes: dict[str, None] = {}
    differences: list[Difference] = []
    recorded: tuple[dict[str, list[str]], ...] = ({}, {})  # signals by case, in cases of both runs
    samples = max((sum(entry["samples"] for entry in summary["cases"]) for summary in summaries), default=0)
    for names in batches([*first, *(name for name in second if name not in first)], first | second, samples):
        read = [
            read_variables(path, [own[name] for name in names if name in own])
            for path, own in zip(paths, (first, second), strict=True)
        ]
        for case in read[0]:
            if case not in read[1] or (variants and case[0] not in variants):
                continue
            a, b = read[0][case], read[1][case]
            where = f"{case[0]}, seed {case[1]}"
            if not np.array_equal(a.time, b.time):
                notes[f"{where}: {DIFFERENT_TIMES}"] = None
                if (entry := describe_length_difference(a.time, b.time)) and (
                    problem := f"{where}: {entry}"
                ) not in problems:
                    problems.append(problem)
            for own, signals in zip(recorded, (a, b), strict=True):
                own.setdefault(where, []).extend(name for name in names if name in signals.values)
            differences += [
                largest_difference(name, case, a, b, tolerance)
                for name in names
                if name in a.values and name in b.values
            ]
    return Comparison(
        tuple(differences), tuple(problems), tuple(notes), tolerance, (*missing, *missing_signals(*recorded))
    )


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


def list_missing(kind: str, first: Iterable[str], second: Iterable[str]) -> list[Missing]:
    """Return the entries of only one run, for each run that has any."""
    names_first, names_second = list(first), list(second)
    return [
        Missing(kind, run, names)
        for own, other, run in ((names_first, names_second, "first"), (names_second, names_first, "second"))
        if (names := tuple(name for name in own if name not in other))
    ]


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
    x, y = to_si(x, unit), to_si(y, other)
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
    return Difference(*where, value, part, float(time[np.argmax(distance > tolerance * size)]), unit)


def is_convertible(first: str, second: str) -> bool:
    """Whether two units measure the same quantity."""
    from twin.component import unit

    try:
        return first == second or unit.same_kind(unit.describe(first), unit.describe(second))
    except CouplingError:
        return False


def to_si(values: Any, unit: str) -> Any:
    """Convert values to coherent SI units, as floats; values in SI are returned unchanged."""
    factor, offset = si_conversion(unit)
    values = np.asarray(values, np.float64)
    return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def compare_summaries(
    first: Mapping[str, Any],
    second: Mapping[str, Any],
    tolerance: float,
    *,
    metrics: bool,
    variants: Sequence[str],
) -> tuple[list[str], list[Missing]]:
    """List the differences in cases and, with `metrics`, in metrics, status and verdicts; the latter two of all variants."""
    cases = [
        [
            (entry["variant"], str(entry["seed"]))
            for entry in summary["cases"]
            if not variants or entry["variant"] in variants
        ]
        for summary in (first, second)
    ]
    missing = list_missing("case", *([f"{variant}, seed {seed}" for variant, seed in own] for own in cases))
    if not metrics:
        return [], missing
    problems = []
    missing += list_missing("metric", first["metrics"], second["metrics"])
    common = [case for case in cases[0] if case in cases[1]]
    for name, metric in first["metrics"].items():
        if name in second["metrics"]:
            problems += metric_problems(name, metric, second["metrics"][name], common, tolerance)
    if variants:
        return problems, missing
    if first["status"] != second["status"]:
        problems.insert(0, f"status: {first['status']} and {second['status']}.")
    outcomes = [{entry["name"]: entry["verdict"] for entry in summary["expectations"]} for summary in (first, second)]
    missing += list_missing("expectation", *outcomes)
    problems += [
        f"expectation {name}: {verdict} and {outcomes[1][name]}."
        for name, verdict in outcomes[0].items()
        if outcomes[1].get(name, verdict) != verdict
    ]
    return problems, missing


def metric_problems(
    name: str, first: Mapping[str, Any], second: Mapping[str, Any], cases: Sequence[tuple[str, str]], tolerance: float
) -> list[str]:
    """Return a line about a metric that differs: the case where it differs most, and in how many others it does."""
    different = []
    for variant, seed in cases:
        a, b = (entry["variants"].get(variant, {}).get("values", {}).get(seed) for entry in (first, second))
        if first["unit"] != second["unit"] or not is_close(a, b, tolerance):
            part = abs(a - b) / (max(abs(a), abs(b)) or 1.0) if a is not None and b is not None else np.inf
            different.append((part, f"{variant}, seed {seed}", a, b))
    if not different:
        return []
    _, where, a, b = max(different, key=lambda entry: entry[0])
    digits = 6 if a is None or b is None or f"{a:.6g}" != f"{b:.6g}" else 17
    texts = " and ".join(
        "no value" if value is None else f"{value:.{digits}g} {entry['unit']}".rstrip()
        for value, entry in ((a, first), (b, second))
    )
    count = len(different) - 1
    more = f"; also in {count} other case{'s' * (count > 1)}" if count else ""
    return [f"metric {name} of {where}: {texts}{more}."]


def is_close(first: float | None, second: float | None, tolerance: float) -> bool:
    """Whether two numbers differ by no more than a fraction of the larger; None equals None only."""
    if first is None or second is None:
        return first is second
    return abs(first - second) <= tolerance * max(abs(first), abs(second))
