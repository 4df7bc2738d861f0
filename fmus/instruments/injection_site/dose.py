"""Dose by depth, for a plot."""

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
