"""Forecasts: copies of the model run ahead from draws of the estimate, without disturbing what is followed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import find
from twin.errors import SimulationError
from twin.follow.batch import Batch
from twin.identify import replay

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.follow.filters import Ensemble, SquareRootFilter
    from twin.follow.problem import FollowProblem

    Array = np.ndarray[Any, Any]

QUANTILES = (0.05, 0.5, 0.95)


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
        self._low, self._high = (
            np.array([getattr(estimate, end) for estimate in problem.estimates]) for end in ("low", "high")
        )
        case = problem.experiment.case
        self._step, self._begin = clock.seconds(case.step_ns), clock.seconds(case.start_ns)

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
            self.batch.write(self._bounded(points), sharing=0)
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

    def _bounded(self, points: Array) -> Array:
        return np.asarray(np.clip(points, self._low, self._high))

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
