"""Signals of smoothed estimates, changes and forecasts for the recording of a followed run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import find
from twin.follow.changes import NO_CHANGE, UNKNOWN
from twin.results import RecordedVariable

if TYPE_CHECKING:
    from twin.follow.follower import Estimate
    from twin.follow.forecasting.forecast import Forecast
    from twin.follow.problem import FollowProblem

    Array = np.ndarray[Any, Any]

ENDS = ("low", "median", "high")
ROUNDING = 1e-9  # of times [s]


def path_of(*names: str) -> str:
    """Return the path of a signal."""
    return ".".join(names).replace("[", "_").replace("]", "").replace(" ", "_")


def change_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> Iterator[tuple[RecordedVariable, Array]]:
    """Yield the probability of each change over time."""
    table = np.array([estimate.changes for estimate in estimates if estimate.changes is not None])
    if problem.changes and len(table):
        for i, name in enumerate((NO_CHANGE, UNKNOWN, *(change.name for change in problem.changes))):
            yield RecordedVariable(path_of("change", name), description="probability of the change"), table[:, i]


def smoothed_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> Iterator[tuple[RecordedVariable, Array]]:
    """Yield the smoothed estimates, their standard deviations and their times; NaN at times without one."""
    if not problem.lag:
        return
    nothing = np.full(len(problem.estimates), np.nan)
    smoothed = [estimate.smoothed for estimate in estimates]
    tables = {
        "smoothed": (
            np.array([estimate.values if estimate else nothing for estimate in smoothed]),
            "estimate one lag before",
        ),
        "smoothed_deviation": (
            np.array([estimate.deviations if estimate else nothing for estimate in smoothed]),
            "standard deviation of the estimate one lag before",
        ),
    }
    times = np.array([estimate.time if estimate else np.nan for estimate in smoothed])
    yield RecordedVariable("smoothed.time", unit="s", description="time of the estimates one lag before"), times
    for group, (table, text) in tables.items():
        for i, variable in enumerate(problem.estimates):
            path = path_of(group, variable.name)
            yield (
                RecordedVariable(path, unit=variable.unit, display_unit=variable.display_unit, description=text),
                table[:, i],
            )


def forecast_signals(
    problem: FollowProblem, time: Array, forecasts: Sequence[Forecast], before: float
) -> Iterator[tuple[RecordedVariable, Array]]:
    """Yield the bands that were forecast for each time one horizon before, and the chances to leave the limits after it.

    A band stands at the first time, (n,), at or after the one that it is for. `before`: time before the first one. NaN at
    times without a forecast.
    """
    if problem.forecast is None:
        return
    for i, signal in enumerate(problem.forecast.signals):
        variable = find(signal, problem.experiment.catalog).variable
        bands, chance = np.full((3, len(time)), np.nan), np.full(len(time), np.nan)
        for forecast in forecasts:
            start, end = np.searchsorted(time, np.array([forecast.start, forecast.time[-1]]) - ROUNDING)
            if start < len(time) and time[start] < forecast.start + ROUNDING:
                chance[start] = forecast.chance[i]
            if end < len(time) and (end > 0 or before < forecast.time[-1] - ROUNDING):
                bands[:, end] = forecast.bands[:, -1, i]
        for name, values in zip(ENDS, bands, strict=True):
            text = f"forecast one horizon before: {name} of the 90 % band"
            yield (
                RecordedVariable(
                    path_of("forecast", signal, name),
                    unit=variable.unit,
                    display_unit=variable.display_unit,
                    description=text,
                ),
                values,
            )
        if signal in problem.forecast.limits:
            text = "chance to leave the limits in the time of the forecast"
            yield RecordedVariable(path_of("forecast", signal, "chance"), description=text), chance
