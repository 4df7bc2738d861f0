"""What is marked in a plot over time: events with their names, and where an expectation failed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit as units
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results.violations import Failure

EVENT, BAD = "#e08e0b", "#c81e1e"
LETTER = 3.6  # width of one [pt] at SIZE
SIZE = 6.5  # [pt]
RINGS = 12  # of a curve: where more parts of it failed, red alone shows them
NEAR = 0.022  # of an axis' width: about two lines of letters, which would lie on each other

QUANTITIES = {  # what a unit measures, for an axis on which several signals are drawn
    "m": "length", "m/s": "velocity", "m/s^2": "acceleration", "m^2": "area", "m^3": "volume", "m^3/s": "flow",
    "rad": "angle", "rad/s": "angular velocity", "rad/s^2": "angular acceleration", "1/m": "curvature",
    "N": "force", "N*m": "torque", "N/m": "stiffness", "N*s/m": "damping", "Pa": "pressure", "N/s": "force rate",
    "kg": "mass", "kg/s": "mass flow", "s": "time", "Hz": "frequency", "K": "temperature", "W": "power",
    "A": "current", "V": "voltage", "T": "flux density",
}  # fmt: skip


@dataclass(frozen=True)
class Event:
    """A line at a time [s]. No `variants`: of all."""

    time: float
    name: str = ""
    variants: tuple[str, ...] = ()


@lru_cache(maxsize=64)
def quantity(unit: str) -> str:
    """What a unit measures: `force` of mN; `value` of a plain number, nothing of a unit that is in no table."""
    try:
        wanted = units.describe(unit).exponents
    except CouplingError:
        return ""
    if not any(wanted):
        return "value" if unit in ("", "1", "-") else "part"
    return next((name for text, name in QUANTITIES.items() if units.describe(text).exponents == wanted), "")


def events(axis: Any, found: Iterable[Event], names: Sequence[str], factor: float, height: float) -> None:
    """Lines at the events of some variants, their names beside them; `factor`: seconds to the axis' unit, `height` [pt]."""
    left, right = axis.get_xlim()
    own = sorted(
        (one.time * factor, one.name)
        for one in found
        if (not one.variants or set(one.variants) & set(names)) and left < one.time * factor < right
    )
    groups: list[tuple[float, list[str]]] = []
    for time, name in dict.fromkeys(own):
        axis.axvline(time, color=EVENT, linewidth=0.9, linestyle=":", zorder=1)
        if groups and time - groups[-1][0] < NEAR * (right - left):
            groups[-1][1].append(name)
        else:
            groups.append((time, [name]))
    for time, together in groups:
        lines = [line for name in dict.fromkeys(together) for line in wrapped(name, int(height / LETTER))]
        axis.text(
            time, 0.985, "\n".join(lines), rotation=90, transform=axis.get_xaxis_transform(), fontsize=SIZE,
            color="#8a5a00", horizontalalignment="left", verticalalignment="top", linespacing=1.0, clip_on=True, zorder=4,
        )  # fmt: skip


def wrapped(name: str, letters: int) -> list[str]:
    """A name in lines that fit, broken behind blanks, points and underscores; a value stays whole."""
    lines = [""]
    for word in re.findall(r"= .*|[^ ._]+[ ._]*", name.removeprefix("set ")):
        if lines[-1] and len(lines[-1] + word.rstrip()) > letters:
            lines.append("")
        lines[-1] += word
    return [line.rstrip() for line in lines]


def bad(found: Iterable[Failure], signal: Any, case: tuple[str, int], points: tuple[Any, Any]) -> list[Any]:
    """The values of a curve that failed, the others not a number, for each failure of its case."""
    time, value = points
    masks = [one.bad(case, time, value) for one in found if case in one.cases and one.judges(signal)]
    return [np.where(mask & np.isfinite(value), value, np.nan) for mask in masks if mask.any()]


def failed(axis: Any, x: Any, y: Any) -> None:
    """What failed of a curve, and a ring where each of it begins: a single sample is no line that one sees."""
    axis.plot(x, y, color=BAD, linewidth=2.0, solid_capstyle="round", zorder=5)
    there = np.isfinite(y)
    begins = np.flatnonzero(there & ~np.append(False, there[:-1]))[:RINGS]
    axis.plot(x[begins], y[begins], "o", color=BAD, markersize=7, markerfacecolor="none", clip_on=False, zorder=6)


def limits(axis: Any, one: Failure, factor: float, heights: Iterable[float]) -> None:
    """The limits of a failed expectation, as long as they hold; of a metric the time it is taken over."""
    left, right = axis.get_xlim()
    start, stop = one.window.start_ns, one.window.stop_ns
    begin = left if start is None else max(left, clock.seconds(start) * factor)
    end = right if stop is None else min(right, clock.seconds(stop) * factor)
    if begin >= end:
        return
    for height in heights:
        axis.plot([begin, end], [height, height], color=BAD, linewidth=1.0, linestyle=(0, (2, 1.5)), zorder=4)
    if one.over_time:
        axis.axvspan(begin, end, color=BAD, alpha=0.06, linewidth=0, zorder=0)
    axis.set_xlim(left, right)
