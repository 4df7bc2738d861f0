"""Data of a drawn curve: the extremes in a window, a spectrum, or one quantity over another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from twin.errors import TwinError
from twin.viewer.runs import ViewedCurve, interpolate

if TYPE_CHECKING:
    from twin.viewer.runs import CurveSamples, RunCollection

    Array = np.ndarray[Any, Any]

MIN_SAMPLES = 16  # smallest number of samples of a spectrum
SEGMENTS = 2  # of Welch's method, with 50 % overlap: periodic signals give sharp peaks, noise stays rough
BLOCK = 4096  # samples whose moments are stored together
SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")  # of the edges of a window that includes them
MAX_LOOP = 10_000  # samples of an x-y plot that are all drawn
SPACING_TOLERANCE = 0.01  # relative difference of sample times above which samples are interpolated


@dataclass(frozen=True)
class CurvePoints:
    """Points of a curve. `count`: number of samples that they represent; `unit`, `x_unit`: of the axes; `time`: of an x-y plot."""

    x: Array
    y: Array
    unit: str
    x_unit: str = "s"
    count: int = 0
    is_real: bool = True
    is_boolean: bool = False
    time: Array | None = None


def inside(time: Array, window: tuple[float, float]) -> slice:
    """Return the samples in a window, with one more on both sides so that a line reaches the edge."""
    part = within(time, window)
    return slice(max(part.start - 1, 0), min(part.stop + 1, len(time)))


def within(time: Array, window: tuple[float, float]) -> slice:
    """Return the samples in a window, its edges included."""
    begin, end = (int(np.searchsorted(time, edge, side)) for edge, side in zip(window, SIDES, strict=True))
    return slice(begin, end)


def over_time(runs: RunCollection, curve: ViewedCurve, window: tuple[float, float], points: int) -> CurvePoints:
    """Return at most `points` points over time; of more samples, minimum and maximum of each part."""
    samples = runs.samples(curve)
    part = inside(samples.time, window)
    time, y = samples.time[part], samples.y[part]
    x, shown = decimate(time, y, points)
    return CurvePoints(x, samples.shown(shown), samples.unit, "s", len(time), samples.is_real, samples.is_boolean)


def decimate(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """Return a line of about `points` samples: minimum and maximum of each part at their times; non-finite values become gaps."""
    if len(x) > points:
        indices = extreme_indices(y, points)
        x, y = x[indices], y[indices]
    if y.dtype.kind == "f" and np.isinf(y).any():
        y = np.where(np.isinf(y), np.nan, y)
    return x, y


def extreme_indices(y: Array, points: int) -> Array:
    """Return the indices of minimum and maximum of equal parts, in order; of a part that has NaN, also one of them."""
    from tsdownsample import MinMaxDownsampler, NaNMinMaxDownsampler

    def extremes(method: Any, count: int) -> Array:
        return np.asarray(method().downsample(np.ascontiguousarray(y), n_out=max(count // 2 * 2, 2)), np.int64)

    if y.dtype.kind != "f":
        return extremes(MinMaxDownsampler, points)
    indices = extremes(NaNMinMaxDownsampler, points)  # of a part that has NaN, only that
    if not np.isnan(y[indices]).any():
        return indices
    return np.union1d(extremes(MinMaxDownsampler, points // 2), extremes(NaNMinMaxDownsampler, points // 2))


def over_another(runs: RunCollection, curve: ViewedCurve, window: tuple[float, float], points: int) -> CurvePoints:
    """Return a quantity over another of the same case; of many samples evenly spaced ones and the extremes of both."""
    y, x = runs.samples(curve), runs.samples(replace(curve, minus=None), curve.x)  # of a difference, x of its own case
    part = inside(y.time, window)
    time, value = y.time[part], y.shown(y.y[part])
    across = x.shown(x.y[part]) if np.array_equal(x.time, y.time) else interpolate(time, x)
    if (count := len(time)) > (most := max(points, MAX_LOOP)):  # extremes alone would be chords of a loop
        extremes = [extreme_indices(side, most // 4) for side in (across, value)]
        shown = np.unique(np.concatenate([np.linspace(0, count - 1, most // 2).astype(np.int64), *extremes]))
        across, value, time = across[shown], value[shown], time[shown]
    return CurvePoints(across, value, y.unit, x.unit, count, time=time)


def spectrum(runs: RunCollection, curve: ViewedCurve, window: tuple[float, float], points: int) -> CurvePoints:
    """Return the one-sided power spectral density by Welch's method with Hann windows, mean removed. IEEE Trans. AU-15, 1967.

    The height of a peak narrower than the frequency resolution depends on the length of the window.
    """
    from scipy import signal

    samples = runs.samples(curve)
    time, y = resample(samples, within(samples.time, window))
    if len(y) < MIN_SAMPLES:
        raise TwinError(
            f"{curve.signal}: {len(y)} samples in the window; a spectrum needs {MIN_SAMPLES}. Show more time."
        )
    length = max(MIN_SAMPLES, min(len(y), 2 * len(y) // (SEGMENTS + 1)))
    frequency, density = signal.welch(y, fs=(len(time) - 1) / (time[-1] - time[0]), nperseg=length, detrend="constant")
    x, power = decimate(frequency[1:], density[1:], points)
    return CurvePoints(x, power, density_unit(samples.unit), "Hz", len(y))


def density_unit(unit: str) -> str:
    """Return the unit of a density: `N²/Hz`."""
    grouped = unit if unit.isalpha() or not unit else f"({unit})"
    return f"{grouped}²/Hz" if grouped else "1/Hz"


def resample(samples: CurveSamples, part: slice) -> tuple[Array, Array]:
    """Return equidistant times and interpolated display values; non-finite values are bridged."""
    time, y = samples.time[part], samples.shown(samples.y[part])
    finite = np.isfinite(y)
    time, y = time[finite], y[finite]
    if len(time) < 2:
        return time, y
    steps = np.diff(time)
    typical = float(np.median(steps))
    if typical > 0 and np.max(np.abs(steps - typical)) <= SPACING_TOLERANCE * typical:
        return time, y
    count = int(min((time[-1] - time[0]) / max(typical, 1e-12), 4 * len(time))) + 1
    times = np.linspace(time[0], time[-1], count)
    return times, np.interp(times, time, y)


def statistics(runs: RunCollection, curve: ViewedCurve, window: tuple[float, float]) -> dict[str, Any]:
    """Return statistics of the samples in a window, in the display unit; `count` alone if there are none.

    `rate`: samples per second; `slope`: of the least-squares line, per second, None at a single time. Moments of blocks are
    computed once, so that any window of ten million samples takes milliseconds.
    """
    samples = runs.samples(curve)
    part = within(samples.time, window)
    begin, end = part.start, part.stop
    if begin >= end:
        return {"count": 0}
    numbers = (curve.case, *curve.seeds, *curve.partners, *(() if curve.minus is None else (curve.minus,)))
    paths = (runs.run_of(runs.cases[number]).recording.path for number in numbers)  # each may be growing
    blocks = runs.cache.get((*paths, curve, "moments"), lambda: (moments(samples.time, samples.shown(samples.y)),))[0]
    first, last = -(-begin // BLOCK), end // BLOCK
    if first < last:
        edges = [slice(begin, first * BLOCK), slice(last * BLOCK, end)]
        own = (moments(samples.time[edge], samples.shown(samples.y[edge])) for edge in edges)
        parts = np.concatenate([blocks[first:last], *own])
    else:
        parts = moments(samples.time[part], samples.shown(samples.y[part]))
    if not (total := merge_moments(parts))["count"]:
        return total
    span = float(samples.time[end - 1] - samples.time[begin])
    return total | {"unit": samples.unit, "rate": (end - begin - 1) / span if span > 0 else None}


def moments(time: Array, y: Array) -> Array:
    """Return the moments of each block, (blocks, 8); see `moments_of_finite`."""
    full = len(y) // BLOCK
    blocks, times = (values[: full * BLOCK].reshape(full, BLOCK) for values in (y, time))
    finite = np.isfinite(blocks.min(axis=1)) & np.isfinite(blocks.max(axis=1))
    table = np.empty((full, 8))
    with np.errstate(invalid="ignore"):
        table[:, 0], table[:, 5] = BLOCK, times.mean(axis=1)
    for k in np.flatnonzero(finite):
        table[k, 1] = stable_mean(blocks[k])
        deviations, delays = blocks[k] - table[k, 1], times[k] - table[k, 5]
        table[k, 2], table[k, 6], table[k, 7] = deviations @ deviations, delays @ delays, delays @ deviations
    table[:, 3], table[:, 4] = blocks.min(axis=1), blocks.max(axis=1)
    for k in np.flatnonzero(~finite):
        table[k] = moments_of_finite(times[k], blocks[k])
    rest = slice(full * BLOCK, None)
    return np.concatenate([table, moments_of_finite(time[rest], y[rest])[None]]) if len(y[rest]) else table


def moments_of_finite(time: Array, y: Array) -> Array:
    """Return the moments of the finite values.

    Count, mean, sum of squared deviations, minimum, maximum; mean time, sum of its squared deviations, sum of products of both.
    """
    finite = np.isfinite(y)
    time, y = time[finite], y[finite]
    if not len(y):
        return np.array([0.0, 0.0, 0.0, np.inf, -np.inf, 0.0, 0.0, 0.0])
    mean, middle = stable_mean(y), time.mean()
    deviations, delays = y - mean, time - middle
    return np.array(
        [len(y), mean, deviations @ deviations, y.min(), y.max(), middle, delays @ delays, delays @ deviations]
    )


def stable_mean(y: Array, weights: Array | None = None) -> float:
    """Return the mean as a distance from the first value: exact for equal values, whose deviation is then zero."""
    return float(y[0] + np.average(y - y[0], weights=weights))


def merge_moments(parts: Array) -> dict[str, Any]:
    """Return the statistics of blocks together (Chan, Golub, LeVeque, The American Statistician 37, 1983)."""
    number, means, squares, low, high, middles, spreads, products = parts.T
    if not (count := int(number.sum())):
        return {"count": 0}
    filled = number > 0
    mean = stable_mean(means[filled], number[filled])
    variance = float(squares.sum() + number @ np.square(means - mean)) / count
    lowest, highest = float(low.min()), float(high.max())
    delays = middles - number @ middles / count
    spread = float(spreads.sum() + number @ np.square(delays))
    rise = float(products.sum() + (number * delays) @ (means - mean)) if highest > lowest else 0.0
    return {
        "count": count,
        "mean": mean,
        "std": variance**0.5,
        "rms": (variance + mean**2) ** 0.5,
        "low": lowest,
        "high": highest,
        "peak_to_peak": highest - lowest,
        "slope": rise / spread if spread > 0 else None,
    }


KINDS = {"time": over_time, "xy": over_another, "spectrum": spectrum}


def values_at(runs: RunCollection, curve: ViewedCurve, times: list[float]) -> list[float | None]:
    """Return the values of a curve at some times, None where it was not recorded."""
    samples = runs.samples(curve)
    if not len(samples.time):
        return [None] * len(times)
    values = interpolate(np.array(times, np.float64), samples)
    first, last = samples.time[0], samples.time[-1]
    return [
        float(value) if first <= time <= last and np.isfinite(value) else None
        for time, value in zip(times, values, strict=True)
    ]


__all__ = ["KINDS", "CurvePoints", "statistics", "values_at"]
