"""Identification of the Prandtl-Ishlinskii weights from sampled gripper and tip positions, by bounded least squares.

The model is linear in its weights, so there is one minimum and no start is needed. Kuhnen, European Journal of Control
9(4), 2003, recalled. The weight of threshold zero comes out near zero where the tip stands still after a reversal: the
fitted model then has no inverse, and the compensator raises it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from fmus.prandtl_ishlinskii_compensator.model import THRESHOLDS
from scipy.optimize import lsq_linear

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True)
class Fit:
    """Result of an identification. `offset` [m]: of the tip's frame; `residual` [m]: root mean square."""

    weights: tuple[float, ...]
    offset: float
    residual: float


def plays(x_in: NDArray[np.float64], thresholds: ArrayLike = THRESHOLDS) -> NDArray[np.float64]:
    """What each play operator makes of x_in [m], one column each, from a relaxed instrument."""
    half = np.asarray(thresholds, float)
    memory = np.full(half.size, x_in[0])
    rows = np.empty((x_in.size, half.size))
    for row, x in zip(rows, x_in, strict=True):
        memory = np.clip(memory, x - half, x + half)
        row[:] = memory
    return rows


def simulate(weights: ArrayLike, x_in: NDArray[np.float64], thresholds: ArrayLike = THRESHOLDS) -> NDArray[np.float64]:
    """Tip position x_out [m] over samples of the gripper position x_in [m], from a relaxed instrument."""
    response: NDArray[np.float64] = plays(x_in, thresholds) @ np.asarray(weights, float)
    return response


def identify(x_in: NDArray[np.float64], x_out: NDArray[np.float64], thresholds: ArrayLike = THRESHOLDS) -> Fit:
    """Fit weights, none negative, and an offset of the tip's frame to samples [m] that begin with the instrument relaxed."""
    columns = np.column_stack((plays(x_in, thresholds), np.ones_like(x_in)))
    lower = np.zeros(columns.shape[1])
    lower[-1] = -np.inf
    solution = lsq_linear(columns, x_out, (lower, np.inf), method="bvls")
    weights = tuple(map(float, solution.x[:-1]))
    return Fit(weights, float(solution.x[-1]), float(np.sqrt(2.0 * solution.cost / x_out.size)))


def analysis(x_in: NDArray[np.float64], x_out: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """The identification for a scenario: slope after a reversal, slope at last, half width of the loop, and the fit."""
    fit = identify(x_in, x_out)
    named = {f"weight_{number}": weight for number, weight in enumerate(fit.weights, 1)}
    return {
        **named,
        "slope": sum(fit.weights),
        "half_width": float(np.dot(fit.weights, THRESHOLDS)) / sum(fit.weights),
        "residual": fit.residual,
        "offset": fit.offset,
        "x_model": simulate(fit.weights, x_in) + fit.offset,
    }


analysis.outputs = {  # type: ignore[attr-defined]
    **{f"weight_{number}": "" for number in range(1, len(THRESHOLDS) + 1)},
    "slope": "",
    "half_width": "m",
    "residual": "m",
    "offset": "m",
    "x_model": "m",
}
