"""Identification of the Bouc-Wen constants from sampled gripper and tip positions, by least squares.

Al-Ahmad et al. (RACS), section IV.B. The valley is flat: tracker noise alone moves gamma between 2 and 5 and beta by a
factor of four at the same residual. Judge a fit by its residual and by the tracking it gives, not by its constants. What the
data determine is the `Shape`: the amplitude at which h saturates and the share of beta, as in the normalized model of
Ikhouane and Rodellar, Systems with Hysteresis, Wiley 2007 (sigma is `share`, n is gamma, rho is alpha over `amplitude`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, log
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from fmus.bouc_wen import MILLIMETER
from scipy.optimize import least_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

LONGEST = 0.15  # longest step of x_in in the integration of h [mm]
TOGETHER = 0.95  # correlation beyond which a variance is over ten times what it is with the other constant known
LARGEST = 50.0  # bound of |h| while the search tries constants that do not saturate [mm]


class Constants(NamedTuple):
    """Constants of eqs. (1) and (2), for positions in mm."""

    alpha_x: float
    alpha: float
    beta: float
    delta: float
    gamma: float


class Shape(NamedTuple):
    """Saturation of h in quantities that data determine: NaN where h does not saturate (beta + delta not positive).

    `amplitude` [mm]: |h| of a long motion, (alpha / (beta + delta))^(1 / gamma). `share`: beta / (beta + delta).
    """

    amplitude: float
    share: float


@dataclass(frozen=True, slots=True)
class Fit:
    """Result of an identification. `offset` [m]: of the tip's frame; `residual` [m]: root mean square.

    `covariance`: of the constants, (5, 5), for residuals without correlation.
    """

    constants: Constants
    covariance: NDArray[np.float64]
    offset: float
    residual: float

    @property
    def standard_errors(self) -> Constants:
        """Standard deviations of the constants."""
        return Constants(*np.sqrt(np.diag(self.covariance)).tolist())

    @property
    def shape(self) -> Shape:
        """Amplitude and share of these constants."""
        return shape(self.constants)

    @property
    def shape_covariance(self) -> NDArray[np.float64]:
        """Covariance of alpha_x, alpha, amplitude, share, gamma, (5, 5), by linearization."""
        slope = shape_slope(self.constants)
        return np.array(slope @ self.covariance @ slope.T)


PAPER = Constants(1.91, 1.57, 0.0132, -0.0055, 2.56)

#                   alpha_x alpha  beta   delta  gamma  offset [mm]
LOWER = np.array((0.2, 0.0, 0.0, -2.0, 0.5, -20.0))
UPPER = np.array((5.0, 5.0, 5.0, 2.0, 6.0, 20.0))
SCALE = np.array((1.0, 1.0, 0.1, 0.1, 1.0, 1.0))

# the paper's, and shapes from round to sharp
STARTS = (
    PAPER,
    Constants(1.2, 1.1, 0.1, 0.0, 1.5),
    Constants(1.0, 0.9, 0.3, -0.05, 1.2),
    Constants(1.0, 0.8, 0.4, 0.2, 1.0),
)


def simulate(constants: Iterable[float], x_in: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tip position x_out [m] over samples of the gripper position x_in [m], from h = 0."""
    c = Constants(*constants)
    h, _ = hysteresis(c, x_in / MILLIMETER)
    return c.alpha_x * x_in - MILLIMETER * h


def shape(c: Constants) -> Shape:
    """What of the saturation data determine."""
    both = c.beta + c.delta
    if not both > 0.0:
        return Shape(float("nan"), float("nan"))
    return Shape((c.alpha / both) ** (1.0 / c.gamma), c.beta / both)


def from_shape(alpha_x: float, alpha: float, saturation: Shape, gamma: float) -> Constants:
    """Constants of eqs. (1) and (2) from a `Shape`: the inverse of `shape`."""
    both = alpha / saturation.amplitude**gamma
    return Constants(alpha_x, alpha, saturation.share * both, (1.0 - saturation.share) * both, gamma)


def shape_slope(c: Constants) -> NDArray[np.float64]:
    """Derivatives of alpha_x, alpha, amplitude, share, gamma by the constants, (5, 5)."""
    amplitude, share = shape(c)
    both = c.beta + c.delta
    slope = np.eye(5)
    by_both = -amplitude / (c.gamma * both)
    slope[2] = (0.0, amplitude / (c.gamma * c.alpha), by_both, by_both, -amplitude * log(c.alpha / both) / c.gamma**2)
    slope[3] = (0.0, 0.0, (1.0 - share) / both, -share / both, 0.0)
    return slope


def correlation(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlation matrix of a covariance; zero where a variance is zero."""
    deviations = np.sqrt(np.diag(covariance))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    return np.array(covariance / np.outer(scale, scale))


def unseparated(fit: Fit) -> list[str]:
    """Pairs of constants that the data cannot separate, one line each: correlation over `TOGETHER`."""
    matrix = correlation(fit.covariance)
    names = Constants._fields
    return [
        f"{names[i]} and {names[k]} cannot be separated: correlation {matrix[i, k]:.3f}. Judge amplitude and share instead."
        for i in range(len(names))
        for k in range(i + 1, len(names))
        if abs(matrix[i, k]) > TOGETHER
    ]


def identify(x_in: NDArray[np.float64], x_out: NDArray[np.float64]) -> Fit:
    """Fit the constants and an offset of the tip's frame to samples [m] that begin with the instrument relaxed."""
    gripper, tip = x_in / MILLIMETER, x_out / MILLIMETER

    def model(p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        h, slopes = hysteresis(Constants(*p[:5]), gripper)
        jacobian = np.column_stack((gripper, -slopes, np.ones_like(gripper)))
        return p[0] * gripper - h + p[5] - tip, jacobian

    best = search(model, (0.0,), LOWER, UPPER, SCALE)
    freedom = max(tip.size - best.x.size, 1)

    # pseudo-inverse, since constants of a start that never saturates cannot be told apart
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * 2.0 * best.cost / freedom
    residual = float(np.sqrt(2.0 * best.cost / tip.size))
    return Fit(
        Constants(*map(float, best.x[:5])), covariance[:5, :5], MILLIMETER * float(best.x[5]), MILLIMETER * residual
    )


def search(
    model: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    more: tuple[float, ...],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    scale: NDArray[np.float64],
) -> Any:
    """Least squares from the two best of `STARTS`, each with `more` values, the first of them the offset.

    `model`: residuals [mm] and their derivatives at constants.
    """
    cache: dict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def evaluated(p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if p.tobytes() not in cache:
            cache.clear()
            cache[p.tobytes()] = model(p)
        return cache[p.tobytes()]

    starts = [np.array((*start, *more)) for start in STARTS]
    for start in starts:
        start[5] = np.clip(-np.mean(evaluated(start)[0]), lower[5], upper[5])
    starts.sort(key=lambda start: float(np.sum(evaluated(start)[0] ** 2)))
    solutions = [
        least_squares(
            lambda p: evaluated(p)[0], start, lambda p: evaluated(p)[1], (lower, upper), x_scale=scale, max_nfev=100
        )
        for start in starts[:2]
    ]
    return min(solutions, key=lambda solution: float(solution.cost))


def analysis(x_in: NDArray[np.float64], x_out: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """Identification as an analysis of a scenario: constants, residual, and the fitted model's response to x_in."""
    fit = identify(x_in, x_out)
    model = simulate(fit.constants, x_in) + fit.offset
    together = correlation(fit.covariance)
    return {
        **fit.constants._asdict(),
        "residual": fit.residual,
        "offset": fit.offset,
        "x_model": model,
        "amplitude": MILLIMETER * fit.shape.amplitude,
        "share": fit.shape.share,
        "beta_gamma_correlation": float(together[2, 4]),
    }


analysis.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(Constants._fields, ""),
    "residual": "m",
    "offset": "m",
    "x_model": "m",
    "amplitude": "m",
    "share": "",
    "beta_gamma_correlation": "",
}


def hysteresis(c: Constants, x_in: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State h [mm] over x_in [mm], and its sensitivities to alpha, beta, delta, gamma; integrated over x_in, not over time."""
    _, alpha, beta, delta, gamma = c
    h = s_alpha = s_beta = s_delta = s_gamma = 0.0
    rows = [(0.0,) * 5]
    path = x_in.tolist()
    for last, now in pairwise(path):
        count = max(1, ceil(abs(now - last) / LONGEST))
        dx = (now - last) / count
        for _ in range(count):
            size = abs(h)
            power = size**gamma
            sign = 1.0 if (h < 0.0) == (dx < 0.0) else -1.0
            saturation = beta * sign + delta

            # derivatives of dh/dx by h and by gamma
            by_h = by_gamma = 0.0
            if size > 1e-9:
                by_h = -saturation * gamma * power / h
                by_gamma = -saturation * power * log(size)
            s_alpha += dx * (1.0 + by_h * s_alpha)
            s_beta += dx * (by_h * s_beta - sign * power)
            s_delta += dx * (by_h * s_delta - power)
            s_gamma += dx * (by_h * s_gamma + by_gamma)
            h += dx * (alpha - saturation * power)
            if abs(h) > LARGEST:
                h = LARGEST if h > 0.0 else -LARGEST
                s_alpha = s_beta = s_delta = s_gamma = 0.0
        rows.append((h, s_alpha, s_beta, s_delta, s_gamma))
    table = np.array(rows)
    return table[:, 0], table[:, 1:]
