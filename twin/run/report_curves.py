"""Curves of a report for its page: plots as panes of `chart.js`, reduced to what a screen shows."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import unit as units
from twin.results import consecutive_spans, dimension, join_numbers, plotting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from twin.results import EventLine, Plot, PlotCurve, Signals, Violation
    from twin.web import PackedArrays

    Tables = Mapping[tuple[str, int], Signals]
    Points = tuple[NDArray[Any], NDArray[Any]]

MAX_POINTS = 100_000  # of a curve
MIN_POINTS = 400  # of a curve, however many there are
MAX_VALUES = 1_200_000  # of all curves of a report, with the ranges of their seeds: about 3 MB
MAX_PANES = 6  # below each other
DASHES: tuple[list[int], ...] = ([], [6, 3], [2, 2], [8, 3, 2, 3])  # of `plotting.LINE_STYLES`


def quantize(values: NDArray[Any]) -> NDArray[Any]:
    """Round to a power of two below 1/65,536 of the range: numbers with few digits deflate to a third."""
    finite = np.asarray(values, float)[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    step = 2.0 ** np.floor(np.log2(span / 65536)) if span else 0.0
    return np.rint(np.asarray(values, float) / step) * step if step else np.asarray(values, float)


def points_per_curve(plots: Iterable[Plot], tables: Tables) -> int:
    """Return the number of points of each curve so that a report does not become too large."""
    lines: list[tuple[int, int]] = []  # number of lines, samples of each
    for plot in plots:
        selected = plotting.selected_tables(plot, tables)
        seeds = Counter(variant for variant, _ in selected)
        samples = {variant: len(signals.time) for (variant, _), signals in selected.items()}
        lines += [(len(plot.curves) * (1 if seeds[name] == 1 else 3), samples[name]) for name in seeds]
    low, high = MIN_POINTS, MAX_POINTS
    while low < high:
        middle = (low + high + 1) // 2
        is_small = sum(count * min(size, middle) for count, size in lines) <= MAX_VALUES
        low, high = (middle, high) if is_small else (low, middle - 1)
    return low


def plot_charts(
    plot: Plot,
    tables: Tables,
    violations: Sequence[Violation],
    arrays: PackedArrays,
    points: int,
    codes: Mapping[str, Mapping[int, str]] = MappingProxyType({}),
) -> Any:
    """Return the charts of a plot, each a list of panes; none for plots of single points. `codes`: see `PaneBuilder`.

    Panels over time are panes of one chart, many of them of two charts side by side; loops are charts of their own.
    """
    if plot.points:
        return []
    panels = plotting.plot_panels(plot, tables)
    builders = [PaneBuilder(plot, names, tables, violations, arrays, points, codes) for names in panels]
    panes = [builder.build(len(panels) > 1) for builder in builders]
    are_codes = all(plotting.curve_kind(curve, tables) for curve in plot.curves)
    if (plot.band or are_codes) and not plotting.is_loop_plot(plot):
        shared = shared_extent([value for builder in builders for value in builder.extremes], panes)
        panes = [pane | shared for pane in panes]
    if plotting.is_loop_plot(plot):
        return [[pane] for pane in panes]
    half = len(panes) if len(panes) <= MAX_PANES else -(-len(panes) // 2)
    return [part for part in (panes[:half], panes[half:]) if part]


@dataclass
class PaneBuilder:
    """Builder of a pane: curves of some variants, the first seed as a line, all seeds as an area.

    `codes`: names of the values of signals that are codes, by the texts of the signals. `thinned_to`: longest time between
    the samples that are left of a curve [s]; 0 if all are.
    """

    plot: Plot
    names: list[str]
    tables: Tables
    violations: Sequence[Violation]
    arrays: PackedArrays
    points: int
    codes: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    thinned_to: float = 0.0
    extremes: list[float] = field(default_factory=list)  # smallest and largest value of each curve [unit of the axis]

    def build(self, is_titled: bool) -> dict[str, Any]:
        """Return the pane."""
        plot, is_loop = self.plot, plotting.is_loop_plot(self.plot)
        selected = {case: signals for case, signals in self.tables.items() if case[0] in self.names}
        curves, spans, times = [], [], []
        for name in self.names:
            for number, curve in enumerate(plot.curves):
                seeds = {case: signals for case, signals in selected.items() if case[0] == name}
                recorded = {
                    case: points
                    for case, signals in seeds.items()
                    if (points := plotting.curve_points(curve, plot, signals)) is not None
                }
                if recorded:
                    curves.append(self.curve(curve, number, name, list(recorded.values())))
                if not is_loop:
                    times += [float(time[end]) for time, _ in recorded.values() for end in (0, -1)]
                    spans += [
                        span for case, points in recorded.items() for span in self.violating_spans(curve, case, points)
                    ]
        pane: dict[str, Any] = {"title": "", "unit": units.shown(plot.unit), "curves": curves}
        if len(self.names) == 1:
            (case, *others) = selected
            title = f"{case[0]}, seed {case[1]}" if others else case[0]
            has_title = is_titled or len({variant for variant, _ in self.tables}) > 1
            pane |= {"case": case, "title": title if has_title else ""}
        if is_loop:
            return {
                **pane,
                "own": True,
                "x": {"label": self.x_label, "unit": f"[{units.shown(plot.x_unit)}]" * bool(plot.x_unit)},
            }
        convert = self.to_axis
        return {
            **pane,
            "lines": [convert(value) for value in plot.lines],
            "spans": [{"from": begin, "to": end} for begin, end in sorted(set(spans))],
            "limits": self.limits(selected),
            "thinned": self.thinned_to,
            "reach": (min(times), max(times)) if times else None,
        }

    @property
    def x_label(self) -> str:
        """Label of the axis of a loop."""
        first = self.plot.curves[0]
        return self.plot.x_label or (first.x.text if first.x else "")

    def to_axis(self, value: float) -> float:
        """Convert a limit [SI] to the unit of the axis."""
        return float(plotting.to_unit(value, self.plot.unit, self.plot.is_difference))

    def curve(self, curve: PlotCurve, number: int, variant: str, recorded: list[Points]) -> dict[str, Any]:
        """Return a curve; `recorded`: its points of each seed."""
        plot = self.plot
        label, color, style = plotting.curve_style(plot, self.names, variant, number)
        time = np.asarray(recorded[0][0])
        in_unit = [plotting.to_unit(y, plot.unit, dimension.is_difference(curve.signal)) for _, y in recorded]
        self.extremes += [float(bound) for y in in_unit for bound in (np.fmin.reduce(y), np.fmax.reduce(y))]
        entry: dict[str, Any] = {"label": label, "color": color, "dash": DASHES[style]}
        if curve.x is not None:
            x = plotting.to_unit(time, plot.x_unit, dimension.is_difference(curve.x))
            points = plotting.thin_loop(x, in_unit[0], self.points)
            return {**entry, "name": " ".join(str(self.arrays.index(quantize(values))) for values in points)}
        entry["step"] = bool(plotting.curve_kind(curve, self.tables))
        if names := self.codes.get(curve.signal.text):
            entry["codes"] = names
        lines = {"name": np.asarray(in_unit[0], float)}
        if len(recorded) > 1:
            lines |= seed_range(time, [(x, y) for (x, _), y in zip(recorded, in_unit, strict=True)])
        samples = extreme_samples(list(lines.values()), self.points)
        if len(samples) < len(time):
            self.thinned_to = max(self.thinned_to, float(np.diff(time[samples]).max()))
        return entry | {name: self.add(time[samples], y[samples]) for name, y in lines.items()}

    def add(self, time: NDArray[Any], values: NDArray[Any]) -> str:
        """Return the name of a curve over time of the page: the indices of its arrays, and the unit of the first one [ns]."""
        instants = np.rint(time * clock.NANOSECONDS).astype(np.int64)  # exact, since a time names a sample
        step = int(np.gcd.reduce(instants)) or 1
        return f"{self.arrays.index((instants // step).astype(float))} {self.arrays.index(quantize(values))} {step}"

    def violating_spans(self, curve: PlotCurve, case: tuple[str, int], points: Points) -> Iterable[tuple[float, float]]:
        """Return the spans in which a curve violates an expectation [s]."""
        time, value = points
        for violation in self.violations:
            if case in violation.cases and violation.concerns(curve.signal):
                yield from consecutive_spans(time, violation.violating_samples(case, time, value))

    def limits(self, selected: Tables) -> list[dict[str, Any]]:
        """Return the edges of the band, and the limits of violated expectations over their windows."""
        first = min(float(signals.time[0]) for signals in selected.values())
        last = max(float(signals.time[-1]) for signals in selected.values())
        edges = [{"y": self.to_axis(edge), "from": first, "to": last, "failed": False} for edge in self.plot.band or ()]
        return edges + [
            {
                "y": self.to_axis(limit),
                "from": first if violation.window.start_ns is None else clock.seconds(violation.window.start_ns),
                "to": last if violation.window.stop_ns is None else clock.seconds(violation.window.stop_ns),
                "failed": True,
            }
            for violation in self.violations
            if set(violation.variants) & set(self.names)
            and any(violation.concerns(curve.signal) for curve in self.plot.curves)
            for limit in violation.limits
        ]


def shared_extent(extremes: Sequence[float], panes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return `extent`, the range of the curves and lines of all panes, and `shared`, the violated limits of all: one axis.

    Which limits are inside is decided by the chart (`verticalRange` of painter.js). Empty without a finite range.
    """
    values = [value for value in extremes if np.isfinite(value)] + [line for pane in panes for line in pane["lines"]]
    if not values or min(values) == max(values):
        return {}
    limits = {limit["y"] for pane in panes for limit in pane["limits"] if limit["failed"]}
    return {"extent": [min(values), max(values)], "shared": sorted(limits)}


def seed_range(time: NDArray[Any], seeds: Sequence[Points]) -> dict[str, NDArray[Any]]:
    """Return the smallest and the largest values of all seeds, `low` and `high`, at the times of the first one."""
    values = np.stack([y if len(x) == len(time) else np.interp(time, x, y) for x, y in seeds]).astype(float)
    return {"low": np.fmin.reduce(values), "high": np.fmax.reduce(values)}


def extreme_samples(lines: Sequence[NDArray[Any]], points: int) -> NDArray[np.intp]:
    """Return indices of at most `points` samples that keep the extremes of each part of each line.

    All lines are read at the same samples, so that what lies between two others stays there.
    """
    count = len(lines[0])
    if count <= points:
        return np.arange(count)
    parts = max((points - 2) // (2 * len(lines)), 1)
    size = -(-count // parts)
    begins, picked = size * np.arange(parts), [np.array([0, count - 1])]
    for line in lines:
        for sign in (1.0, -1.0):
            signed = np.where(np.isnan(line), np.inf, sign * line)  # not a number is no extreme
            padded = np.pad(signed, (0, size * parts - count), mode="edge")
            picked.append(begins + padded.reshape(parts, size).argmin(axis=1))
    return np.unique(np.minimum(np.concatenate(picked), count - 1))


def event_marks(events: Mapping[int, EventLine]) -> list[dict[str, Any]]:
    """Return numbered events as marks of a chart; those at one time share a mark. `variants`: whose they are; empty: of all."""
    numbers: dict[float, list[int]] = {}
    for number, event in events.items():
        numbers.setdefault(event.time, []).append(number)
    marks = []
    for time, group in numbers.items():
        variants = [events[number].variants for number in group]
        names = sorted({name for each in variants for name in each}) if all(variants) else []
        marks.append({"at": time, "text": join_numbers(group), "variants": names})
    return marks
