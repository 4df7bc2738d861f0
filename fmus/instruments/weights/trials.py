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


def over_pressure(pressure: Any, slip_load: Any, trial: Any) -> dict[str, Any]:
    """Slip load over supply pressure, and the lowest pressure that holds the required load."""
    grid, load = resampled(*curve(pressure, slip_load, trial), len(trial))
    enough = grid[load >= REQUIRED]
    return {"pressure": grid, "load": load, "least": enough.min() if enough.size else np.nan}


def over_diameter(diameter: Any, slip_load: Any, trial: Any) -> dict[str, Any]:
    """Slip load over the instrument's diameter, and the range of diameters with at least the required load."""
    grid, load = resampled(*curve(diameter, slip_load, trial), len(trial))
    enough = grid[load >= REQUIRED]
    bounds = (enough.min(), enough.max()) if enough.size else (np.nan, np.nan)
    return {"diameter": grid, "load": load, "thinnest": bounds[0], "thickest": bounds[1]}


over_pressure.outputs = {"pressure": "Pa", "load": "N", "least": "Pa"}  # type: ignore[attr-defined]
over_diameter.outputs = {"diameter": "m", "load": "N", "thinnest": "m", "thickest": "m"}  # type: ignore[attr-defined]
