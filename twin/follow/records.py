"""Signals of changes and forecasts for the recording of a followed run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import find
from twin.follow.changes import NO_CHANGE, UNKNOWN
from twin.results import RecordedVariable

if TYPE_CHECKING:
    from twin.follow.follower import Estimate
    from twin.follow.problem import FollowProblem

    Array = np.ndarray[Any, Any]

ENDS = ("low", "median", "high")


def path_of(*names: str) -> str:
    """Return the path of a signal."""
    return ".".join(names).replace("[", "_").replace("]", "").replace(" ", "_")


def change_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> Iterator[tuple[RecordedVariable, Array]]:
    """Yield the probability of each change over time."""
    table = np.array([estimate.changes for estimate in estimates if estimate.changes is not None])
    if problem.changes and len(table):
        for i, name in enumerate((NO_CHANGE, UNKNOWN, *(change.name for change in problem.changes))):
            yield RecordedVariable(path_of("change", name), description="probability of the change"), table[:, i]


def forecast_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> Iterator[tuple[RecordedVariable, Array]]:
    """Yield the bands that were forecast for each time one horizon before, and the chances to leave the limits after it.

    NaN at times without a forecast.
    """
    if problem.forecast is None:
        return
    time = np.array([estimate.time for estimate in estimates])
    for i, signal in enumerate(problem.forecast.signals):
        variable = find(signal, problem.experiment.catalog).variable
        bands, chance = np.full((3, len(time)), np.nan), np.full(len(time), np.nan)
        for row, forecast in ((row, estimate.forecast) for row, estimate in enumerate(estimates) if estimate.forecast):
            chance[row] = forecast.chance[i]
            target = int(np.argmin(abs(time - forecast.time[-1])))
            if time[-1] >= forecast.time[-1]:
                bands[:, target] = forecast.bands[:, -1, i]
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
