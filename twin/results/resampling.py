"""Two recordings of a signal with different sample times: times of comparison, interpolation, and spikes between them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def common_times(first: Any, second: Any) -> Any:
    """Return the times at which two recordings are compared: samples of the coarser recording while both are recorded.

    Of two that are equally fine, the samples of both. The order of the two makes no difference.
    """
    if np.array_equal(first, second) or not (len(first) and len(second)):
        return first if len(first) <= len(second) else second
    begin, end = max(first[0], second[0]), min(first[-1], second[-1])
    inner = [times[(times >= begin) & (times <= end)] for times in (first, second)]
    if len(inner[0]) == len(inner[1]):
        return np.union1d(*inner)
    return min(inner, key=len)


def resample(time: Any, own_times: Any, values: Any, is_real: bool) -> Any:
    """Return values at other times: interpolated linearly, or the previous value of integers and Booleans."""
    if not is_real:
        return values[np.clip(np.searchsorted(own_times, time, side="right") - 1, 0, None)]
    columns = values.reshape(len(values), -1)
    result = (
        np.stack([np.interp(time, own_times, column) for column in columns.T], 1)
        if columns.size
        else columns[: len(time)]
    )
    return result.reshape(len(time), *values.shape[1:])


def excursion(
    compared: Any, times: Any, values: Any, own_times: Any, own_values: Any, is_real: bool
) -> tuple[Any, Any]:
    """Return a recording's own samples that are not compared, and how far each leaves what the other one can explain.

    `times`, `values`: the other recording, which explains the range of its two neighboring samples, and of real numbers
    also its largest step beyond that range: a smooth curve peaks between samples by less.
    """
    begin, end = max(times[0], own_times[0]), min(times[-1], own_times[-1])
    chosen = (own_times > begin) & (own_times < end) & ~np.isin(own_times, compared) & ~np.isin(own_times, times)
    own_times, own_values = (
        own_times[chosen],
        own_values[chosen].reshape(int(chosen.sum()), math.prod(own_values.shape[1:])),
    )
    values = values.reshape(len(values), math.prod(values.shape[1:]))
    if not own_values.size:
        return own_times[:0], np.zeros(0)
    following = np.searchsorted(times, own_times)
    pair = np.stack([values[following - 1], values[following]])
    with np.errstate(invalid="ignore"):
        outside = np.fmax(own_values - pair.max(axis=0), pair.min(axis=0) - own_values)
        steps = np.abs(np.diff(values, axis=0))
    largest = np.max(steps, axis=0, where=np.isfinite(steps), initial=0.0) * is_real
    outside = np.where(outside > largest, outside, 0.0)
    outside[np.isnan(own_values) & np.isfinite(pair).all(axis=0)] = np.inf
    return own_times, outside.max(axis=1)
