"""Readers of the changes and the forecasts of a follow file, in communication steps and the variables' units."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.coupling import find
from twin.follow.changes import NO_CHANGE, UNKNOWN, Amount, Change
from twin.follow.forecast import ForecastSettings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.follow.problem import FollowLoader
    from twin.follow.schema import ChangeKeys

FACTOR = re.compile(r"[x*]\s*(\d.*)")
HOUR = 3600.0  # [s]
POINTS = 10  # of a forecast, if no interval is given


def read_changes(loader: FollowLoader) -> tuple[Change, ...]:
    """Return the changes to look for; problems are added to those of the loader."""
    return tuple(change for name, keys in loader.keys.changes.items() for change in read_change(loader, name, keys))


def read_change(loader: FollowLoader, name: str, keys: ChangeKeys) -> Iterator[Change]:
    """Yield a change, unless it has problems."""
    path, before = ("changes", name), len(loader.problems)
    lists = {key: raw if isinstance(raw, list) else [raw] for key, raw in keys.set.items()}
    if not lists:
        loader.add_problem("`set` is missing. Add what changes, such as set: {sheath.friction: x1.5}.", *path)
    elif len({len(values) for values in lists.values()}) > 1 or not all(lists.values()):
        loader.add_problem("lists in `set` differ in length. Give each variable as many amounts.", *path, "set")
    elif name in (NO_CHANGE, UNKNOWN):
        loader.add_problem(f"`{name}` is what no listed change is called. Choose another name.", *path)
    amounts = [
        amount(loader, {key: values[i] for key, values in lists.items()}, *path, "set")
        for i in range(max(map(len, lists.values()), default=0) if len(loader.problems) == before else 0)
    ]
    if len(loader.problems) == before:
        yield Change(name, keys.rate / HOUR, tuple(amounts))


def amount(loader: FollowLoader, values: dict[str, Any], *path: str) -> Amount:
    """Return one amount of a change: of parameters, or as offsets of measured signals."""
    parameters: dict[str, tuple[float, float]] = {}
    offsets: dict[int, float] = {}
    signals = [output.signal for output in loader.compared]
    for name, raw in values.items():
        variable = loader.looked_up(name, loader.catalog, *path, name)
        if variable is None:
            continue
        factor, difference = terms(loader, raw, variable.unit, *path, name)
        if name in signals:
            if factor != 1.0:
                loader.add_problem("a measured signal gets an offset, such as +5 mN.", *path, name)
            offsets[signals.index(name)] = difference
        elif variable.causality != "parameter" or variable.variability == "fixed":
            loader.add_problem(
                f"{name} is no tunable parameter and no measured signal. Name one of these.", *path, name
            )
        elif name.partition(".")[0] not in {signal.partition(".")[0] for signal in loader.full_case.members}:
            loader.add_problem(f"{name} has no influence on the measured signals.", *path, name)
        else:
            parameters.update(dict.fromkeys(elements(name, loader), (factor, difference)))
    return Amount(parameters, offsets)


def elements(name: str, loader: FollowLoader) -> list[str]:
    """Return the elements of a variable, such as `sheath.friction[1]`."""
    reference = find(name, loader.catalog)
    return [name] if reference.size == 1 else [f"{name}[{i + 1}]" for i in range(reference.size)]


def terms(loader: FollowLoader, raw: Any, unit: str, *path: str) -> tuple[float, float]:
    """Return factor and difference: `x1.5` multiplies, a sign adds, and all else is the new value."""
    text = str(raw).strip()
    if match := FACTOR.fullmatch(text):
        return loader.quantity(match[1], "", *path), 0.0
    if text[:1] in "+-":
        return 1.0, (-1.0 if text[0] == "-" else 1.0) * loader.quantity(
            text[1:].strip(), unit, *path, is_difference=True
        )
    return 0.0, loader.quantity(raw, unit, *path)


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
