"""Slip load over a setting that changes from trial to trial: analyses for scenarios."""

from typing import Any

import numpy as np

REQUIRED = 4.5  # [N], least gripping force: paper, section II.A


def curve(setting: Any, slip_load: Any, trial: Any) -> tuple[Any, Any]:
    """Settings and slip loads of the trials, by rising setting."""
    rows = np.flatnonzero(np.diff(trial) > 0) + 1
    order = np.argsort(setting[rows], kind="stable")
    return setting[rows][order], slip_load[rows][order]


def resampled(x: Any, y: Any, count: int) -> tuple[Any, Any]:
    """The polygon through the points, as long as the signals are."""
    if x.size == 0:
        return np.full(count, np.nan), np.full(count, np.nan)
    grid = np.linspace(x[0], x[-1], count)
    return grid, np.interp(grid, x, y)


def holding(setting: Any, slip_load: Any) -> tuple[float, float]:
    """Least and largest setting that was tried and held the required load: a grip that jumps is not interpolated."""
    enough = setting[slip_load >= REQUIRED]
    return (enough.min(), enough.max()) if enough.size else (np.nan, np.nan)


def over_pressure(pressure: Any, slip_load: Any, trial: Any) -> dict[str, Any]:
    """Slip load over supply pressure, and the least pressure tried that holds the required load."""
    points = curve(pressure, slip_load, trial)
    grid, load = resampled(*points, len(trial))
    return {"pressure": grid, "load": load, "least": holding(*points)[0]}


def over_diameter(diameter: Any, slip_load: Any, trial: Any) -> dict[str, Any]:
    """Slip load over the instrument's diameter, and the thinnest and thickest tried that the required load does not move."""
    points = curve(diameter, slip_load, trial)
    grid, load = resampled(*points, len(trial))
    thinnest, thickest = holding(*points)
    return {"diameter": grid, "load": load, "thinnest": thinnest, "thickest": thickest}


over_pressure.outputs = {"pressure": "Pa", "load": "N", "least": "Pa"}  # type: ignore[attr-defined]
over_diameter.outputs = {"diameter": "m", "load": "N", "thinnest": "m", "thickest": "m"}  # type: ignore[attr-defined]
