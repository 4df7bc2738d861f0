"""Figures of a run: metrics over recorded signals, the paper's value beside them, and what is expected of them.

Everything here is in coherent SI units; the unit a metric is shown in is applied when it is shown.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.results import dimension
from twin.results.ordering import ordered
from twin.results.reduction import reduced
from twin.results.signals import WHOLE, Signals, Window, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.results.expression import Expression

SPREADS = ("std", "peak_to_peak")  # differences, whatever the signal is


@dataclass(frozen=True)
class Metric:
    """One number per run. `paper`: the published figure of each variant; `tolerance`: 0.2 is ± 20 %; no `variants`: all."""

    name: str
    signal: Expression
    reduce: str
    window: Window = WHOLE
    unit: str = ""
    paper: dict[str, float] = field(default_factory=dict)
    tolerance: float | None = None
    variants: tuple[str, ...] = ()
    description: str = ""
    where: str = field(default="", compare=False)

    @property
    def is_difference(self) -> bool:
        """Whether the offset of its unit does not matter, as in 2 degC more."""
        return self.reduce in SPREADS or dimension.is_difference(self.signal)

    def shown(self, value: float | None, scale: float = 0.0) -> str:
        """A value of the metric in its unit."""
        return shown(value, self.unit, scale, self.is_difference)


@dataclass(frozen=True)
class Expectation:
    """A limit that makes a run fail: on a metric, on every sample of a signal, or on the order of variants."""

    name: str
    metric: str | None = None
    signal: Expression | None = None
    variants: tuple[str, ...] = ()
    at_least: float | None = None
    at_most: float | None = None
    ordered: tuple[str, ...] = ()
    descending: bool = True
    window: Window = WHOLE
    unit: str = ""
    mean: bool = False  # of a metric: the mean over all variants and seeds is judged, not each run
    where: str = field(default="", compare=False)
    ends: str = ""  # stopped or completed: how the hardware ends a run, everything at rest
    is_difference: bool = False  # what is judged: the unit's offset does not matter
    margin: float = 0.0  # of an order: by how much at least each must differ from the one before; SI
    margin_part: float = 0.0  # the same as part of the one before
    nominal: bool = False  # judged with the scenario's own parameters alone

    def gap(self, before: float, after: float) -> float:
        """By how much more than the margin the second is on its side of the first."""
        way = before - after if self.descending else after - before
        return way - self.margin - self.margin_part * abs(before)

    def shown(self, value: float | None, scale: float = 0.0) -> str:
        """A value of what is judged in the unit of the limits."""
        return shown(value, self.unit, scale, self.is_difference)


@dataclass(frozen=True)
class Ending:
    """How hardware ended a run. `time_ns`: of a stop before the end; `unsafe`: what is not known to be at rest."""

    time_ns: clock.Time | None = None
    reason: str = ""
    unsafe: str = ""
    log: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """`stopped at 3.06 s: ...`."""
        end = "ran to its end." if self.time_ns is None else f"stopped at {clock.text(self.time_ns)}: {self.reason}"
        return f"{end} Not at rest: {self.unsafe}" if self.unsafe else end


@dataclass(frozen=True)
class Curve:
    """A line of a plot; `x` is given for loops such as force over position."""

    signal: Expression
    label: str
    x: Expression | None = None


@dataclass(frozen=True)
class Plot:
    """A figure of the report. `per_variant`: one panel for each variant, else one panel with every variant's lines.

    `points`: a mark for each sample instead of a line, as for readings at rest.
    """

    title: str
    curves: tuple[Curve, ...]
    label: str = ""
    unit: str = ""
    x_label: str = ""
    x_unit: str = ""
    window: Window = WHOLE
    per_variant: bool = False
    band: tuple[float, float] | None = None
    lines: tuple[float, ...] = ()
    variants: tuple[str, ...] = ()
    where: str = field(default="", compare=False)
    points: bool = False

    @property
    def is_difference(self) -> bool:
        """Whether the offset of its unit does not matter, as in 2 degC more."""
        return all(dimension.is_difference(curve.signal) for curve in self.curves)

    def shown(self, value: float) -> str:
        """A value on the axis."""
        return shown(value, self.unit, is_difference=self.is_difference)


@dataclass(frozen=True)
class Figure:
    """One metric of one variant: its value for each seed, beside the paper's. SI; None: not a finite number.

    `verdict`: pass, fail, info (nothing to compare with), other (not at the paper's settings), none (no value: fails).
    """

    metric: Metric
    variant: str
    values: dict[int, float | None]
    paper: float | None
    verdict: str = "info"
    scale: float = 0.0  # size of the numbers that the values were made of

    @property
    def mean(self) -> float | None:
        """Mean over seeds; None if one of them has no value."""
        values = [value for value in self.values.values() if value is not None]
        return float(np.mean(values)) if values and len(values) == len(self.values) else None

    @property
    def worst(self) -> float | None:
        """The smallest of the seeds for `min`, else the largest in size."""
        values = [value for value in self.values.values() if value is not None]
        if not values or len(values) < len(self.values):
            return None
        return min(values) if self.metric.reduce == "min" else max(values, key=abs)

    @property
    def ratio(self) -> float | None:
        """Mean over the paper's figure."""
        return self.mean / self.paper if self.mean is not None and self.paper else None


@dataclass(frozen=True)
class Outcome:
    """What became of one expectation: pass, fail, or skipped if nothing that it names was run."""

    name: str
    verdict: str
    detail: str


@dataclass(frozen=True)
class Evaluation:
    """All figures and outcomes of a run."""

    figures: tuple[Figure, ...] = ()
    outcomes: tuple[Outcome, ...] = ()
    paper_applies: bool = True

    @property
    def passed(self) -> bool:
        """Whether everything that was expected holds."""
        verdicts = {one.verdict for one in self.figures} | {one.verdict for one in self.outcomes}
        return not {"fail", "none"} & verdicts


def evaluate(
    metrics: Mapping[str, Metric],
    expectations: Iterable[Expectation],
    tables: Mapping[tuple[str, int], Signals],
    paper_applies: bool = True,
    endings: Mapping[tuple[str, int], Ending] = MappingProxyType({}),
) -> Evaluation:
    """Judge what was recorded; `tables`: (variant, seed) -> signals. Cases that are not complete are left out."""
    complete = {case: signals for case, signals in tables.items() if signals.complete}
    figures = [
        judged(figure(metric, variant, complete), paper_applies)
        for metric in metrics.values()
        for variant in dict.fromkeys(variant for variant, _ in complete)
        if not metric.variants or variant in metric.variants
    ]
    present = [one for one in figures if one.values]
    outcomes = []
    for one in expectations:
        if one.nominal and not paper_applies:
            what, expected, name = subject(one)
            outcomes.append(
                Outcome(name, "skipped", f"{what} is expected {expected} with the file's own parameters alone.")
            )
        elif one.ends:
            outcomes.append(ended(one, complete, endings))
        else:
            outcomes.append(outcome(one, present, complete))
    return Evaluation(tuple(present), tuple(outcomes), paper_applies)


def figure(metric: Metric, variant: str, tables: Mapping[tuple[str, int], Signals]) -> Figure:
    """A metric of a variant; without values if the variant has no such signal."""
    values: dict[int, float | None] = {}
    scale = 0.0
    for (name, seed), signals in tables.items():
        if name != variant or not signals.has(metric.signal):
            continue
        value = reduced(metric.reduce, (samples for _, samples in signals.pieces(metric.signal, metric.window)))
        values[seed] = value if np.isfinite(value) else None
        scale = max(scale, signals.scale(metric.signal) if np.isfinite(value) else 0.0)
    return Figure(metric, variant, values, metric.paper.get(variant), scale=scale)


def judged(one: Figure, paper_applies: bool) -> Figure:
    """With its verdict: whether the mean over seeds is within the tolerance of the paper's figure."""
    verdict = "info"
    if one.mean is None:
        verdict = "none"
    elif one.paper is not None and not paper_applies:
        verdict = "other"
    elif one.paper is not None and one.metric.tolerance is not None:
        # the last digit of a decimal tolerance must not decide: 1.2 times 0.1 is not exactly 0.12
        allowed = one.metric.tolerance * abs(one.paper) * (1 + 1e-9)
        verdict = "pass" if abs(one.mean - one.paper) <= allowed else "fail"
    return replace(one, verdict=verdict)


def outcome(one: Expectation, figures: Iterable[Figure], tables: Mapping[tuple[str, int], Signals]) -> Outcome:
    """What became of an expectation. A case that has its signal but no sample to judge fails it."""
    own = {figure.variant: figure for figure in figures if figure.metric.name == one.metric}
    if one.ordered:
        return Outcome(*ordered(one, own))
    found: list[tuple[str, float, float, str]] = []  # case, lowest and highest value, when the worse one was
    scale = max((figure.scale for figure in own.values()), default=0.0)
    for (variant, seed), signals in tables.items():
        if one.variants and variant not in one.variants:
            continue
        case = f"{variant}, seed {seed}"
        if one.signal is None:
            value = own[variant].values.get(seed) if variant in own else None
            if variant in own:
                found.append((case, *((np.nan, np.nan) if value is None else (value, value)), ""))
        elif signals.has(one.signal):
            extremes = list(map(extreme, signals.pieces(one.signal, one.window)))
            if not any(map(len, extremes)):
                return unjudged(one, case, not extremes)
            scale = max(scale, signals.scale(one.signal))
            times, values = np.concatenate(extremes).T
            low, high = int(np.argmin(values)), int(np.argmax(values))
            is_low = one.at_least is not None and not values[low] >= one.at_least
            worse = low if is_low or not np.isfinite(values[low]) else high
            found.append((case, values[low], values[high], f" at {times[worse]:.6g} s"))
    if one.mean and found:
        mean = float(np.mean([row[1] for row in found]))
        found = [(f"the mean of {len(found)} runs", mean, mean, "")]
    return limits(one, found, scale)


def extreme(samples: tuple[Any, Any]) -> np.ndarray[Any, Any]:
    """Time and value of the lowest and of the highest sample, (2, 2); of none (0, 2)."""
    time, value = samples
    places = [int(np.argmin(value)), int(np.argmax(value))] if len(value) else []
    return np.stack([time[places], np.asarray(value, np.float64)[places]], axis=1)


def subject(one: Expectation) -> tuple[str, str, str]:
    """What is judged, what is expected of it, and the name of an expectation of limits."""
    what = one.metric or (one.signal.text if one.signal else "")
    low, high = one.shown(one.at_least), one.shown(one.at_most)
    if one.at_least is not None and one.at_most is not None:
        expected = f"from {low} to {high}"
    else:
        expected = f"at most {high}" if one.at_least is None else f"at least {low}"
    return what, expected, one.name or f"{what} {expected}"


def unjudged(one: Expectation, case: str, is_array: bool) -> Outcome:
    """An expectation that says nothing about a case, though its signal is there."""
    what, expected, name = subject(one)
    reason = "is no single value" if is_array else f"has no sample{one.window.text.replace(',', '')}"
    advice = "Name its elements." if is_array else "Change `from` and `to`, or record more often."
    return Outcome(name, "fail", f"{what} {reason} in {case}; expected {expected}. {advice}")


def limits(one: Expectation, found: list[tuple[str, float, float, str]], scale: float = 0.0) -> Outcome:
    """Whether every case keeps the limits; else by which case and value they are broken first. `scale`: see `shown`."""
    what, expected, name = subject(one)
    if not found:
        return Outcome(name, "skipped", f"{what} was not recorded in a complete run.")
    broken = []
    for case, least, most, when in found:
        below = one.at_least is not None and not least >= one.at_least
        below = below or not np.isfinite(least)
        if below or not np.isfinite(most) or (one.at_most is not None and not most <= one.at_most):
            broken.append((case, one.shown(least if below else most, scale), when))
    if broken:
        case, value, when = broken[0]
        cases = (
            f" Broken in {len(broken)} of {len(found)} runs" + f": {grouped(broken, found)}." if len(found) > 1 else ""
        )
        return Outcome(name, "fail", f"{what} is {value}{when} in {case}; expected {expected}.{cases}")
    span = " to ".join(
        dict.fromkeys((one.shown(min(row[1] for row in found), scale), one.shown(max(row[2] for row in found), scale)))
    )
    return Outcome(name, "pass", f"{what} was {span}; expected {expected}.")


def grouped(broken: list[tuple[str, str, str]], found: list[tuple[str, float, float, str]]) -> str:
    """The variants of the broken cases, each once, with the seeds that fail and those that pass if it has several."""
    seeds: dict[str, dict[str, bool]] = {}  # variant -> seed -> whether it fails
    fails = {case for case, _, _ in broken}
    for case, *_ in found:
        variant, _, seed = case.rpartition(", seed ")
        seeds.setdefault(variant, {})[seed] = case in fails
    parts = []
    for variant, own in seeds.items():
        wrong = [seed for seed, failed in own.items() if failed]
        right = [seed for seed, failed in own.items() if not failed]
        if not wrong:
            continue
        passing = f"; passes at {', '.join(right)}" if right else ""
        parts.append(f"{variant} (fails at seed {', '.join(wrong)}{passing})" if len(own) > 1 else variant)
    return ", ".join(parts)


def ended(
    one: Expectation, tables: Mapping[tuple[str, int], Signals], endings: Mapping[tuple[str, int], Ending]
) -> Outcome:
    """Whether the hardware stopped every case when it was expected to, or let it run to its end, and came to rest."""
    low, high = one.window.start_ns, one.window.stop_ns
    expected = "a run to its end" if one.ends == "completed" else "a stop"
    expected += "" if low is None else f" from {clock.text(low)}"
    expected += "" if high is None else f" {'until' if low is None else 'to'} {clock.text(high)}"
    name = one.name or f"ends with {expected}"
    found = {
        f"{variant}, seed {seed}": endings.get((variant, seed), Ending())
        for variant, seed in tables
        if not one.variants or variant in one.variants
    }
    if not found:
        return Outcome(name, "skipped", "None of its variants was run.")
    for case, ending in found.items():
        when = ending.time_ns
        stopped = when is not None and (low is None or low <= when) and (high is None or when <= high)
        if ending.unsafe or (when is not None if one.ends == "completed" else not stopped):
            return Outcome(name, "fail", f"{case} {ending.text} Expected {expected}, everything at rest.")
    times = [ending.time_ns for ending in found.values() if ending.time_ns is not None]
    span = " to ".join(dict.fromkeys(clock.text(one) for one in (min(times), max(times)))) if times else ""
    how = f"stopped at {span}" if times else "completed"
    runs = f"{len(found)} run{'s' if len(found) > 1 else ''}"
    return Outcome(name, "pass", f"{runs} {how}, everything at rest; expected {expected}.")
