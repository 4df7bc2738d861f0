"""Errors of the tip where it has come to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from fmus.coordinate_feedforward.statistics import ends, visited

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]


def points(
    number: Values,
    target_x: Values,
    target_y: Values,
    target_z: Values,
    x: Values,
    y: Values,
    z: Values,
    refusal: Values,
) -> dict[str, float | Values]:
    """RMS errors and the places, for a scenario. A refused coordinate was not visited."""
    at = ends(number)
    rests = at[refusal[at] == 0]
    result: dict[str, float | Values] = {"count": float(len(rests)), "refused": float(len(at) - len(rests))}
    total = np.zeros(len(rests))
    for axis, target, measured in (("x", target_x, x), ("y", target_y, y), ("z", target_z, z)):
        error = measured[rests] - target[rests]
        total += error**2
        result[f"rms_{axis}"] = float(np.sqrt(np.mean(error**2)))
        result[f"wanted_{axis}"], result[f"reached_{axis}"] = visited(target, rests), visited(measured, rests)
    distance = np.full(len(number), np.nan)
    distance[rests] = np.sqrt(total)
    radius = np.full(len(number), np.nan)
    radius[rests] = np.hypot(target_x[rests], target_y[rests])
    result |= {
        "rms": float(np.sqrt(np.mean(total))),
        "largest": float(np.sqrt(total.max())),
        "distance": distance,
        "radius": radius,
    }
    return result


points.outputs = {  # type: ignore[attr-defined]
    "count": "",
    "refused": "",
    "rms": "m",
    "largest": "m",
    "distance": "m",
    "radius": "m",
    **{f"{name}_{axis}": "m" for axis in ("x", "y", "z") for name in ("rms", "wanted", "reached")},
}
