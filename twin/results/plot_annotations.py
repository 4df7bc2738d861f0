"""Annotations of plots over time: events with their names, and violations of expectations."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit as units
from twin.errors import CouplingError
from twin.results.evaluation.coverage import join_numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.evaluation.violations import Violation
    from twin.results.recording.signals import Signals

EVENT_COLOR, VIOLATION_COLOR = "#e08e0b", "#c81e1e"
LETTER_WIDTH = 3.6  # width of a letter [pt] at FONT_SIZE
FONT_SIZE = 6.5  # [pt]
MAX_RINGS = 12  # of a curve; further violations are marked in red only
MIN_EVENT_DISTANCE = 0.022  # relative to the axis' width: about two lines of text, which would overlap
MIN_NUMBER_DISTANCE = 0.05  # the same for numbers, which are written horizontally: about seven letters

QUANTITIES = {  # labels of axes with several signals
    "m": "length",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "m^2": "area",
    "m^3": "volume",
    "m^3/s": "flow",
    "rad": "angle",
    "rad/s": "angular velocity",
    "rad/s^2": "angular acceleration",
    "1/m": "curvature",
    "N": "force",
    "N*m": "torque",
    "N/m": "stiffness",
    "N*s/m": "damping",
    "Pa": "pressure",
    "N/s": "force rate",
    "kg": "mass",
    "kg/s": "mass flow",
    "s": "time",
    "Hz": "frequency",
    "K": "temperature",
    "W": "power",
    "A": "current",
    "V": "voltage",
    "T": "flux density",
}


@dataclass(frozen=True)
class EventLine:
    """Vertical line at a time [s]. No `variants`: of all."""

    time: float
    name: str = ""
    variants: tuple[str, ...] = ()


def reaches(event: EventLine, tables: Mapping[tuple[str, int], Signals]) -> bool:
    """Whether an event is in the recording of a case that has it."""
    return any(
        (not event.variants or variant in event.variants) and len(signals.time) and event.time <= signals.time[-1]
        for (variant, _), signals in tables.items()
    )


@lru_cache(maxsize=64)
def quantity_name(unit: str) -> str:
    """Return the quantity of a unit: `force` for mN; `value` for a number, empty for a unit that is in no table."""
    try:
        exponents = units.describe(unit).exponents
    except CouplingError:
        return ""
    if not any(exponents):
        return "value" if unit in ("", "1", "-") else "part"
    return next((name for symbol, name in QUANTITIES.items() if units.describe(symbol).exponents == exponents), "")


def draw_events(axis: Any, events: Iterable[EventLine], names: Sequence[str], factor: float, height: float) -> None:
    """Draw lines at the events of some variants, with their names; `factor`: seconds to the axis' unit, `height` [pt]."""
    left, right = axis.get_xlim()
    selected = sorted(
        (event.time * factor, event.name)
        for event in events
        if (not event.variants or set(event.variants) & set(names)) and left < event.time * factor < right
    )
    groups: list[tuple[float, list[str]]] = []
    are_numbers = all(name.isdigit() for _, name in selected)
    distance = MIN_NUMBER_DISTANCE if are_numbers else MIN_EVENT_DISTANCE
    for time, name in dict.fromkeys(selected):
        axis.axvline(time, color=EVENT_COLOR, linewidth=0.9, linestyle=":", zorder=1)
        if groups and time - groups[-1][0] < distance * (right - left):
            groups[-1][1].append(name)
        else:
            groups.append((time, [name]))
    for time, group_names in groups:
        lines = [line for name in dict.fromkeys(group_names) for line in wrap_name(name, int(height / LETTER_WIDTH))]
        axis.text(
            time,
            0.985,
            f"\N{NO-BREAK SPACE}{join_numbers(map(int, group_names))}" if are_numbers else "\n".join(lines),
            rotation=0 if are_numbers else 90,
            transform=axis.get_xaxis_transform(),
            fontsize=FONT_SIZE,
            color="#8a5a00",
            horizontalalignment="left",
            verticalalignment="top",
            linespacing=1.0,
            clip_on=True,
            zorder=4,
        )


def wrap_name(name: str, letters: int) -> list[str]:
    """Wrap a name at blanks, points and underscores; a value is not broken."""
    lines = [""]
    for word in re.findall(r"= .*|[^ ._]+[ ._]*", name.removeprefix("set ")):
        if lines[-1] and len(lines[-1] + word.rstrip()) > letters:
            lines.append("")
        lines[-1] += word
    return [line.rstrip() for line in lines]


def violating_values(
    violations: Iterable[Violation], signal: Any, case: tuple[str, int], points: tuple[Any, Any]
) -> list[Any]:
    """Return the violating values of a curve, the others NaN, for each violation of its case."""
    time, value = points
    masks = [
        violation.violating_samples(case, time, value)
        for violation in violations
        if case in violation.cases and violation.concerns(signal)
    ]
    return [np.where(mask & np.isfinite(value), value, np.nan) for mask in masks if mask.any()]


def draw_violation(axis: Any, x: Any, y: Any) -> None:
    """Draw the violating part of a curve, with a ring at each begin: a single sample is invisible as a line."""
    axis.plot(x, y, color=VIOLATION_COLOR, linewidth=2.0, solid_capstyle="round", zorder=5)
    is_finite = np.isfinite(y)
    begins = np.flatnonzero(is_finite & ~np.append(False, is_finite[:-1]))[:MAX_RINGS]
    axis.plot(
        x[begins], y[begins], "o", color=VIOLATION_COLOR, markersize=7, markerfacecolor="none", clip_on=False, zorder=6
    )


def draw_limits(axis: Any, violation: Violation, factor: float, heights: Iterable[float]) -> None:
    """Draw the limits of a violated expectation over its window."""
    left, right = axis.get_xlim()
    start, stop = violation.window.start_ns, violation.window.stop_ns
    begin = left if start is None else max(left, clock.seconds(start) * factor)
    end = right if stop is None else min(right, clock.seconds(stop) * factor)
    if begin >= end:
        return
    for height in heights:
        axis.plot(
            [begin, end], [height, height], color=VIOLATION_COLOR, linewidth=1.0, linestyle=(0, (2, 1.5)), zorder=4
        )
    axis.set_xlim(left, right)
