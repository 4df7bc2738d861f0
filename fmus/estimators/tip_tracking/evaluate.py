"""Comparison of the tracked tip with the electromagnetic tracker, as Fig. 6D of Al-Ahmad et al. (RACS), section IV.C."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Signal = NDArray[np.float64]

STEP = 1e-3  # between recorded rows [s]
EM_LATENCY = 25e-3  # of a published sample of em_tracker [s]
REST = 0.9  # beginning, before anything moves, that both displacements count from [s]: 36 samples of the EM tracker


def published(values: Signal) -> NDArray[np.intp]:
    """Rows at which something new stands there."""
    changed = np.any(np.diff(np.atleast_2d(values.T)) != 0.0, axis=0)
    return np.flatnonzero(changed) + 1


def along(positions: Signal, towards: Signal) -> Signal:
    """Displacements [m] along the line fitted through positions (samples, 3), with the sense of other displacements."""
    centered = positions - positions.mean(axis=0)
    line = np.linalg.svd(centered, full_matrices=False)[2][0]
    displacement: Signal = centered @ line
    return displacement if displacement @ (towards - towards.mean()) >= 0.0 else -displacement


def against_em(
    em: Signal, x: Signal, y: Signal, z: Signal, age: Signal, status: Signal
) -> dict[str, float | NDArray[np.float64]]:
    """One-dimensional motion of the tip by fiber and by EM tracker, at the instants of the EM samples.

    Both are late, by different times: each sample is put where it was taken. The paper's line is fitted through the EM's
    three coordinates; here the EM tracker measures along it already, and the line is fitted through the fiber's.
    """
    rows = published(em)
    instants = rows * STEP - EM_LATENCY
    taken = published(np.column_stack((x, y, z)))
    taken = taken[status[taken] < 2]
    when = taken * STEP - age[taken]
    positions = np.column_stack((x, y, z))[taken]
    interpolated = np.column_stack([np.interp(instants, when, positions[:, c]) for c in range(3)])
    inside = (instants >= when[0]) & (instants <= when[-1])
    rows, instants, interpolated = rows[inside], instants[inside], interpolated[inside]
    measured = em[rows]
    moved = along(interpolated, measured)
    rest = instants <= max(REST, instants[0])
    moved = moved - moved[rest].mean()
    measured = measured - measured[rest].mean()
    results = {}
    for name, values in (("fiber", moved), ("em", measured), ("error", moved - measured)):
        signal = np.full(len(em), np.nan)
        signal[rows] = values
        results[name] = signal
    error = (moved - measured)[~rest]
    return {
        **results,
        "error_mean": float(error.mean()),
        "error_std": float(error.std()),
        "error_max": float(np.abs(error).max()),
        "error_rms": float(np.sqrt(np.mean(error**2))),
        "em_range": float(np.ptp(measured)),
    }


against_em.outputs = dict.fromkeys(  # type: ignore[attr-defined]
    ("fiber", "em", "error", "error_mean", "error_std", "error_max", "error_rms", "em_range"), "m"
)
against_em.row_interval, against_em.first_row = STEP, 0.0  # type: ignore[attr-defined]
