"""Following of a recording: states and parameters of a model are estimated from measured signals, point by point."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path
from typing import Any, Self

import numpy as np

from twin.arrays import Array
from twin.errors import SimulationError
from twin.follow.batch import Batch, SavedBatch
from twin.follow.changes import Alarm, ChangeBank
from twin.follow.filters import Ensemble, Extended, SquareRootFilter, Unscented
from twin.follow.forecast import Forecast, Forecaster, PastErrors, widened
from twin.follow.problem import FollowProblem, times_of
from twin.follow.smoother import FixedLagSmoother, SmoothedEstimate
from twin.follow.status import REPRESENTED
from twin.follow.tangents import TangentBatch

CONFIDENCE = 0.95  # of the band of NIS
SQUARE_ROOT = {"unscented": Unscented, "extended": Extended}
UNSEPARATED = 0.95  # correlation of two estimates: the variance is ten times that with the other one known


@dataclass(frozen=True)
class Estimate:
    """Estimate after the measurements at a time [s]; all in the variables' own units.

    `values`, `covariance`: of the estimated variables; `measured`, `predicted`, `innovation`, `expected`: of the measured signals,
    NaN where there was no measurement; `expected` is the standard deviation of the innovation. `band`: in which `nis` lies with a
    probability of 95 % if the filter is consistent. `changes`: probabilities of the names in `Follower.bank`, if changes are looked for;
    `alarm`: a change that was noticed now; `forecast`: one that was made now; `smoothed`: estimate at an earlier time, corrected until now.
    """

    time: float
    values: Array
    covariance: Array
    measured: Array
    predicted: Array
    innovation: Array
    expected: Array
    nis: float
    band: tuple[float, float]
    changes: Array | None = None
    alarm: Alarm | None = None
    forecast: Forecast | None = None
    smoothed: SmoothedEstimate | None = None

    @property
    def deviations(self) -> Array:
        """Standard deviations of the estimated variables."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def is_in_band(self) -> bool:
        """Whether the innovation is as large as the filter expects."""
        return self.band[0] <= self.nis <= self.band[1]


@dataclass(frozen=True)
class SavedFollower:
    """State of a follower at a communication step, for `Follower.restore` of the same follower."""

    filter: SquareRootFilter | Ensemble
    batch: SavedBatch
    bank: ChangeBank | None
    smoother: FixedLagSmoother | None
    tick: int


class Follower:
    """Model of a follow file with its filter: it is advanced to communication steps and corrected by measured values. Use it with `with`."""

    def __init__(self, problem: FollowProblem, build: Path = Path("build")) -> None:
        self.problem = problem
        estimates, method = problem.estimates, problem.keys.method
        mean, deviation, self._low, self._high, self._walk = (
            np.array([getattr(variable, name) for variable in estimates])
            for name in ("start", "deviation", "low", "high", "walk")
        )
        self.filter: SquareRootFilter | Ensemble = (
            Ensemble(mean, deviation, self._low, self._high, method.size, method.seed)
            if method.name == "ensemble"
            else SQUARE_ROOT[method.name](mean, deviation, self._low, self._high)
        )
        self.smoother, self._past = self._new_smoother(), np.zeros((self.filter.count, len(mean)))
        self._noise = np.array([output.noise or 0.0 for output in problem.outputs])
        self._bands = [nis_band(count) for count in range(len(problem.outputs) + 1)]
        self._step, self._begin = problem.step, problem.begin
        self.tick = 0
        self.bank = ChangeBank(problem.changes, self.filter, len(problem.outputs)) if problem.changes else None
        parameters, models = (self.bank.parameters, self.bank.count) if self.bank else ((), 0)
        interval = problem.longest_interval if self.filter.shares_memory else inf
        batch = TangentBatch if isinstance(self.filter, Extended) else Batch
        self.batch = batch(problem, self.filter.count + models, build, parameters, interval=interval)
        self._build = build
        self._forecaster: Forecaster | None = None
        self._past_errors = past_errors(problem)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.batch.close()
        if self._forecaster is not None:
            self._forecaster.close()

    def _new_smoother(self) -> FixedLagSmoother | None:
        return FixedLagSmoother(self.problem.lag, self._low, self._high) if self.problem.lag else None

    def advance(self, tick: int) -> None:
        """Advance the model to a communication step, counted from its start; SimulationError if it fails at a point."""
        points = self.filter.spread(self._walk * np.sqrt((tick - self.tick) * self._step))
        if self.smoother is not None:
            self._past = self.filter.past_deviations(points)
        sharing = self.filter.count if self.filter.shares_memory else 0
        if self.bank is None:
            self.batch.write(points, sharing=sharing)
        else:
            self.bank.write(self.batch, points, sharing)
        self.batch.advance(tick)
        self.tick = tick

    def correct(self, measurements: Mapping[int, float]) -> Estimate:
        """Correct the estimate with values measured at the communication step reached, by number of the output."""
        numbers, measured, count = list(measurements), np.array(list(measurements.values())), self.filter.count
        points, outputs = self.batch.read(), self.batch.outputs(numbers)
        if self.bank is not None:
            measured -= self.bank.offset[numbers]
        update = self.filter.update(points[:count], outputs[:count], measured, self._noise[numbers])
        time = self._begin + self.tick * self._step
        alarm = smoothed = None
        if self.smoother is not None:
            smoothed = self.smoother.correct(self.filter, self.tick, time, self._past, points[:count])
        if self.bank is not None:
            alarm = self.bank.update(time, points[count:], outputs[count:], numbers, measured, update)
            if self.bank.adopt(self.batch):
                self.smoother = self._new_smoother()
        if self._past_errors is not None:
            for number, value in zip(numbers, measured.tolist(), strict=True):
                self._past_errors.measure(self.tick, number, value)
        signals = np.full((4, len(self._noise)), np.nan)
        signals[:, numbers] = measured, update.predicted, update.innovation, update.deviation
        return Estimate(
            time,
            self.filter.mean,
            self.filter.covariance,
            measured=signals[0],
            predicted=signals[1],
            innovation=signals[2],
            expected=signals[3],
            nis=update.nis,
            band=self._bands[len(numbers)],
            changes=None if self.bank is None else self.bank.probabilities.copy(),
            alarm=alarm,
            smoothed=smoothed,
        )

    @property
    def alarms(self) -> list[Alarm]:
        """Changes that were noticed."""
        return [] if self.bank is None else self.bank.alarms

    def forecast(self, horizon: int | None = None, overrides: Mapping[str, float] | None = None) -> Forecast:
        """Forecast from the estimate by `horizon` communication steps, by default that of the file; the estimate is not changed.

        `overrides`: values of parameters and unconnected inputs, in their own units: what happens if these change now.
        """
        settings = self.problem.forecast
        if settings is None:
            raise SimulationError(
                "no forecast is described. Add `forecast: {horizon: 1 s, signals: [...]}` to the file."
            )
        if self._forecaster is None:
            self._forecaster = Forecaster(self.batch.problem, settings, self._build)
        forecast = self._forecaster.forecast(
            self.batch, self.filter, self.tick, horizon or settings.horizon, overrides or {}
        )
        if self._past_errors is None:
            return forecast
        factors = self._past_errors.factors(self.tick, len(forecast.time), len(forecast.signals))
        if horizon is None and not overrides:
            self._past_errors.add(np.rint((forecast.time - self._begin) / self._step).astype(int), forecast.bands)
        draws = widened(forecast, factors)
        return replace(forecast, draws=draws, chance=self._forecaster.chances(draws), factors=factors)

    def save(self) -> SavedFollower:
        """Return the state: estimate, memory of all points, and communication step."""
        filter_, bank = copy.deepcopy((self.filter, self.bank))
        return SavedFollower(filter_, self.batch.save(), bank, copy.copy(self.smoother), self.tick)

    def restore(self, saved: SavedFollower) -> None:
        """Go back to a saved state: what follows is computed again to the bit."""
        self.filter, self.bank = copy.deepcopy((saved.filter, saved.bank))  # the bank refers to the filter
        self.smoother, self.tick = copy.copy(saved.smoother), saved.tick
        self.batch.restore(saved.batch)


def follow(problem: FollowProblem, build: Path = Path("build")) -> Iterator[Estimate]:
    """Yield an estimate for each time with measurements, in order; SimulationError if the model fails at a point."""
    due = problem.forecast.repeat if problem.forecast else 0
    with Follower(problem, build) as follower:
        for tick, measurements in times_of(problem).items():
            follower.advance(tick)
            estimate = follower.correct(measurements)
            if problem.forecast is not None and tick >= due:
                due = tick + problem.forecast.repeat
                estimate = replace(estimate, forecast=follower.forecast())
            yield estimate


def past_errors(problem: FollowProblem) -> PastErrors | None:
    """Return what takes the errors of past forecasts; None if bands are not to be calibrated."""
    settings = problem.forecast
    if settings is None or not settings.calibrate:
        return None
    numbers = {
        number: settings.signals.index(output.signal)
        for number, output in enumerate(problem.outputs)
        if output.signal in settings.signals
    }
    return PastErrors(settings.calibrate, numbers)


def nis_band(count: int) -> tuple[float, float]:
    """Return the central 95 % band of a chi-square distribution with `count` degrees of freedom."""
    from scipy.stats import chi2

    tail = (1.0 - CONFIDENCE) / 2.0
    return (float(chi2.ppf(tail, count)), float(chi2.ppf(1.0 - tail, count))) if count else (0.0, 0.0)


def in_band(estimates: Sequence[Estimate]) -> float:
    """Return the fraction of estimates whose NIS lies in its band."""
    return float(np.mean([estimate.is_in_band for estimate in estimates]))


def remarks(problem: FollowProblem, estimates: Sequence[Estimate]) -> list[str]:
    """Return remarks on estimates that cannot be separated or are at a bound, and on a model that does not fit."""
    last, lines = estimates[-1], []
    correlation = last.covariance / np.outer(last.deviations, last.deviations)
    for i, variable in enumerate(problem.estimates):
        lines += [
            f"{variable.name} cannot be separated from {problem.estimates[k].name} (correlation {correlation[i, k]:.2f}): "
            "measure more, or estimate one of them."
            for k in range(i)
            if abs(correlation[i, k]) > UNSEPARATED
        ]
        if last.values[i] in (variable.low, variable.high):
            lines.append(f"{variable.name} is at its bound: widen it, or check the model.")
    if (fraction := in_band(estimates)) < REPRESENTED:
        below, above = (
            sum(side) for side in ([e.nis < e.band[0] for e in estimates], [e.nis > e.band[1] for e in estimates])
        )
        advice = (
            "too large. Lower noise or walk."
            if below > above
            else "too small. Check noise and delay, raise a walk, or estimate what else changes."
        )
        lines.append(
            f"the model does not represent the recording: NIS is in its 95 % band at {100 * fraction:.0f} % of the times only. "
            f"The standard deviations are {advice}"
        )
    return lines


def summary_of(problem: FollowProblem, estimates: Sequence[Estimate]) -> dict[str, Any]:
    """Return the last estimates and the consistency of the innovations for summary.json."""
    last = estimates[-1]
    alarms = [asdict(estimate.alarm) for estimate in estimates if estimate.alarm]
    return {
        "method": problem.keys.method.model_dump(),
        "measurements": len(estimates),
        **({"changes": alarms} if problem.changes else {}),
        "nis_in_band": in_band(estimates),
        "nis_mean": float(np.mean([estimate.nis for estimate in estimates])),
        "estimates": {
            variable.name: {"value": float(value), "deviation": float(deviation), "unit": variable.unit}
            for variable, value, deviation in zip(problem.estimates, last.values, last.deviations, strict=True)
        },
    }
