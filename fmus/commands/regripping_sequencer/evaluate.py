"""Smoothness of an instrument's motion through hand-overs, from its true speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEADY = 0.99  # of the largest commanded speed: neither starting nor stopping
STANDING = 0.1  # of the commanded speed: below that it stands
DIGITS = 4  # what a solver leaves of a tip at rest is none


def smoothness(speed: NDArray[np.float64], commanded: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """Speed of the tip over that commanded, while that is steady, from the start of the tip's motion on.

    `standing` is the part of that time in which it stands: of an unfiltered speed, which no tracker shows.
    """
    steady = np.abs(commanded) > STEADY * np.max(np.abs(commanded))
    relative = np.where(steady, speed / np.where(steady, commanded, 1.0), np.nan)
    relative[: int(np.argmax(relative > STEADY))] = np.nan
    finite = relative[np.isfinite(relative)]
    return {
        "relative": np.nan_to_num(relative, nan=0.0),
        "lowest": round(float(np.min(finite)), DIGITS) + 0.0 if len(finite) else float("nan"),
        "standing": float(np.mean(finite < STANDING)) if len(finite) else float("nan"),
    }


smoothness.outputs = {"relative": "", "lowest": "", "standing": ""}  # type: ignore[attr-defined]
