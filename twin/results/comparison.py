"""What differs between two runs: cases, signals sample by sample, metrics, verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import CouplingError
from twin.results.signal_reader import Recorded, read_variables, recorded
from twin.results.signals import coherent, shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.results.signals import Signals

AT_ONCE = 20_000_000  # numbers of one file in memory


@dataclass(frozen=True)
class Difference:
    """The largest difference of a signal in a case. `value` [SI]; `part`: of the largest size of the signal in both.

    `time`: from when on it differs by more than the tolerance [s].
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
        """The difference in the signal's unit."""
        return shown(self.value, self.unit, is_difference=True) if np.isfinite(self.value) else "no number in one"


@dataclass(frozen=True)
class Comparison:
    """`signals`: of those in both; `problems`: what is in one alone, or no longer the same; `notes`: good to know."""

    signals: tuple[Difference, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    tolerance: float

    @property
    def differing(self) -> list[Difference]:
        """Signals beyond the tolerance, in the order in which they part: what comes first may be the cause."""
        found = [one for one in self.signals if not one.part <= self.tolerance]
        return sorted(found, key=lambda one: (one.time, -one.part, one.name, one.variant, one.seed))

    @property
    def equal(self) -> int:
        """Signals that are the same to the bit."""
        return sum(one.part == 0 for one in self.signals)

    @property
    def agree(self) -> bool:
        """Whether nothing differs by more than the tolerance."""
        return not self.problems and not self.differing


def compared(
    folders: tuple[Path, Path],
    summaries: tuple[Mapping[str, Any], Mapping[str, Any]],
    tolerance: float,
    patterns: Sequence[str] = (),
) -> Comparison:
    """Compare two runs. `patterns`: signals that count, such as `heart.*`; all if there are none.

    Where times differ, the second run is interpolated at the times of the first.
    """
    paths = (folders[0] / "signals.parquet", folders[1] / "signals.parquet")
    first, second = ({name: one for name, one in recorded(path).items() if wanted(name, patterns)} for path in paths)
    problems = [*alone("signal", first, second), *judged(*summaries, tolerance, everything=not patterns)]
    notes: dict[str, None] = {}
    found: list[Difference] = []
    common = [name for name in first if name in second]
    samples = max((sum(one["samples"] for one in summary["cases"]) for summary in summaries), default=0)
    for names in batches(common, first, samples):
        read = [
            read_variables(path, [own[name] for name in names])
            for path, own in zip(paths, (first, second), strict=True)
        ]
        for case in read[0]:
            if case not in read[1]:
                continue
            a, b = read[0][case], read[1][case]
            where = f"{case[0]}, seed {case[1]}"
            if not np.array_equal(a.time, b.time):
                notes[f"{where}: recorded at other times; compared where both are, by interpolation."] = None
                if (one := shorter(a.time, b.time)) and (told := f"{where}: {one}") not in problems:
                    problems.append(told)
            for name in names:
                if (name in a.values) is not (name in b.values):
                    problems.append(f"{name} of {where}: is in one run alone.")
                elif name in a.values:
                    found.append(difference(name, case, a, b, tolerance))
    return Comparison(tuple(found), tuple(problems), tuple(notes), tolerance)


def wanted(name: str, patterns: Sequence[str]) -> bool:
    """Whether a signal counts."""
    return not patterns or any(fnmatchcase(name, one) for one in patterns)


def batches(names: Sequence[str], variables: Mapping[str, Recorded], samples: int) -> Iterator[list[str]]:
    """The names in groups that fit into memory."""
    group: list[str] = []
    for name in names:
        group.append(name)
        if sum(len(variables[one].columns) for one in group) * max(samples, 1) >= AT_ONCE:
            yield group
            group = []
    if group:
        yield group


def alone(what: str, first: Mapping[Any, Any], second: Mapping[Any, Any]) -> list[str]:
    """What only one run has."""
    return [
        f"{what} {name}: is only in the {place} run."
        for own, other, place in ((first, second, "first"), (second, first, "second"))
        for name in own
        if name not in other
    ]


def shorter(first: Any, second: Any) -> str:
    """That one of two recordings ended earlier, by more than its distance of samples, or nothing."""
    ends = [float(of[-1]) if len(of) else 0.0 for of in (first, second)]
    step = max((float(np.max(np.diff(of))) for of in (first, second) if len(of) > 1), default=0.0)
    if abs(ends[0] - ends[1]) <= step * (1 + 1e-9):
        return ""
    return f"recorded to {ends[0]:g} s and to {ends[1]:g} s."


def difference(name: str, case: tuple[str, int], a: Signals, b: Signals, tolerance: float) -> Difference:
    """The largest difference of a signal; of units that do not convert, and of other shapes, an infinite one."""
    x, y = np.asarray(a.values[name]), np.asarray(b.values[name])
    unit, other = a.units.get(name, ""), b.units.get(name, "")
    where = (name, *case)
    if x.shape[1:] != y.shape[1:] or not convertible(unit, other):
        return Difference(*where, np.inf, np.inf)
    is_real = x.dtype.kind == "f" and y.dtype.kind == "f"
    x, y = si(x, unit), si(y, other)
    time = np.asarray(a.time)
    if not np.array_equal(a.time, b.time):
        inside = (time >= b.time[0]) & (time <= b.time[-1]) if len(b.time) else np.zeros(len(time), bool)
        time, x = time[inside], x[inside]
        y = at(time, np.asarray(b.time), y, is_real)
    if not len(x):
        return Difference(*where, np.inf, np.inf)
    same = (x == y) | (np.isnan(x) & np.isnan(y))
    with np.errstate(invalid="ignore"):
        apart = np.where(same, 0.0, np.abs(x - y))
    apart = np.where(np.isnan(apart), np.inf, apart)
    apart = apart.reshape(len(apart), -1).max(axis=1, initial=0.0)
    value = float(apart.max())
    size = max((float(np.max(np.abs(one[np.isfinite(one)]), initial=0.0)) for one in (x, y)), default=0.0)
    part = 0.0 if value == 0 else value / size if size else np.inf
    return Difference(*where, value, part, float(time[np.argmax(apart > tolerance * size)]), unit)


def convertible(first: str, second: str) -> bool:
    """Whether two units measure the same."""
    from twin.component import unit

    try:
        return first == second or unit.same_kind(unit.describe(first), unit.describe(second))
    except CouplingError:
        return False


def si(values: Any, unit: str) -> Any:
    """Values in coherent SI units, as floats; those of SI as they are."""
    factor, offset = coherent(unit)
    values = np.asarray(values, np.float64)
    return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def at(time: Any, own: Any, values: Any, is_real: bool) -> Any:
    """Values at other times: between samples on a line, of whole numbers and Booleans the last one."""
    if not is_real:
        return values[np.clip(np.searchsorted(own, time, side="right") - 1, 0, None)]
    columns = values.reshape(len(values), -1)
    found = (
        np.stack([np.interp(time, own, column) for column in columns.T], 1) if columns.size else columns[: len(time)]
    )
    return found.reshape(len(time), *values.shape[1:])


def judged(first: Mapping[str, Any], second: Mapping[str, Any], tolerance: float, *, everything: bool) -> list[str]:
    """Cases, status, metrics and verdicts that are not the same."""
    cases = [{f"{one['variant']}, seed {one['seed']}": one for one in of["cases"]} for of in (first, second)]
    found = alone("case", *cases)
    if not everything:
        return found
    if first["status"] != second["status"]:
        found.append(f"status: {first['status']} and {second['status']}.")
    metrics = [
        {
            f"{name} of {variant}, seed {seed}": (value, metric["unit"])
            for name, metric in of["metrics"].items()
            for variant, one in metric["variants"].items()
            for seed, value in one["values"].items()
        }
        for of in (first, second)
    ]
    found += alone("metric", *metrics)
    for name, (value, unit) in metrics[0].items():
        other, other_unit = metrics[1].get(name, (value, unit))
        if unit != other_unit or not near(value, other, tolerance):
            found.append(f"metric {name}: {value} {unit} and {other} {other_unit}.")
    outcomes = [{one["name"]: one["verdict"] for one in of["expectations"]} for of in (first, second)]
    found += alone("expectation", *outcomes)
    found += [
        f"expectation {name}: {verdict} and {outcomes[1][name]}."
        for name, verdict in outcomes[0].items()
        if outcomes[1].get(name, verdict) != verdict
    ]
    return found


def near(first: float | None, second: float | None, tolerance: float) -> bool:
    """Whether two numbers differ by no more than a part of the larger; None is like None alone."""
    if first is None or second is None:
        return first is second
    return abs(first - second) <= tolerance * max(abs(first), abs(second))
