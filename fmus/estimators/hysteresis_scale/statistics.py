"""Tracking of a motion that is planned, and so sent ahead of the time at which the tip should be there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from fmus.em_tracker.model import EMTracker

if TYPE_CHECKING:
    from numpy.typing import NDArray


def analysis(wanted: NDArray[np.float64], tip: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Error of the tip [m] against what was wanted one recorded sample before; zero at the first sample."""
    return {"error": np.append(0.0, tip[1:] - wanted[:-1])}


analysis.outputs = {"error": "m"}  # type: ignore[attr-defined]
analysis.row_interval = EMTracker.period  # type: ignore[attr-defined]
