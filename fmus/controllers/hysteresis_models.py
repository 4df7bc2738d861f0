"""What the models of the hysteresis say of the tip, with the constants that the compensators have: for fresh data.

A fit is judged by data that it has not seen. So nothing is fitted here; an offset of the tip's frame is left to the reader.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from fmus.bouc_wen import MILLIMETER
from fmus.bouc_wen_compensator.identify import Constants, hysteresis
from fmus.bouc_wen_compensator.model import BoucWenCompensator
from fmus.prandtl_ishlinskii_compensator import identify as prandtl_ishlinskii
from fmus.prandtl_ishlinskii_compensator.model import PrandtlIshlinskiiCompensator
from fmus.rate_bouc_wen_compensator import identify as rate_bouc_wen
from fmus.rate_bouc_wen_compensator.model import RateBoucWenCompensator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from twin.component import Component


def constants(cls: type[Component]) -> Constants:
    """Constants of eqs. (1) and (2) that a compensator has."""
    return Constants(*(float(getattr(cls, name).start) for name in Constants._fields))


def analysis(gripper: NDArray[np.float64], tip: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """Error of each model along a recording every 25 ms [m], and the least slope dx_out/dx_in of the printed one."""
    printed, rated = constants(BoucWenCompensator), constants(RateBoucWenCompensator)
    plays = PrandtlIshlinskiiCompensator
    answers = {
        "bouc_wen": rate_bouc_wen.simulate(printed, 0.0, gripper),
        "rate_bouc_wen": rate_bouc_wen.simulate(rated, float(RateBoucWenCompensator.lag.start), gripper),
        "prandtl_ishlinskii": prandtl_ishlinskii.simulate(plays.weight.start, gripper, plays.threshold.start),
    }
    return {**{name: answer - tip for name, answer in answers.items()}, "least_slope": least_slope(printed, gripper)}


def from_target(target: NDArray[np.float64], tip: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Errors along a recording every 25 ms [m] of the two Bouc-Wen models driven by the drive's target."""
    answers = {
        "bouc_wen": rate_bouc_wen.simulate(constants(BoucWenCompensator), 0.0, target),
        "with_drive": rate_bouc_wen.simulate(rate_bouc_wen.WITH_DRIVE, rate_bouc_wen.LAG_WITH_DRIVE, target),
    }
    return {name: answer - tip for name, answer in answers.items()}


def least_slope(c: Constants, gripper: NDArray[np.float64]) -> float:
    """Smallest dx_out/dx_in of the printed model; below zero the tip would reverse while the gripper advances."""
    h, _ = hysteresis(c, gripper / MILLIMETER)
    size = np.abs(h[:-1]) ** c.gamma
    agree = np.where((h[:-1] < 0.0) == (np.diff(gripper) < 0.0), 1.0, -1.0)
    moving = np.diff(gripper) != 0.0
    slopes = c.alpha_x - c.alpha + (c.beta * agree + c.delta) * size
    return float(np.min(slopes[moving], initial=c.alpha_x))


analysis.outputs = {  # type: ignore[attr-defined]
    "bouc_wen": "m",
    "rate_bouc_wen": "m",
    "prandtl_ishlinskii": "m",
    "least_slope": "",
}
from_target.outputs = {"bouc_wen": "m", "with_drive": "m"}  # type: ignore[attr-defined]
analysis.row_interval = from_target.row_interval = rate_bouc_wen.SAMPLE  # type: ignore[attr-defined]
