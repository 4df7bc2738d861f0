"""How well the unknowns are known: covariance, intervals in three ways, and which of them the data cannot tell.

Covariance by the Jacobian at the best place. With a robust loss it is that of an M-estimator (Huber, Robust Statistics,
1981, section 7.6): mean of psi^2 by the square of the mean of psi'. Residuals that follow each other count less: the
variance grows by (1 + r) / (1 - r), r their correlation with the next one (first-order autoregression).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from twin.identify.search import COARSE, FINE, Fit, Predictor, Residuals

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.arrays import Array

    ReportProgress = Callable[[str, float], object]

METHODS = ("jacobian", "profile", "bootstrap")
TOGETHER = 0.95  # correlation beyond which a variance is over ten times what it is with the other unknown known
SHARE = 0.3  # part of a direction from which an unknown belongs to it
WIDEST = 0.5  # standard deviation of a combination, as part of the range, from which the data do not tell it
NOTHING = 1e-7  # change of the residuals by an unknown, as part of that by the strongest one, that is none
CLOSE = 0.02  # relative error of a profile's end
TRIES = 12  # simulations of a profile's side at most, each with a search
BETWEEN = (1 / 3, 2 / 3)  # places of a profile between the best and its end
RESAMPLED = 100  # bootstrap samples
FINEST = 1e-4  # difference for the covariance, as part of the range
ROUGH = 1.5  # times that a small difference makes more of the residuals than a wide one, from which a model is rough


@dataclass(frozen=True)
class ProfileLikelihood:
    """Places of an unknown, and the cost above the best when all others are searched anew, as multiples of the limit."""

    positions: Array
    above: Array


@dataclass
class ParameterUncertainty:
    """What is known about the unknowns, all in places; `low` and `high` end their intervals, NaN where they are open."""

    method: str
    covariance: Array
    low: Array
    high: Array
    singular: Array  # standard deviations of independent combinations, as parts of the ranges, the best known first
    directions: Array  # rows: those combinations
    effect: Array  # whether an unknown changes anything that is compared
    rough: Array  # whether the model answers small changes of it more than wide ones
    inflation: float = 1.0  # of the variance, by correlation of residuals
    residual: float = 1.0  # their standard deviation by the noise that was assumed
    growth: Array = field(default_factory=lambda: np.ones(0))  # variance of each unknown by that of the cost alone
    profiles: dict[int, ProfileLikelihood] = field(default_factory=dict)
    samples: Array | None = None

    @property
    def deviations(self) -> Array:
        """Standard deviation of each unknown."""
        standard_deviations: Array = np.sqrt(np.diag(self.covariance))
        return standard_deviations

    @property
    def correlation(self) -> Array:
        """Correlation of the unknowns; those without effect have none."""
        scale = np.where(self.deviations > 0, self.deviations, 1.0)
        matrix = self.covariance / np.outer(scale, scale)
        np.fill_diagonal(matrix, 1.0)
        clipped: Array = np.clip(matrix, -1.0, 1.0)
        return clipped


def psi(residuals: Array, loss: str) -> tuple[Array, Array]:
    """Influence of each residual, and its derivative: of the loss rho(r^2) / 2."""
    r = residuals
    s = r * r
    small = s <= 1
    return {
        "linear": (r, np.ones_like(r)),
        "soft_l1": (r / np.sqrt(1 + s), (1 + s) ** -1.5),
        "huber": (np.where(small, r, np.sign(r)), small.astype(float)),
        "cauchy": (r / (1 + s), (1 - s) / (1 + s) ** 2),
        "arctan": (r / (1 + s**2), (1 - 3 * s**2) / (1 + s**2) ** 2),
    }[loss]


def inflation(residuals: Residuals, values: Array) -> float:
    """By how much correlation of successive residuals makes the variance larger."""
    factors, first = [], 0
    for measured in residuals.measured:
        part = values[first : first + len(measured)]
        first += len(measured)
        part = part - np.mean(part)
        power = float(np.sum(part**2))
        r = float(np.sum(part[1:] * part[:-1])) / power if power else 0.0
        r = min(r, 0.999) if r > 2 / np.sqrt(len(part)) else 0.0  # less than that is chance
        factors.append(((1 + r) / (1 - r), len(part)))
    return sum(factor * count for factor, count in factors) / sum(count for _, count in factors)


def estimate_uncertainty(
    model: Predictor, fit: Fit, method: str, seed: int, report: ReportProgress
) -> ParameterUncertainty:
    """Covariance and intervals at the best place."""
    residuals = Residuals(model, fit.sigmas)
    residuals.on_evaluation = lambda: report("covariance", 0.0)
    by_jacobian = covariance(residuals, fit.positions)
    if method == "profile":
        add_profiles(residuals, fit.positions, by_jacobian, report)
    elif method == "bootstrap":
        add_bootstrap(residuals, fit.positions, by_jacobian, seed, report)
    return by_jacobian


def quantile(residuals: Residuals) -> float:
    """Half-width of an interval by the standard deviation (Student's t)."""
    from scipy.stats import t

    problem = residuals.model.problem
    freedom = max(problem.count - len(problem.unknowns), 1)
    return float(t.ppf(0.5 + problem.keys.confidence / 2, freedom))


def covariance(residuals: Residuals, position: Array) -> ParameterUncertainty:
    """Covariance by the Jacobian, with differences about as wide as the standard deviations."""
    problem = residuals.model.problem
    values = residuals(position)
    freedom = max(problem.count - len(position), 1)
    influence, slope = psi(values, problem.keys.loss)
    weights = np.concatenate([np.full(len(output.values), output.weight) for output in problem.outputs])
    noise = influence / weights  # a weight changes the estimate, not the noise of the measurement
    variance = float(np.mean(noise**2)) / max(float(np.mean(slope)), 1e-3) ** 2 * problem.count / freedom
    wider = inflation(residuals, values)
    given = all(output.noise for output in problem.outputs)
    factor = wider * (max(variance, 1.0) if given else variance)
    jacobian = residuals.jacobian(position, COARSE, central=True)
    matrix, *_ = inverse(jacobian, factor, weights)
    steps = np.clip(0.3 * np.sqrt(np.diag(matrix)), FINEST, COARSE)
    finer = residuals.jacobian(position, steps, central=True)
    rough = np.linalg.norm(finer, axis=0) > ROUGH * np.linalg.norm(jacobian, axis=0)
    matrix, own, singular, directions, growth = inverse(np.where(rough, jacobian, finer), factor, weights)
    effect = np.isin(np.arange(len(position)), own)
    deviations = np.sqrt(np.diag(matrix))
    spread = np.zeros((len(singular), len(position)))
    spread[:, own] = directions
    width = quantile(residuals) * deviations
    low, high = position - width, position + width
    low[~effect], high[~effect] = np.nan, np.nan
    return ParameterUncertainty(
        "jacobian",
        matrix,
        low,
        high,
        singular,
        spread,
        effect,
        rough & effect,
        wider,
        float(np.sqrt(variance)),
        growth,
    )


def inverse(jacobian: Array, factor: float, weights: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Covariance; the unknowns that have an effect; standard deviations of combinations of these, and their directions.

    Last, the variance of each unknown divided by its entry of (J' J)^-1. `jacobian` J and residuals are multiplied by
    `weights` W, the noise is not: covariance = factor (J' J)^-1 J' W^2 J (J' J)^-1, with the variance `factor` of the
    residuals without weights (sandwich estimator; White, Econometrica 48(4), 1980).
    """
    norms = np.linalg.norm(jacobian, axis=0)
    own = np.flatnonzero(norms > NOTHING * max(float(np.max(norms)), 1e-300))
    rows, s, directions = np.linalg.svd(jacobian[:, own], full_matrices=False)
    s = np.maximum(s, 1e-12 * max(float(s[0]) if len(s) else 0.0, 1e-300))
    matrix = np.zeros((len(norms), len(norms)))
    weighted = weights[:, None] * rows
    middle = factor * weighted.T @ weighted
    matrix[np.ix_(own, own)] = (directions.T / s) @ middle @ (directions.T / s).T
    growth = np.ones(len(norms))
    growth[own] = np.diag(matrix)[own] / np.sum((directions.T / s) ** 2, axis=1)
    return matrix, own, np.sqrt(np.diag(middle)) / s, directions, growth


def add_profiles(residuals: Residuals, optimum: Array, knowledge: ParameterUncertainty, report: ReportProgress) -> None:
    """Ends of the intervals where the cost, searched over all others, has risen to its limit."""
    count = len(optimum)
    heights = 0.5 * knowledge.growth * quantile(residuals) ** 2  # cost above the best at the ends of the intervals
    least = residuals.cost(residuals(optimum))
    for i in range(count):
        if not knowledge.effect[i]:
            continue
        points, height = {float(optimum[i]): 0.0}, float(heights[i])
        for side in (-1, 1):
            residuals.on_evaluation = lambda i=i, side=side: report(  # type: ignore[misc]
                f"profile of {residuals.model.problem.unknowns[i].name}", (2 * i + (side > 0)) / (2 * count)
            )
            end = profile_end(residuals, optimum, i, side, knowledge, least, height, points)
            (knowledge.low if side < 0 else knowledge.high)[i] = end
            last = (0.0 if side < 0 else 1.0) if np.isnan(end) else end
            for share in BETWEEN:  # for the picture
                position = float(optimum[i] + share * (last - optimum[i]))
                points[position] = (
                    max(profile_point(residuals, optimum, knowledge, i, position)[1] - least, 0.0) / height
                )
        ordered = sorted(points.items())
        knowledge.profiles[i] = ProfileLikelihood(*(np.array(column) for column in zip(*ordered, strict=True)))
    knowledge.method = "profile"


def profile_point(
    residuals: Residuals, warm: Array, knowledge: ParameterUncertainty, i: int, position: float
) -> tuple[Array, float]:
    """The best place with one unknown held somewhere, and its cost; the others begin along the ridge from `warm`."""
    others = [k for k in range(len(warm)) if k != i]
    begin = np.array(warm)
    variance = float(knowledge.covariance[i, i])
    if variance:
        begin[others] += knowledge.covariance[others, i] / variance * (position - warm[i])
    begin[i] = position
    return residuals.search(np.clip(begin, 0.0, 1.0), others, 12)


def profile_end(
    residuals: Residuals,
    optimum: Array,
    i: int,
    side: int,
    knowledge: ParameterUncertainty,
    least: float,
    height: float,
    points: dict[float, float],
) -> float:
    """Where a profile crosses its limit on one side; NaN if it does not up to the bound. Adds to `points`."""
    bound = 0.0 if side < 0 else 1.0
    distance = min(max(quantile(residuals) * float(knowledge.deviations[i]), 2 * FINE), 0.25)
    inside, outside = (float(optimum[i]), 0.0), None
    warm = np.array(optimum)
    for _ in range(TRIES):
        position = min(max(optimum[i] + side * distance, 0.0), 1.0)
        end, cost = profile_point(residuals, warm, knowledge, i, float(position))
        above = max(cost - least, 0.0) / height
        points[float(position)] = above
        if abs(above - 1) < CLOSE:
            return float(position)
        if above > 1:
            outside = position, above
        else:
            inside, warm = (float(position), above), end
            if position == bound:
                return float("nan")
        if outside is None:
            distance *= 2 if above < 0.1 else 1.2 / np.sqrt(above)
        else:  # roots of the cost are straight, about
            low, high = np.sqrt(inside[1]), np.sqrt(outside[1])
            share = min(max((1 - low) / (high - low), 0.05), 0.95)
            distance = abs(inside[0] + share * (outside[0] - inside[0]) - optimum[i])
    return float(inside[0] if outside is None else (inside[0] + outside[0]) / 2)


def add_bootstrap(
    residuals: Residuals, optimum: Array, knowledge: ParameterUncertainty, seed: int, report: ReportProgress
) -> None:
    """Quantiles of searches with residuals drawn anew, in blocks that keep what follows each other together.

    Moving blocks: Kuensch, Ann. Statist. 17(3), 1989; as long as the correlation makes them.
    """
    generator = np.random.default_rng(seed)
    predicted = residuals.predicted(optimum)
    assert predicted is not None, "the best place was simulated"
    block = max(1, int(np.ceil(2 * knowledge.inflation))) if knowledge.inflation > 1 else 1
    freedom = np.sqrt(residuals.model.problem.count / max(residuals.model.problem.count - len(optimum), 1))
    optima = []
    for number in range(RESAMPLED):
        resampled = []
        for computed, measured in zip(predicted, residuals.measured, strict=True):
            errors = (measured - computed - np.mean(measured - computed)) * freedom
            blocks = -(-len(errors) // block)
            begins = generator.integers(0, max(len(errors) - block, 0) + 1, blocks)
            rows = (begins[:, None] + np.arange(block)).ravel()[: len(errors)]
            resampled.append(computed + errors[rows])
        again = Residuals(residuals.model, residuals.sigmas, resampled)
        again.on_evaluation = lambda number=number: report("bootstrap", number / RESAMPLED)  # type: ignore[misc]
        optima.append(again.search(optimum, list(np.flatnonzero(knowledge.effect)), 12)[0])
    knowledge.samples = np.array(optima)
    tail = (1 - residuals.model.problem.keys.confidence) / 2
    ends = np.quantile(knowledge.samples, [tail, 1 - tail], axis=0)
    knowledge.low, knowledge.high = (np.where(knowledge.effect, end, np.nan) for end in ends)
    knowledge.method = "bootstrap"
