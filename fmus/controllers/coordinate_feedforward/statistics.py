"""Statistics of visited coordinates: errors, F and t tests, as in Cheng and Law (paper B), statistical analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]


def ends(number: Values) -> NDArray[np.int64]:
    """Index of the last sample of each coordinate, move or reading; 0 is none."""
    last = np.flatnonzero(np.diff(number, append=np.inf))
    return last[number[last] > 0]


def visited(values: Values, at: NDArray[np.int64]) -> Values:
    """A signal at these samples, not a number elsewhere."""
    signal = np.full(len(values), np.nan)
    signal[at] = values[at]
    return signal


def tests(error: Values, target: Values, measured: Values) -> dict[str, float]:
    """RMS and mean of errors, and p values: variance ratio of measured and target (F), mean error 0 (t), two-sided."""
    freedom = len(target) - 1
    p_f = np.nan  # targets that are all the same have no variance to compare with
    if np.ptp(target) > 0.0:
        ratio = np.var(measured, ddof=1) / np.var(target, ddof=1)
        p_f = 2.0 * min(stats.f.cdf(ratio, freedom, freedom), stats.f.sf(ratio, freedom, freedom))
    p_t = stats.ttest_1samp(error, 0.0).pvalue
    return {
        "rms": float(np.sqrt(np.mean(error**2))),
        "mean": float(np.mean(error)),
        "p_f": float(p_f),
        "p_t": float(p_t),
    }


def coordinates(
    number: Values,
    target_y: Values,
    target_z: Values,
    target_needle: Values,
    y: Values,
    z: Values,
    needle: Values,
    refusal: Values,
) -> dict[str, float | Values]:
    """Errors where the tip has come to rest, for a scenario. A refused coordinate was not visited."""
    at = ends(number)
    at = at[refusal[at] == 0]
    result: dict[str, float | Values] = {"count": float(len(at)), "refused": float(len(ends(number)) - len(at))}
    for axis, target, measured in (("y", target_y, y), ("z", target_z, z), ("needle", target_needle, needle)):
        error = measured[at] - target[at]
        for name, value in tests(error, target[at], measured[at]).items():
            result[f"{name}_{axis}"] = value
        result[f"std_{axis}"] = float(np.std(error, ddof=1))
        result[f"wanted_{axis}"], result[f"reached_{axis}"] = visited(target, at), visited(measured, at)
    return result


coordinates.outputs = {  # type: ignore[attr-defined]
    "count": "",
    "refused": "",
    **{
        f"{name}_{axis}": unit
        for axis in ("y", "z", "needle")
        for name, unit in (
            ("rms", "m"),
            ("mean", "m"),
            ("std", "m"),
            ("p_f", ""),
            ("p_t", ""),
            ("wanted", "m"),
            ("reached", "m"),
        )
    },
}
