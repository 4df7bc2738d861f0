"""A followed rig as runs are viewed: its plots with bands, its status, and the times at which a signal was measured."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from twin.viewer.runs import OpenRun

    Array = np.ndarray[Any, Any]

QUANTILE = 1.96  # standard deviations of the band that holds 95 % of a normal distribution
SPARSE = (
    "measured",
    "predicted",
    "innovation",
    "expected",
    "forecast",
)  # groups of signals without a value at every time
SMOOTHED, SMOOTHED_TIME = ("smoothed", "smoothed_deviation"), "smoothed.time"  # groups of signals at earlier times
NIS_RANGE = 3.0  # upper end of the axis of NIS, relative to its band
GAP = 5.0  # typical distances between two values: a longer one is a gap


def is_followed(viewed: OpenRun) -> bool:
    """Return whether a run has estimates of `twin follow`."""
    return "nis.value" in viewed.variables


def is_sparse(name: str) -> bool:
    """Return whether a signal has values at some times only."""
    return name.partition(".")[0] in SPARSE


def is_smoothed(name: str) -> bool:
    """Return whether a signal belongs to the times in `SMOOTHED_TIME`."""
    return name.partition(".")[0] in SMOOTHED and name != SMOOTHED_TIME


def compact(time: Array, y: Array) -> tuple[Array, Array]:
    """Return the samples with values; NaN stands for gaps that are much longer than the typical distance of two values."""
    finite = np.isfinite(y)
    return (time, y) if finite.all() else with_gaps(time[finite], y[finite])


def with_gaps(time: Array, y: Array) -> tuple[Array, Array]:
    """Return samples with NaN in gaps that are much longer than the typical distance of two values."""
    distances = np.diff(time)
    if not len(distances):
        return time, y
    after = np.flatnonzero(distances > GAP * np.median(distances)) + 1
    return np.insert(time, after, time[after - 1]), np.insert(y, after, np.nan)


def plots(viewed: OpenRun) -> list[dict[str, Any]]:
    """Return the plots of a followed run; the first ones are shown at first."""
    names = [name for name in viewed.variables if "." in name]
    groups: dict[str, list[str]] = {}
    for name in names:
        group, _, signal = name.partition(".")
        groups.setdefault(group, []).append(signal)
    measured, forecast = groups.get("measured", []), forecast_signals(groups.get("forecast", []))
    panes = [
        plot(
            signal,
            [f"measured.{signal}", f"predicted.{signal}"],
            ["measured", "predicted, 95 % band"],
            {f"predicted.{signal}": band(f"predicted.{signal}", f"expected.{signal}")},
            fan=signal if signal in forecast else "",
        )
        for signal in measured
    ]
    for signal in forecast:
        median = f"forecast.{signal}.median"
        edges = {median: [f"forecast.{signal}.low", f"forecast.{signal}.high"]}
        signals, labels = [median], ["forecast one horizon before, 90 % band"]
        if signal in measured:
            signals, labels = [f"measured.{signal}", *signals], ["measured", *labels]
        title = f"{signal}: forecast"
        panes.append(plot(title, signals, labels, edges, fan="" if signal in measured else signal))
    panes += [estimate_plot(signal, signal in groups.get("smoothed", [])) for signal in groups.get("estimate", [])]
    nis = plot("Innovations", ["nis.value"], ["NIS, 95 % band"], {"nis.value": ["nis.low", "nis.high"]})
    panes.append(nis | {"range": nis_range(viewed)})
    if changes := groups.get("change", []):
        labels = [name.replace("_", " ") for name in changes]
        panes.append(plot("Probabilities of changes", [f"change.{name}" for name in changes], labels, {}))
    for each in panes:
        each["first"] = True
    innovations = [
        plot(
            f"{signal}: innovation",
            [f"innovation.{signal}"],
            ["innovation, 95 % band"],
            {f"innovation.{signal}": [f"-{QUANTILE} * expected.{signal}", f"{QUANTILE} * expected.{signal}"]},
        )
        for signal in measured
    ]
    return panes + innovations


def estimate_plot(signal: str, has_smoothed: bool) -> dict[str, Any]:
    """Return the plot of an estimate, with the smoothed one if there is one."""
    groups = {"estimate": ("deviation", "estimate, 95 % band")}
    if has_smoothed:
        groups["smoothed"] = ("smoothed_deviation", "smoothed by later measurements, 95 % band")
    names = {f"{group}.{signal}": (f"{spread}.{signal}", label) for group, (spread, label) in groups.items()}
    bands = {name: band(name, deviation) for name, (deviation, _) in names.items()}
    return plot(signal, list(names), [label for _, label in names.values()], bands)


def first_signals(viewed: OpenRun) -> list[str]:
    """Return the signals of the plots that are shown at first, and the edges of their bands."""
    first = [each for each in plots(viewed) if each["first"]]
    return [
        name for each in first for name in (*each["signals"], *(e for edges in each["bands"].values() for e in edges))
    ]


def nis_range(viewed: OpenRun) -> list[float] | None:
    """Return a range in which the band of NIS is seen whatever single values are; None without a measurement."""
    high = viewed.recording.column(next(iter(viewed.recording.cases)), "nis.high")
    highest = float(np.max(high, initial=0.0))
    return [0.0, NIS_RANGE * highest] if highest > 0.0 else None


def forecast_signals(names: list[str]) -> list[str]:
    """Return the signals of names such as `wall.force.median`."""
    return [name.removesuffix(".median") for name in names if name.endswith(".median")]


def band(center: str, deviation: str) -> list[str]:
    """Return the edges of a 95 % band as expressions."""
    return [f"{center} {sign} {QUANTILE} * {deviation}" for sign in "-+"]


def plot(
    title: str, signals: list[str], labels: list[str], bands: dict[str, list[str]], *, fan: str = ""
) -> dict[str, Any]:
    """Return a plot. `bands`: edges of the area around a signal, as signals or expressions; `fan`: signal of the last forecast."""
    return {
        "title": title,
        "signals": signals,
        "labels": labels,
        "x": "",
        "per_variant": False,
        "lines": [],
        "band": [],
        "window": (None, None),
        "variants": [],
        "bands": bands,
        "fan": fan,
        "first": False,
        "range": None,
    }


def status(viewed: OpenRun) -> dict[str, Any] | None:
    """Return the status of a followed run in display units, with `lost`: a sentence if the twin does not represent the rig."""
    from twin.follow import LOST, STATUS_FILE

    if not is_followed(viewed) or (content := read_json(viewed.folder / STATUS_FILE)) is None:
        return None
    content["lost"] = "" if content["represents"] else LOST
    for name, estimate in content["estimates"].items():
        estimate["text"] = shown_estimate(viewed, name, estimate)
    forecast = content["forecast"]
    for name, bands in forecast["signals"].items() if forecast else ():
        samples = viewed.samples(next(iter(viewed.recording.cases)), f"forecast.{path(name)}.median")
        for edge in ("low", "median", "high", "limits"):
            bands[edge] = samples.shown(np.array(bands[edge], np.float64)).tolist()
        bands["path"], bands["unit"] = path(name), samples.unit
    return content


def shown_estimate(viewed: OpenRun, name: str, estimate: dict[str, float | None]) -> str:
    """Return an estimate with its standard deviation and unit as text."""
    from twin.results import format_value, si_conversion

    variable = viewed.variables.get(f"estimate.{path(name)}")
    if variable is None or None in estimate.values():
        return "-"
    factor, offset = si_conversion(variable.unit)
    unit = variable.display_unit or variable.unit
    value, deviation = float(estimate["value"] or 0.0), float(estimate["deviation"] or 0.0)
    spread = format_value(deviation * factor, unit, is_difference=True, digits=2)
    return f"{format_value(value * factor + offset, unit, digits=4)} \N{PLUS-MINUS SIGN} {spread}"


def path(name: str) -> str:
    """Return the name of a variable in recorded signals."""
    from twin.follow import path_of

    return path_of(name)


def events(viewed: OpenRun) -> list[dict[str, Any]]:
    """Return the changes that were noticed, at their onset."""
    content = status(viewed) or {"changes": []}
    return [{"time": change["onset"], "name": change["name"], "variants": []} for change in content["changes"]]


def read_json(file: Path) -> dict[str, Any] | None:
    """Return the content of a file that is replaced while it is read; None if there is none."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
