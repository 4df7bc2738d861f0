"""Distances of moves by gripper, fiber and both, as Al-Ahmad et al. (RACS), section VI, compare them; consistency of the estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Signal = NDArray[np.float64]

STEP = 4e-3  # between recorded rows [s]
REST = (9.5, 27.5, 46.0)  # before the move out, between, and after the move back [s], as scenarios/travel_distance.yaml


def distances(true: Signal, hall: Signal, shift: Signal, fused: Signal) -> dict[str, float]:
    """Mean of the moves' absolute errors, and of the difference of both measures; each read once, while all rests.

    One reading holds the breath of its instant, as a person's reading does.
    """
    rows = [round(instant / STEP) for instant in REST]
    if rows[-1] >= len(true):
        raise ValueError(f"the record ends at {STEP * (len(true) - 1):g} s, before the last reading at {REST[-1]:g} s")
    moves = {
        name: np.diff(values[rows])
        for name, values in (("true", true), ("hall", hall), ("shift", shift), ("fused", fused))
    }
    results = {
        "difference": float(np.abs(moves["hall"] - moves["shift"]).mean()),
        "difference_out": float(abs(moves["hall"][0] - moves["shift"][0])),
        "difference_back": float(abs(moves["hall"][1] - moves["shift"][1])),
        "way": float(np.abs(moves["hall"]).mean()),
    }
    for name, values in (("hall", hall), ("shift", shift), ("fused", fused)):
        results[f"{name}_error"] = float(np.abs(moves[name] - moves["true"]).mean())
        results[f"{name}_rms"] = float(np.sqrt(np.mean((values - true) ** 2)))
    results["against_worse"] = results["fused_error"] / max(results["hall_error"], results["shift_error"])
    results["against_better"] = results["fused_error"] - min(results["hall_error"], results["shift_error"])
    results["rms_against_worse"] = results["fused_rms"] / max(results["hall_rms"], results["shift_rms"])
    results["rms_against_better"] = results["fused_rms"] - min(results["hall_rms"], results["shift_rms"])
    return results


def consistency(true: Signal, fused: Signal, uncertainty: Signal, status: Signal) -> dict[str, float]:
    """Whether errors [m] are as large as the estimate's own standard deviation [m] says (Bar-Shalom et al., Estimation, 2001, 5.4).

    The band is two standard deviations. `covered` and `largest_in_bands` are of the time in which `status` is valid; 1 and 0 if
    it never is. `nees` is the mean of the squared error over the variance at all times, 1 for a consistent estimate.
    """
    error = np.abs(fused - true)
    bands = error / (2.0 * uncertainty)
    valid = status == 0
    return {
        "covered": float(np.mean(bands[valid] <= 1.0)) if valid.any() else 1.0,
        "covered_always": float(np.mean(bands <= 1.0)),
        "largest_in_bands": float(bands[valid].max(initial=0.0)),
        "largest_valid": float(error[valid].max(initial=0.0)),
        "largest": float(error.max()),
        "uncertainty_median": float(np.median(uncertainty)),
        "uncertainty_largest": float(uncertainty.max()),
        "nees": float(np.mean((error / uncertainty) ** 2)),
        "valid_part": float(valid.mean()),
    }


consistency.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(("covered", "covered_always", "largest_in_bands", "nees", "valid_part"), ""),
    **dict.fromkeys(("largest_valid", "largest", "uncertainty_median", "uncertainty_largest"), "m"),
}
distances.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(
        ("difference", "difference_out", "difference_back", "way", "against_better", "rms_against_better"), "m"
    ),
    **{f"{name}_{kind}": "m" for name in ("hall", "shift", "fused") for kind in ("error", "rms")},
    "against_worse": "",
    "rms_against_worse": "",
}
distances.row_interval, distances.first_row = STEP, 0.0  # type: ignore[attr-defined]
