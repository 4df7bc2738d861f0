"""The search: nonlinear least squares from many starts, in a box whose sides are the unknowns' bounds.

`scipy.optimize.least_squares` (trust region reflective); the Jacobian by differences of simulations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from twin.arrays import Array
from twin.errors import SimulationError, TwinError
from twin.identify.problem import Problem

Progress = Callable[[str, float, str], object]  # what is done, part of it that is done, how good the best is

COARSE, FINE = 1e-2, 1e-3  # of a difference, as part of the range: first over what is rough, then to the point
TOLERANCE = 1e-8  # relative change of cost and of positions at which a search ends
ALIKE = 0.02  # relative difference up to which directional derivatives are believed
ITERATIONS = 60  # of a search at most
SCREENED = 4  # positions that are looked at for each start: the best of them are started from
FAILED = 1e3  # residual of a simulation that fails, in standard deviations of the measurement
REWEIGHTED = 6  # times that the noise is estimated anew at most
SETTLED = 1e-2  # relative change of the estimated noise at which it is known
GAUSS = 1.4826  # standard deviation by the median of absolute values
REACHED = 1.01  # cost by the best cost up to which a start has found the same


class Predictor(Protocol):
    """A model at any values of the unknowns of its problem."""

    problem: Problem
    refused: str  # why directional derivatives are not used, where members have them
    compared: bool  # directional derivatives, with differences
    used: bool  # directional derivatives

    @property
    def count(self) -> int:
        """Simulations so far."""

    @property
    def derivatives(self) -> str:
        """What the Jacobian of a search is made of, in words."""

    def predicted(self, positions: Array) -> list[Array]:
        """Predict the measurements of each output; SimulationError if a simulation fails or is not finite."""

    def slopes(self, positions: Array) -> dict[int, list[Array]] | None:
        """Derivatives of each output by each unknown, by directional derivatives; None if there are none."""


@dataclass(frozen=True)
class Start:
    """A search: where it began and ended, and its cost there."""

    begin: Array
    end: Array
    cost: float


@dataclass
class Fit:
    """The best place: 0 at an unknown's lower bound to 1 at its upper one. `sigmas`: noise of each output."""

    positions: Array
    sigmas: list[float]
    starts: list[Start] = field(default_factory=list)
    simulations: int = 0
    seconds: float = 0.0
    interrupted: bool = False
    failures: int = 0
    derivatives: str = "differences"  # what the Jacobian is made of

    @property
    def agreeing(self) -> int:
        """Number of starts that reached the best cost."""
        best = min((start.cost for start in self.starts), default=0.0)
        return sum(start.cost <= best * REACHED for start in self.starts)


class Residuals:
    """Differences of model and measurement by their noise, as functions of the positions."""

    def __init__(self, model: Predictor, sigmas: Sequence[float], measured: Sequence[Array] | None = None) -> None:
        self.model, self.sigmas = model, list(sigmas)
        self.measured = [output.values for output in model.problem.outputs] if measured is None else list(measured)
        self.best: tuple[float, Array] | None = None
        self.failures: list[str] = []
        self.on_evaluation: Callable[[], object] = lambda: None

    def predicted(self, positions: Array) -> list[Array] | None:
        """Predict the measurements of the outputs; None if the simulation fails."""
        try:
            return self.model.predicted(positions)
        except SimulationError as error:
            self.failures.append(str(error))
            return None

    def weighted(self, predicted: list[Array] | None) -> Array:
        """Residuals of a prediction, one after the other."""
        parts = []
        for i, measured in enumerate(self.measured):
            weight = self.model.problem.outputs[i].weight
            own = FAILED if predicted is None else (predicted[i] - measured) / self.sigmas[i]
            parts.append(np.full(len(measured), FAILED) if predicted is None else weight * np.asarray(own))
        return np.concatenate(parts)

    def __call__(self, positions: Array) -> Array:
        """Return the residuals at a position."""
        residuals = self.weighted(self.predicted(positions))
        cost = self.cost(residuals)
        if self.best is None or cost < self.best[0]:
            self.best = cost, np.array(positions)
        self.on_evaluation()
        return residuals

    def cost(self, residuals: Array) -> float:
        """Half of the sum of what each residual costs."""
        squares = residuals**2
        rho = {
            "linear": squares,
            "soft_l1": 2 * (np.sqrt(1 + squares) - 1),
            "huber": np.where(squares <= 1, squares, 2 * np.sqrt(squares) - 1),
            "cauchy": np.log1p(squares),
            "arctan": np.arctan(squares),
        }[self.model.problem.keys.loss]
        return 0.5 * float(np.sum(rho))

    def jacobian(
        self, positions: Array, steps: Array | float = FINE, central: bool = False, of: Sequence[int] | None = None
    ) -> Array:
        """Derivatives of the residuals by the positions, by differences that stay between the bounds."""
        wanted = range(len(positions)) if of is None else of
        analytic = {} if central else self.analytic_columns(positions)
        base = None if analytic.keys() >= set(wanted) else self.predicted(positions)
        columns = []
        wide = np.broadcast_to(steps, positions.shape)
        for i in wanted:
            if i in analytic:
                columns.append(analytic[i])
                continue
            step = wide[i]
            both = [min(positions[i] + step, 1.0), max(positions[i] - step, 0.0)]
            if not central:
                both = [both[0], positions[i]] if positions[i] + step <= 1 else [positions[i], both[1]]
            ends = []
            for position in both:
                moved = np.array(positions)
                moved[i] = position
                ends.append((position, base if position == positions[i] else self.predicted(moved)))
            there = [(position, cost) for position, cost in [*ends, (positions[i], base)] if cost is not None]
            first, second = there[0], there[1] if len(there) > 1 else there[0]
            width = first[0] - second[0]
            difference = self.weighted(first[1]) - self.weighted(second[1])
            columns.append(difference / width if width else np.zeros_like(difference))
            self.on_evaluation()
        return np.stack(columns, 1)

    def analytic_columns(self, positions: Array) -> dict[int, Array]:
        """Columns of the Jacobian by the members' directional derivatives, as far as they tell them.

        The first time they are compared with differences: a member may tell what is not so, and its start may depend on
        what is looked for. Then the model's `refused` says so, and differences are used.
        """
        if (slopes := self.model.slopes(positions)) is None:
            return {}
        problem = self.model.problem
        columns = {}
        for number, parts in slopes.items():
            scaled = [
                output.weight * part / sigma
                for output, part, sigma in zip(problem.outputs, parts, self.sigmas, strict=True)
            ]
            columns[number] = np.concatenate(scaled) * problem.unknowns[number].slope(float(positions[number]))
        if not self.model.compared:
            self.model.compared = True
            numbers = sorted(columns)
            differences = self.jacobian(positions, FINE, central=True, of=numbers)
            for number, column in zip(numbers, differences.T, strict=True):
                off = float(np.linalg.norm(columns[number] - column))
                if off > ALIKE * float(np.linalg.norm(column)):
                    self.model.refused = (
                        f"directional derivatives by {problem.unknowns[number].name} are not what differences say"
                    )
                    return {}
        self.model.used = True
        return columns

    def search(
        self, begin: Array, free: Sequence[int] | None = None, iterations: int = ITERATIONS, step: float = FINE
    ) -> tuple[Array, float]:
        """Search from a position; return its end and the cost there. `free`: unknowns that may change, all by default."""
        from scipy.optimize import least_squares

        own = list(range(len(begin)) if free is None else free)

        def full_vector(part: Array) -> Array:
            position = np.array(begin)
            position[own] = part
            return position

        if not own:
            return begin, self.cost(self(begin))
        inside = np.clip(begin[own], 1e-6, 1 - 1e-6)  # the method begins inside of the bounds
        result = least_squares(
            lambda part: self(full_vector(part)),
            inside,
            lambda part: self.jacobian(full_vector(part), step, of=own),
            bounds=(0.0, 1.0),
            loss=self.model.problem.keys.loss,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=iterations,
        )
        return full_vector(result.x), float(result.cost)


def first_sigmas(model: Predictor) -> list[float]:
    """Noise of each output: as given, or the spread of what was measured, until residuals are known."""
    return [output.noise or float(np.std(output.values)) or 1.0 for output in model.problem.outputs]


def estimated(residuals: Residuals, position: Array) -> list[float]:
    """Noise of each output from its residuals, where it is not given."""
    predicted = residuals.predicted(position)
    if predicted is None:
        return residuals.sigmas
    sigmas = []
    problem = residuals.model.problem
    for output, computed, before in zip(problem.outputs, predicted, residuals.sigmas, strict=True):
        difference = computed - output.values
        share = 1 - len(problem.unknowns) / max(problem.count, len(problem.unknowns) + 1)
        spread = float(np.sqrt(np.mean(difference**2) / share))
        if problem.keys.loss != "linear":
            spread = GAUSS * float(np.median(np.abs(difference)))
        sigmas.append(output.noise or spread or before)
    return sigmas


def multistart_search(model: Predictor, count: int, seed: int, progress: Progress) -> Fit:
    """The best place of `count` searches; the first begins at the model's own values, the others somewhere."""
    residuals = Residuals(model, first_sigmas(model))
    fit = Fit(model.problem.positions(), residuals.sigmas)

    def report(what: str, part: float) -> None:
        best = residuals.best
        detail = (
            "" if best is None else f"residual {np.sqrt(2 * best[0] / model.problem.count):.4g} of the noise or spread"
        )
        residuals.on_evaluation = lambda: progress(what, part, detail)
        residuals.on_evaluation()

    try:
        for number, start in enumerate(initial_points(residuals, count, seed, report)):
            report(f"start {number + 1} of {count}", number / count)
            end, cost = residuals.search(start, step=COARSE)
            fit.starts.append(Start(start, end, cost))
        report("best start", 1.0)
        fit.positions = residuals.search(best_of(residuals, fit))[0]
        fit.sigmas = settle(residuals, fit, report)
    except KeyboardInterrupt:
        fit.interrupted = True
        if residuals.best is not None:
            fit.positions = residuals.best[1]
        elif not fit.starts:
            raise
        fit.sigmas = estimated(residuals, fit.positions)
    fit.failures = len(residuals.failures)
    fit.simulations, fit.derivatives = model.count, model.derivatives
    return fit


def initial_points(residuals: Residuals, count: int, seed: int, report: Callable[[str, float], None]) -> list[Array]:
    """Choose the initial points of the searches: the best of a Latin hypercube. TwinError if the model runs nowhere."""
    from scipy.stats import qmc

    first = residuals.model.problem.positions()
    report("first guess", 0.0)
    residuals(first)
    if count == 1 and not residuals.failures:
        return [first]
    sampler = qmc.LatinHypercube(len(first), seed=np.random.default_rng(seed))
    looked: list[tuple[float, int, Array]] = []
    for position in sampler.random(SCREENED * max(count - 1, 1)):
        report("looking for starts", 0.0)
        looked.append((residuals.cost(residuals(position)), len(looked), position))
    there = [
        position
        for cost, _, position in sorted(looked, key=lambda item: item[:2])
        if cost < residuals.cost(failed(residuals))
    ]
    if residuals.cost(residuals(first)) < residuals.cost(failed(residuals)):
        there = [first, *there]
    if not there:
        raise TwinError(f"the model fails wherever it was tried: {residuals.failures[0]}")
    return there[:count]


def failed(residuals: Residuals) -> Array:
    """Residuals of a simulation that fails."""
    return residuals.weighted(None)


def best_of(residuals: Residuals, fit: Fit) -> Array:
    """The end of the best search, or what was better on the way."""
    assert residuals.best is not None
    best = min(fit.starts, key=lambda start: start.cost)
    return best.end if best.cost <= residuals.best[0] else residuals.best[1]


def settle(residuals: Residuals, fit: Fit, report: Callable[[str, float], None]) -> list[float]:
    """Estimate the noise and search on from the best, until both stay; what was best may change with the noise."""
    problem = residuals.model.problem
    sigmas = estimated(residuals, fit.positions)
    for _ in range(REWEIGHTED):
        change = max(abs(new / old - 1) for new, old in zip(sigmas, residuals.sigmas, strict=True))
        if change < SETTLED:
            break
        alike = len(problem.outputs) == 1 and problem.keys.loss == "linear"
        residuals.sigmas, residuals.best = sigmas, None
        report("noise", 1.0)
        with suppress(SimulationError):
            residuals(fit.positions)
        if alike:
            break
        fit.positions = residuals.search(fit.positions)[0]
        sigmas = estimated(residuals, fit.positions)
    return sigmas
