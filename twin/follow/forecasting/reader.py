"""Reader of the forecasts of a follow file, in communication steps and the variables' units."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.follow.forecasting.forecast import ForecastSettings

if TYPE_CHECKING:
    from twin.follow.problem import FollowLoader

POINTS = 10  # of a forecast, if no interval is given


def read_forecast(loader: FollowLoader) -> ForecastSettings | None:
    """Return how forecasts are made, None without them; problems are added to those of the loader."""
    keys, step, path = loader.keys.forecast, loader.full_case.step_ns, ("forecast",)
    if keys is None:
        return None

    def steps(name: str, time: clock.Time) -> int:
        if time <= 0 or time % step:
            loader.add_problem(
                f"{clock.text(time)} is no multiple of the communication step of {clock.text(step)}. Give one.",
                *path,
                name,
            )
        return max(1, int(time // step))

    horizon = steps("horizon", keys.horizon)
    interval = steps("interval", keys.interval) if keys.interval else max(1, horizon // POINTS)
    repeat = steps("every", keys.every) if keys.every else horizon
    limits = {}
    for name in dict.fromkeys([*keys.signals, *keys.limits]):
        variable = loader.looked_up(name, loader.catalog, *path, "signals")
        if variable is None:
            continue
        if variable.shape:
            loader.add_problem(f"{name} is an array. Name one element, such as {name}[1].", *path, "signals")
        elif name.partition(".")[0] not in loader.reduced.members:
            loader.add_problem(
                f"{name} has no influence on the measured signals, and is not simulated.", *path, "signals"
            )
        if name in keys.limits:
            low, high = (loader.quantity(raw, variable.unit, *path, "limits", name) for raw in keys.limits[name])
            limits[name] = low, high
    if not keys.signals:
        loader.add_problem("`signals` is missing. Add them, such as signals: [wall.force].", *path)
    for name in keys.planned:
        if name not in loader.keys.inputs:
            loader.add_problem(f"{name} is none of `inputs`. Name one of them.", *path, "planned")
    if keys.planned and loader.keys.rig is not None:
        loader.notes.append("planned inputs are held, too: nothing is known in advance of a rig.")
    signals = tuple(dict.fromkeys([*keys.signals, *keys.limits]))
    calibrate = steps("calibrate", keys.calibrate) if keys.calibrate is not None else 0
    if calibrate and not {output.signal for output in loader.compared} & {*signals}:
        loader.add_problem(
            "none of the signals is measured. Leave it out, or name one of `outputs`.", *path, "calibrate"
        )
    return ForecastSettings(
        horizon, interval, repeat, signals, limits, tuple(keys.planned), keys.draws, keys.seed, calibrate
    )
