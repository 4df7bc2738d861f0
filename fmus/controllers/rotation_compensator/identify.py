"""Identification of the play between frame and tip from a rotation experiment, by least squares.

A play of half width r: the tip stands while the frame is within r of it. It is the Prandtl-Ishlinskii model with one
operator; `residual` says how much the loops differ from it. Both signals must have been filtered alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from fmus.em_pose.evaluate import RATE, averaged, travelled_angle
from scipy.optimize import minimize_scalar

if TYPE_CHECKING:
    from numpy.typing import NDArray


def simulate(width: float, frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of the tip [rad] behind a play of this width [rad], which begins in its middle."""
    half = 0.5 * width
    output = float(frame[0])
    tip = np.empty_like(frame)
    for index, angle in enumerate(frame.tolist()):
        output = min(max(output, angle - half), angle + half)
        tip[index] = output
    return tip


def identify(frame: NDArray[np.float64], tip: NDArray[np.float64]) -> tuple[float, float, float]:
    """Width [rad] of the play, offset of the tip's zero [rad] and rms residual [rad]; samples unfiltered, turns counted."""

    def remainder(width: float) -> NDArray[np.float64]:
        return np.asarray(tip - averaged(simulate(width, frame)))

    largest = 2.0 * float(np.ptp(frame))
    best = minimize_scalar(
        lambda width: float(np.var(remainder(width))), bounds=(0.0, largest), method="bounded", options={"xatol": 1e-5}
    )
    left = remainder(float(best.x))
    return float(best.x), float(np.mean(left)), float(np.std(left))


def analysis(frame: NDArray[np.float64], angle: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """The identification for a scenario, from the frame's angle and the tracked roll angle of the tip."""
    start = frame - frame[0]
    tip = travelled_angle(angle)
    play, offset, residual = identify(start, tip)
    return {"play": play, "residual": residual, "angle": averaged(simulate(play, start)) + offset}


analysis.outputs = dict.fromkeys(("play", "residual", "angle"), "rad")  # type: ignore[attr-defined]


def gain(
    plain: NDArray[np.float64], compensated: NDArray[np.float64], wanted: NDArray[np.float64]
) -> dict[str, float | NDArray[np.float64]]:
    """What a compensation gains: tracked roll angles of two tips that were to follow the same angle, filtered alike."""
    aligned = averaged(wanted - wanted[0])
    errors = [aligned - travelled_angle(angle) for angle in (plain, compensated)]
    sizes = [float(np.sqrt(np.mean(error**2))) for error in errors]
    return {
        "plain_error": errors[0],
        "compensated_error": errors[1],
        "plain_rms": sizes[0],
        "compensated_rms": sizes[1],
        "factor": sizes[0] / sizes[1],
    }


gain.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(("plain_error", "compensated_error", "plain_rms", "compensated_rms"), "rad"),
    "factor": "",
}
analysis.row_interval = gain.row_interval = 1.0 / RATE  # type: ignore[attr-defined]
