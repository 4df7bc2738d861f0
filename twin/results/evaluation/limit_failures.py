"""Failures of limits in words: the worst sample with its time and case, the first violation, and the other cases."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results.evaluation.coverage import describe_cases
from twin.results.evaluation.reduction import is_outside, limit_excess, window_end

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from twin.results.evaluation.expression import Expression
    from twin.results.evaluation.metrics import Expectation
    from twin.results.recording.signals import Signals, Window

Case = tuple[str, int]
STATISTICS = {"mean": "mean", "std": "standard deviation", "rms": "RMS", "peak_to_peak": "peak to peak"}


@dataclass(frozen=True)
class CaseRange:
    """Smallest and largest value of a case [SI], their times and that of the first violation [s]; no times for a metric.

    `case`: variant and seed; None of the mean over all cases. `window_length` [s]: of values that are of so long before their times.
    `statistic`: of what samples a metric of many is, such as `standard deviation`.
    """

    case: Case | None
    low: float
    high: float
    low_time: float | None = None
    high_time: float | None = None
    first_violation: float | None = None
    window_length: float = 0.0
    statistic: str = ""


def in_windows(row: CaseRange, signal: Expression, window: Window, signals: Signals) -> CaseRange:
    """Return a row with the ends of the windows as its times, if values of the signal are of windows before their rows."""
    length = signals.window_length(signal)
    if not length or row.low_time is None or row.high_time is None:
        return row
    parts = list(signals.evaluate_parts(signal, window))
    ends = [window_end(parts, instant) for instant in (row.low_time, row.high_time)]
    return replace(row, low_time=ends[0], high_time=ends[1], window_length=length)


def with_statistic(row: CaseRange, reduce: str, parts: Iterable[tuple[Any, Any]]) -> CaseRange:
    """Return a row with the statistic and the window of a metric that is no single sample. `parts`: time and value."""
    times = [time for time, _ in parts if len(time)]
    if reduce not in STATISTICS or not times:
        return row
    begin, end = float(times[0][0]), float(times[-1][-1])
    return replace(row, low_time=end, high_time=end, window_length=end - begin, statistic=STATISTICS[reduce])


@dataclass(frozen=True)
class LimitSample:
    """Sample of a case outside of a limit, by `excess`; all SI. `case` and `time`: as in `CaseRange`."""

    case: Case | None
    value: float
    time: float | None
    excess: float
    is_low: bool
    window_length: float = 0.0
    statistic: str = ""


def describe_limits(expectation: Expectation) -> tuple[str, str, str]:
    """Return the checked quantity, its expected range, and the expectation's name."""
    what = expectation.metric or (expectation.signal.text if expectation.signal else "")
    low, high = expectation.shown(expectation.at_least), expectation.shown(expectation.at_most)
    if expectation.at_least is not None and expectation.at_most is not None:
        limits = f"from {low} to {high}"
    else:
        limits = f"at most {high}" if expectation.at_least is None else f"at least {low}"
    is_exact = expectation.at_least == expectation.at_most
    return what, f"exactly {low}" if is_exact else limits, expectation.name or f"{what} {limits}"


def violating_samples(expectation: Expectation, row: CaseRange) -> list[LimitSample]:
    """Return the smallest and the largest sample of a case, as far as they are outside of the limits."""
    low, high = expectation.at_least, expectation.at_most
    sides = ((row.low, row.low_time, low, None), (row.high, row.high_time, None, high))
    return [
        LimitSample(
            row.case,
            value,
            time,
            float(limit_excess(value, *limits)),
            limits[1] is None,
            row.window_length,
            row.statistic,
        )
        for value, time, *limits in sides
        if is_outside(value, *limits)
    ]


def extreme_samples(samples: tuple[Any, Any], expectation: Expectation) -> np.ndarray[Any, Any]:
    """Return time and value of the smallest, the largest and the first violating sample, (2 or 3, 2); (0, 2) without samples."""
    time, value = samples
    violating = np.flatnonzero(is_outside(value, expectation.at_least, expectation.at_most))
    indices = [int(np.argmin(value)), int(np.argmax(value)), *violating[:1]] if len(value) else []
    return np.stack([time[indices], np.asarray(value, np.float64)[indices]], axis=1)


def describe_failure(
    expectation: Expectation, failing: Sequence[CaseRange], run: Sequence[Case], shown: Callable[[float], str]
) -> tuple[str, str]:
    """Return a line on the worst sample, the first violation and the cases, and what it leaves out. `run`: all cases."""
    what, expected, _ = describe_limits(expectation)
    samples = [sample for row in failing for sample in violating_samples(expectation, row)]
    sides = [[sample for sample in samples if sample.is_low == is_low] for is_low in (True, False)]
    worst = [max(side, key=lambda sample: sample.excess) for side in sides if side]
    limits = f", expected {expected.removeprefix('from ')}" if expectation.name else ""
    cases = [row.case for row in failing if row.case is not None]
    brief = describe_cases(cases, run)
    others = f"fails in {brief}" if len(cases) > 1 and brief else ""
    line = [f"{describe_samples(worst, run, shown)}{limits}", describe_first(failing, worst, run), others]
    more = f"Judged: {what}{expectation.window.text}." * bool(expectation.name)
    return f"{'; '.join(filter(None, line))}.", more


def list_cases(
    expectation: Expectation, failing: Iterable[CaseRange], shown: Callable[[float], str]
) -> tuple[tuple[str, int, str, str], ...]:
    """Return variant, seed, value and time of the worst samples of each case, as texts, the worst first; none of a mean over all."""
    samples = [sample for row in failing if row.case for sample in violating_samples(expectation, row)]
    return tuple(
        (*sample.case, shown(sample.value), time_text(sample.time, sample.window_length).strip().removeprefix("at "))
        for sample in sorted(samples, key=lambda sample: -sample.excess)
        if sample.case
    )


def describe_samples(samples: Iterable[LimitSample], run: Sequence[Case], shown: Callable[[float], str]) -> str:
    """Return samples as `0.145 N at 1.2 s and 0.255 N at 3 s in PI, seed 1`."""
    texts: dict[str, list[str]] = {}
    for sample in samples:
        case = ", the mean of all runs" if sample.case is None else describe_cases([sample.case], run)
        where = f" in {case}" if case and sample.case else case
        texts.setdefault(where, []).append(
            f"{sample.statistic} {shown(sample.value)}".lstrip() + time_text(sample.time, sample.window_length)
        )
    return " and ".join(" and ".join(dict.fromkeys(own)) + where for where, own in texts.items())


def describe_first(failing: Sequence[CaseRange], worst: Sequence[LimitSample], run: Sequence[Case]) -> str:
    """Return the time of the first violation, with its case if it is not that of the worst samples; empty if it is one of them, or of windows."""
    times = [
        (row.first_violation, row.case) for row in failing if not (row.first_violation is None or row.window_length)
    ]
    if not times:
        return ""
    time, case = min(times, key=lambda each: each[0])
    if any((sample.time, sample.case) == (time, case) for sample in worst):
        return ""
    text = "" if case is None or {sample.case for sample in worst} == {case} else describe_cases([case], run)
    return f"first{time_text(time)}" + (f" in {text}" if text else "")


def time_text(time: float | None, window_length: float = 0.0) -> str:
    """Return ` at 1.2 s`, of the value of a window ` in 12 s to 22 s`; empty without a time."""
    if time is None:
        return ""
    if not window_length:
        return f" at {time:.6g} s"
    decimals = 2 - math.floor(math.log10(window_length))  # of 10 s, to 0.1 s: its first sample is a row after its begin
    begin, end = (round(instant, decimals) for instant in (time - window_length, time))
    return f" in {begin:.6g} s to {end:.6g} s"
