"""Dose by depth, and when in the beat the needle goes in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

LAYER = 0.25e-3  # thickness of a layer [m], as InjectionSite has it


def profile(**layers: Values) -> dict[str, float | Values]:
    """Final dose of each layer over the depth of its middle, and its spread over the layers with a dose.

    Inputs are named layer_1, layer_2, ... from the surface.
    """
    final = np.array([layers[f"layer_{place}"][-1] for place in range(1, len(layers) + 1)])
    count = len(layers["layer_1"])
    depth, amount = np.full(count, np.nan), np.full(count, np.nan)
    depth[: len(final)] = LAYER * (np.arange(len(final)) + 0.5)
    amount[: len(final)] = final
    inner = np.flatnonzero(final)[1:-1]  # the first and the last layer are only partly crossed
    spread = float(np.std(final[inner]) / np.mean(final[inner])) if len(inner) > 1 else np.nan
    return {"depth": depth, "amount": amount, "spread": spread}


profile.outputs = {"depth": "m", "amount": "m^3", "spread": ""}  # type: ignore[attr-defined]


def entries(depth: Values, beats: Values) -> dict[str, float | Values]:
    """How often the needle went through the surface, and the first and last part of a beat in which it did.

    `beats` counts beats with their parts. The parts are 0 to 1 from the R wave: a gate across it would give both ends.
    """
    places = np.flatnonzero((depth[:-1] <= 0.0) & (depth[1:] > 0.0)) + 1
    parts = beats[places] % 1.0
    return {
        "count": float(len(places)),
        "earliest": float(parts.min()) if len(parts) else np.nan,
        "latest": float(parts.max()) if len(parts) else np.nan,
    }


entries.outputs = {"count": "", "earliest": "", "latest": ""}  # type: ignore[attr-defined]
