"""Dose over depth, phase of the beat at needle entry, and wall speed at entry."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

RESTING = 0.25  # part of the usual peak of its speed up to which a wall is said to rest
STEP = 10e-3  # between recorded rows, as scenarios/injection_sequence.yaml [s]
LAYER = 0.25e-3  # thickness of a layer [m], as InjectionSite has it


def profile(**layers: Values) -> dict[str, float | Values]:
    """Final dose of each layer over the depth of its middle, and its spread over the layers with a dose.

    Inputs are named layer_1, layer_2, ... from the surface.
    """
    final = np.array([layers[f"layer_{layer}"][-1] for layer in range(1, len(layers) + 1)])
    count = len(layers["layer_1"])
    depth, amount = np.full(count, np.nan), np.full(count, np.nan)
    depth[: len(final)] = LAYER * (np.arange(len(final)) + 0.5)
    amount[: len(final)] = final
    inner = np.flatnonzero(final)[1:-1]  # the first and the last layer are only partly crossed
    spread = float(np.std(final[inner]) / np.mean(final[inner])) if len(inner) > 1 else np.nan
    return {"depth": depth, "amount": amount, "spread": spread}


profile.outputs = {"depth": "m", "amount": "m^3", "spread": ""}  # type: ignore[attr-defined]


def entries(depth: Values, beats: Values, velocity: Values, listening: Values) -> dict[str, float | Values]:
    """How often the needle went through the surface, in which part of a beat, and how fast the wall was.

    `beats` counts beats with their parts, `velocity` is the wall's [m/s]. The parts are 0 to 1 from the R wave: entries around it
    give both ends. `listening`: whether the sequence waits in contact. Speeds are parts of the usual peak: the median over the beats of each one's largest speed.
    """
    rows = np.flatnonzero((depth[:-1] <= 0.0) & (depth[1:] > 0.0)) + 1
    parts = beats[rows] % 1.0
    starts = np.flatnonzero(np.diff(np.floor(beats))) + 1
    peaks = [np.abs(beat).max() for beat in np.split(velocity, starts)[1:-1]]
    speeds = np.abs(velocity[rows]) / np.median(peaks) if peaks else np.full(len(rows), np.nan)
    return {
        "count": float(len(rows)),
        "earliest": float(parts.min()) if len(parts) else np.nan,
        "latest": float(parts.max()) if len(parts) else np.nan,
        "fastest": float(speeds.max()) if len(parts) else np.nan,
        "middle": float(np.median(speeds)) if len(parts) else np.nan,
        "waited": float(np.sum(listening)) * STEP,
        "resting": float(np.sum(speeds <= RESTING)),
    }


entries.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(("count", "earliest", "latest", "fastest", "middle", "resting"), ""),
    "waited": "s",
}
entries.row_interval = STEP  # type: ignore[attr-defined]
