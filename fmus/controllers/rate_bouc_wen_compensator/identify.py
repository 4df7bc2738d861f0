"""Identification of the Bouc-Wen constants and a lag from sampled gripper and tip positions, by least squares.

The model of `bouc_wen_compensator.identify`, whose output a first-order lag follows. The same flat valley: judge a fit by
its residual and by the tracking it gives. The residual cannot fall below the tracker's noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

import numpy as np
from fmus.bouc_wen import MILLIMETER
from fmus.bouc_wen_compensator.identify import LOWER, SCALE, UPPER, Constants, hysteresis, search
from scipy.signal import lfilter

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

SAMPLE = 25e-3  # time from sample to sample of the tracker [s]
LONGEST_LAG = 0.1  # [s], four samples; what is slower is no lag of an instrument
FIRST_LAG = 5e-3  # [s], where the search begins

# from the drive's target to the tip, identified with seed 1 of scenarios/hysteresis_models.yaml
WITH_DRIVE = Constants(1.081, 1.186, 0.003424, 0.01273, 6.0)
LAG_WITH_DRIVE = 28.3e-3  # [s]

#                            alpha_x alpha  beta   delta  gamma  offset [mm]  lag [s]
FROM, TO, SIZE = np.append(LOWER, 0.0), np.append(UPPER, LONGEST_LAG), np.append(SCALE, 0.01)


@dataclass(frozen=True, slots=True)
class Fit:
    """Result of an identification. `lag` [s]; `offset` [m]: of the tip's frame; `residual` [m]: root mean square."""

    constants: Constants
    lag: float
    offset: float
    residual: float


def lagged(x: NDArray[np.float64], lag: float, sample: float = SAMPLE) -> NDArray[np.float64]:
    """First-order lag [s] of samples that lie on straight lines, from rest at the first; along the first axis."""
    if lag < 1e-6 * sample:
        return x
    decay = exp(-sample / lag)
    mean = (1.0 - decay) * lag / sample
    new, last = 1.0 - mean, mean - decay
    start = np.atleast_1d(x[0])[None] - new * np.atleast_1d(x[0])[None]
    response, _ = lfilter([new, last], [1.0, -decay], x, axis=0, zi=start.reshape(1, *x.shape[1:]))
    filtered: NDArray[np.float64] = response
    return filtered


def simulate(
    constants: Iterable[float], lag: float, x_in: NDArray[np.float64], sample: float = SAMPLE
) -> NDArray[np.float64]:
    """Tip position x_out [m] over samples of the gripper position x_in [m], from h = 0."""
    c = Constants(*constants)
    h, _ = hysteresis(c, x_in / MILLIMETER)
    return lagged(c.alpha_x * x_in - MILLIMETER * h, lag, sample)


def identify(x_in: NDArray[np.float64], x_out: NDArray[np.float64], sample: float = SAMPLE) -> Fit:
    """Fit constants, lag and an offset of the tip's frame to samples [m] that begin with the instrument relaxed."""
    gripper, tip = x_in / MILLIMETER, x_out / MILLIMETER
    step = 1e-3 * FIRST_LAG  # of the derivative by the lag

    def model(p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        h, slopes = hysteresis(Constants(*p[:5]), gripper)
        followed = p[0] * gripper - h
        answer = lagged(followed, p[6], sample)
        by_constants = lagged(np.column_stack((gripper, -slopes)), p[6], sample)
        by_lag = (lagged(followed, p[6] + step, sample) - answer) / step
        return answer + p[5] - tip, np.column_stack((by_constants, np.ones_like(gripper), by_lag))

    best = search(model, (0.0, FIRST_LAG), FROM, TO, SIZE)
    residual = float(np.sqrt(2.0 * best.cost / tip.size))
    return Fit(
        Constants(*map(float, best.x[:5])), float(best.x[6]), MILLIMETER * float(best.x[5]), MILLIMETER * residual
    )


def analysis(x_in: NDArray[np.float64], x_out: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """The identification for a scenario that records every 25 ms: constants, lag, residual, and the fitted model's answer."""
    fit = identify(x_in, x_out)
    model = simulate(fit.constants, fit.lag, x_in) + fit.offset
    return {**fit.constants._asdict(), "lag": fit.lag, "residual": fit.residual, "offset": fit.offset, "x_model": model}


def from_target(target: NDArray[np.float64], x_out: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """The same from the drive's target, recorded as it is, to the tip, published a sample late: the lag holds the drive's."""
    fit = identify(target[:-1], x_out[1:])
    return {**fit.constants._asdict(), "lag": fit.lag, "residual": fit.residual, "offset": fit.offset}


analysis.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(Constants._fields, ""),
    "lag": "s",
    "residual": "m",
    "offset": "m",
    "x_model": "m",
}
from_target.outputs = {  # type: ignore[attr-defined]
    name: unit
    for name, unit in analysis.outputs.items()
    if name != "x_model"  # type: ignore[attr-defined]
}
analysis.row_interval = from_target.row_interval = SAMPLE  # type: ignore[attr-defined]
