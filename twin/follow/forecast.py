"""Forecasts: copies of the model run ahead from draws of the estimate, with bands as wide as the errors of past forecasts show."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from twin.coupling import find
from twin.errors import SimulationError
from twin.follow.batch import Batch
from twin.identify import replay

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.arrays import Array
    from twin.follow.filters import Ensemble, SquareRootFilter
    from twin.follow.problem import FollowProblem

QUANTILES = (0.05, 0.5, 0.95)
SHARE = 0.9  # of the measured values that a band is to hold
FEWEST = 9  # errors, before they change a band: the largest of nine is the quantile of 90 % of ten


@dataclass(frozen=True)
class Forecast:
    """Forecast from `start` [s]. `time`: of its points [s], (k,); `draws`: of the signals, (k, draws, s).

    `chance`: that a signal leaves its limits in the time of the forecast, (s,); NaN without limits. `factors`: by which past errors
    have moved the draws away from their median, (k, s); None without `calibrate`.
    """

    start: float
    time: Array
    signals: tuple[str, ...]
    draws: Array
    chance: Array
    factors: Array | None = None

    @property
    def bands(self) -> Array:
        """Quantiles 5, 50 and 95 %, (3, k, s)."""
        return np.asarray(np.quantile(self.draws, QUANTILES, axis=1))


@dataclass(frozen=True)
class ForecastSettings:
    """How forecasts are made. Times in communication steps; `limits`: by signal; `planned`: inputs of which the future is known.

    `calibrate`: time for which errors of past forecasts set the widths of the bands, 0: they do not.
    """

    horizon: int
    interval: int
    repeat: int
    signals: tuple[str, ...]
    limits: Mapping[str, tuple[float, float]]
    planned: tuple[str, ...]
    draws: int
    seed: int
    calibrate: int = 0


class Forecaster:
    """Copies of the model of a problem for forecasts."""

    def __init__(self, problem: FollowProblem, settings: ForecastSettings, build: Path) -> None:
        self.problem, self.settings = problem, settings
        self.batch = Batch(problem, settings.draws, build, signals=settings.signals)
        self._random = np.random.default_rng(settings.seed)
        self._walk = np.array([estimate.walk for estimate in problem.estimates])
        self._step, self._begin = problem.step, problem.begin

    def forecast(
        self,
        source: Batch,
        filter_: SquareRootFilter | Ensemble,
        tick: int,
        horizon: int,
        overrides: Mapping[str, float],
    ) -> Forecast:
        """Run copies ahead from an estimate by `horizon` communication steps. `overrides`: values of parameters and inputs."""
        count, settings = self.settings.draws, self.settings
        sources = np.zeros(count, int) if filter_.shares_memory else np.arange(count) % filter_.count
        self.batch.branch(source, sources.tolist())
        self._hold_inputs()
        points = filter_.draw(self._random, count)
        rows, steps = [], [*range(settings.interval, horizon, settings.interval), horizon]
        for before, step in pairwise([0, *steps]):
            deviation = self._walk * np.sqrt((step - before) * self._step)
            points = points + deviation * self._random.standard_normal((count, len(self._walk)))
            self.batch.write(np.clip(points, filter_.low, filter_.high), sharing=0)
            self._override(overrides)
            self.batch.advance(tick + step)
            rows.append(self.batch.outputs(range(len(settings.signals))))
            points = self.batch.read()
        draws = np.array(rows)
        return Forecast(
            self._begin + tick * self._step,
            self._begin + (tick + np.array(steps)) * self._step,
            settings.signals,
            draws,
            self.chances(draws),
        )

    def chances(self, draws: Array) -> Array:
        """Return the fraction of the draws, (k, draws, s), that leave the limits, by signal."""
        chances = np.full(draws.shape[2], np.nan)
        for i, signal in enumerate(self.settings.signals):
            if signal in self.settings.limits:
                low, high = self.settings.limits[signal]
                chances[i] = np.mean(np.any((draws[:, :, i] < low) | (draws[:, :, i] > high), axis=0))
        return chances

    def _hold_inputs(self) -> None:
        """Hold recorded inputs at their present value, except those of which the future is planned."""
        planned = [recorded.column in self.settings.planned for recorded in self.problem.experiment.inputs]
        for number in range(len(self.problem.keys.inputs)):
            name = replay.member_name(number)
            is_planned = number < len(planned) and planned[number]  # of a rig nothing is known in advance
            if name in self.problem.experiment.case.members and not is_planned:
                self.batch.hold(name)

    def _override(self, overrides: Mapping[str, float]) -> None:
        """Set parameters and unconnected inputs of all copies; SimulationError for other variables."""
        catalog = self.problem.experiment.catalog
        targets = {connection.target for connection in self.problem.experiment.case.connections}
        for name, value in overrides.items():
            reference = find(name, catalog)
            if reference.variable.causality not in ("parameter", "input") or name in targets:
                raise SimulationError(f"{name}: is no parameter and no unconnected input. Name one of these.")
            self.batch.set_variable(name, value)

    def close(self) -> None:
        """Free the members."""
        self.batch.close()


class PastErrors:
    """Errors of forecasts, in half widths of their bands, of each measured signal (by its number) and point of a forecast.

    A band is widened or narrowed by the quantile of these errors in a time before it: split conformal prediction (Vovk, Gammerman
    and Shafer, Algorithmic Learning in a Random World, 2005) with a moving set of calibration, for errors that change over time.
    Measured values are interpolated between the two measurements around a point. `memory`: that time [communication steps].
    """

    def __init__(self, memory: int, measured: Mapping[int, int]) -> None:
        self.memory, self._signals = memory, dict(measured)  # number of the measured value -> signal of the forecasts
        self._due: deque[tuple[int, int, Array]] = deque()  # time and point of a forecast, its bands (3, signals)
        self._errors: dict[tuple[int, int], deque[tuple[int, float]]] = {}
        self._last: dict[int, tuple[int, float]] = {}

    def add(self, ticks: Array, bands: Array) -> None:
        """Add a forecast. `ticks`: of its points, (k,); `bands`: before they are widened, (3, k, signals)."""
        self._due.extend((tick, point, bands[:, point]) for point, tick in enumerate(ticks.tolist()))

    def measure(self, tick: int, number: int, value: float) -> None:
        """Take a measured value; one that is older than the last of this signal is ignored."""
        if number not in self._signals:
            return
        signal = self._signals[number]
        before = self._last.get(signal)
        if before is not None and tick <= before[0]:
            return
        self._last[signal] = tick, value
        if before is not None:
            for due, point, (low, median, high) in self._due:
                if before[0] < due <= tick:
                    part = (due - before[0]) / (tick - before[0])
                    error = before[1] + part * (value - before[1]) - median[signal]
                    width = high[signal] - median[signal] if error > 0.0 else median[signal] - low[signal]
                    if width > 0.0:
                        errors = self._errors.setdefault((point, signal), deque())
                        errors.append((due, abs(error) / width))
        is_complete = len(self._last) == len({*self._signals.values()})
        passed = min(last[0] for last in self._last.values()) if is_complete else tick - self.memory
        while self._due and self._due[0][0] <= passed:
            self._due.popleft()

    def factors(self, tick: int, points: int, signals: int) -> Array:
        """Return factors on the widths of bands, (points, signals): 1 where there are too few errors."""
        result = np.ones((points, signals))
        for (point, signal), errors in self._errors.items():
            while errors and errors[0][0] < tick - self.memory:
                errors.popleft()
            count = len(errors)
            if count >= FEWEST and point < points:
                level = min(1.0, SHARE * (count + 1) / count)
                result[point, signal] = np.quantile([error for _, error in errors], level, method="inverted_cdf")
        return result


def widened(forecast: Forecast, factors: Array) -> Array:
    """Return the draws of a forecast, (k, draws, signals), with their distances from the median by factors, (k, signals)."""
    median = np.median(forecast.draws, axis=1, keepdims=True)
    return np.asarray(median + factors[:, None, :] * (forecast.draws - median))
