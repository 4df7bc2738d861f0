"""Signals of estimates, changes and forecasts for the recording of a followed run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from twin.coupling import MemberVariable, find
from twin.follow.changes import NO_CHANGE, UNKNOWN
from twin.results import RecordedVariable, Signals

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.follow.follower import Estimate
    from twin.follow.forecast import Forecast
    from twin.follow.problem import EstimatedVariable, FollowProblem
    from twin.identify import Output

    RecordedSignals = Iterator[tuple[RecordedVariable, Array]]
    Variables = list[tuple[str, EstimatedVariable | Output]]  # with their names

ENDS = ("low", "median", "high")
ROUNDING = 1e-9  # of times [s]


def path_of(*names: str) -> str:
    """Return the path of a signal."""
    return ".".join(names).replace("[", "_").replace("]", "").replace(" ", "_")


def signals_of(
    problem: FollowProblem,
    estimates: Sequence[Estimate],
    forecasts: Sequence[Forecast] | None = None,
    before: float = -inf,
) -> tuple[Signals, list[RecordedVariable]]:
    """Return the estimates as signals of a run: `estimate.member.variable` and so on.

    `forecasts`: those that may end among the estimates, by default those made with them; `before`: time before the first one [s].
    """
    if forecasts is None:
        forecasts = [estimate.forecast for estimate in estimates if estimate.forecast]
    time = np.array([estimate.time for estimate in estimates])
    made = dict(
        (
            *estimate_signals(problem, estimates),
            *smoothed_signals(problem, estimates),
            *change_signals(problem, estimates),
            *forecast_signals(problem, time, forecasts, before),
        )
    )
    values = {variable.name: np.ascontiguousarray(table) for variable, table in made.items()}
    return Signals(time, values, {variable.name: variable.unit for variable in made}), list(made)


def recorded(path: str, variable: EstimatedVariable | Output | MemberVariable, text: str) -> RecordedVariable:
    """Return the signal that belongs to a variable, in its unit."""
    return RecordedVariable(path, unit=variable.unit, display_unit=variable.display_unit, description=text)


def estimate_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> RecordedSignals:
    """Yield estimates, measured and predicted signals, innovations and NIS."""
    estimated: Variables = [(variable.name, variable) for variable in problem.estimates]
    measured: Variables = [(output.signal, output) for output in problem.outputs]
    for group, field, variables, text in (
        ("estimate", "values", estimated, "estimate"),
        ("deviation", "deviations", estimated, "standard deviation of the estimate"),
        ("measured", "measured", measured, "measured, offset subtracted"),
        ("predicted", "predicted", measured, "predicted before the measurement"),
        ("innovation", "innovation", measured, "measured minus predicted"),
        ("expected", "expected", measured, "standard deviation of the innovation"),
    ):
        table = np.array([getattr(estimate, field) for estimate in estimates])
        for i, (name, variable) in enumerate(variables):
            yield recorded(path_of(group, name), variable, text), table[:, i]
    nis = np.array([(estimate.nis, *estimate.band) for estimate in estimates])
    for name, values in zip(("value", "low", "high"), nis.T, strict=True):
        yield RecordedVariable(f"nis.{name}", description="normalized innovation squared, and its 95 % band"), values


def change_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> RecordedSignals:
    """Yield the probability of each change over time."""
    table = np.array([estimate.changes for estimate in estimates if estimate.changes is not None])
    if problem.changes and len(table):
        for i, name in enumerate((NO_CHANGE, UNKNOWN, *(change.name for change in problem.changes))):
            yield RecordedVariable(path_of("change", name), description="probability of the change"), table[:, i]


def smoothed_signals(problem: FollowProblem, estimates: Sequence[Estimate]) -> RecordedSignals:
    """Yield the smoothed estimates, their standard deviations and their times; NaN at times without one."""
    if not problem.lag:
        return
    nothing = np.full(len(problem.estimates), np.nan)
    smoothed = [estimate.smoothed for estimate in estimates]
    times = np.array([estimate.time if estimate else np.nan for estimate in smoothed])
    yield RecordedVariable("smoothed.time", unit="s", description="time of the estimates one lag before"), times
    for group, field, text in (
        ("smoothed", "values", "estimate one lag before"),
        ("smoothed_deviation", "deviations", "standard deviation of the estimate one lag before"),
    ):
        table = np.array([getattr(estimate, field) if estimate else nothing for estimate in smoothed])
        for i, variable in enumerate(problem.estimates):
            yield recorded(path_of(group, variable.name), variable, text), table[:, i]


def forecast_signals(
    problem: FollowProblem, time: Array, forecasts: Sequence[Forecast], before: float
) -> RecordedSignals:
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
            yield recorded(path_of("forecast", signal, name), variable, text), values
        if signal in problem.forecast.limits:
            text = "chance to leave the limits in the time of the forecast"
            yield RecordedVariable(path_of("forecast", signal, "chance"), description=text), chance
