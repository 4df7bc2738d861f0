"""Metrics, expectations and plots of a scenario file, converted to coherent SI units."""

from __future__ import annotations

from copy import copy
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Self

from twin import clock
from twin.component import unit as units
from twin.errors import CouplingError
from twin.results import Analysis, Expectation, Metric, Plot, PlotCurve, Window, dimension
from twin.scenario.keys import quantities
from twin.scenario.keys.key_types import fraction
from twin.scenario.keys.schema import RunKeys
from twin.scenario.resolution.variable_names import nearest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.scenario.keys.schema import AnalysisKeys, ExpectKeys, MetricKeys, PlotKeys, ScenarioKeys, WindowKeys
    from twin.scenario.yaml_files.yaml_node import Node
    from twin.scene import Scene

RUN_FILES = ("summary.json", ".recording")  # beside the scenario.yaml of a run
Path = tuple[str | int, ...]


class Builder:
    """Converter of analyses, metrics, expectations, plots and scenes; collects their problems.

    `path`: of the entry that is converted; `what`: its name in messages.
    """

    def __init__(self, keys: ScenarioKeys, tree: Node, variants: list[str], metrics: Iterable[str]) -> None:
        self.keys = keys
        self.tree = tree
        self.variants = variants
        self.metrics = metrics  # all names in the file, including invalid metrics
        self.problems: list[str] = []
        self.late_windows: list[tuple[Builder, Window]] = []  # entries with windows that begin after the run
        self.path: Path = ()
        self.what = ""

    def at(self, path: Path, what: str) -> Self:
        """Return the converter of an entry."""
        entry = copy(self)
        entry.path, entry.what = path, what
        return entry

    def where(self, *keys: str | int) -> str:
        """Return file:line of the entry, or of a key of it."""
        return str(self.tree.find((*self.path, *keys)).location)

    def problem(self, message: str, *keys: str | int) -> None:
        """Add a problem of the entry, or of a key of it."""
        self.problems.append(f"{self.where(*keys)}: {self.what}: {message}")

    def si(self, raw: Any, unit: str, *keys: str | int, name: str = "", is_difference: bool = False) -> float | None:
        """Convert a value to SI; None if absent or invalid. `unit`: its display unit, which must have the same dimension.

        `name`: of the value in messages, after that of the entry.
        """
        try:
            return None if raw is None else quantities.si(raw, unit, f"{self.what}{name}", is_difference)
        except CouplingError as error:
            self.problems.append(f"{self.where(*keys)}: {error}")
            return None

    def unit(self, unit: str, key: str) -> str:
        """Return a unit; report an unknown one and return ""."""
        try:
            quantities.to_si(unit)
        except CouplingError:
            self.problem(f"unit `{unit}` is not known. {units.advice(unit)}", key)
            return ""
        return unit

    def existing_variants(self, names: Iterable[str], key: str, name: str = "") -> tuple[str, ...]:
        """Return the names that are variants; report the others and duplicates. `name`: of the key in messages."""
        names, entry = list(names), self.at(self.path, f"{self.what}{name}")
        for variant in names:
            if variant not in self.variants:
                entry.problem(f"there is no variant `{variant}`.{nearest(variant, self.variants)}", key)
        for variant in {variant for variant in names if names.count(variant) > 1}:
            entry.problem(f"variant `{variant}` is given twice. Keep one.", key)
        return tuple(variant for variant in names if variant in self.variants)

    def window(self, keys: WindowKeys) -> Window:
        """Create a time window; report one that is empty or outside the longest variant's run."""
        begin, end = self.keys.start_time, self.end
        start, stop = keys.start, keys.stop
        span = f"outside the run, {clock.text(begin)} to {clock.text(end or 0)}. Change it or stop_time."
        if start is not None and end is not None and start >= end:
            self.late_windows.append((self, Window(start, stop)))
        elif start is not None and start < begin:
            self.problem(f"from {clock.text(start)} lies {span}", "from")
        elif stop is not None and stop < begin:
            self.problem(f"to {clock.text(stop)} lies {span}", "to")
        elif start is not None and stop is not None and stop <= start:
            self.problem("to is not after from. Swap them.", "to")
        return Window(start, stop)

    def report_late_windows(self) -> None:
        """Add one problem for all windows that begin after the run, with the stop time that they need.

        None with a stop time of an option, also in the files of its run: these windows are not judged.
        """
        file = self.tree.find(("stop_time",)).location.file
        is_run = any(FilePath(file).with_name(name).exists() for name in RUN_FILES) and file.endswith("scenario.yaml")
        if not self.late_windows or file.startswith("--") or is_run:
            return
        first, _ = self.late_windows[0]
        starts = sorted({window.start_ns or 0 for _, window in self.late_windows})
        needed = max(window.stop_ns or window.start_ns or 0 for _, window in self.late_windows)
        more = len(self.late_windows) - 1
        subject, verb = (f" and {more} more", "lie") if more else ("", "lies")
        times = " or ".join(map(clock.text, starts))
        span = f"{clock.text(self.keys.start_time)} to {clock.text(self.end or 0)}"
        least = "at least" if needed > starts[-1] else "more than"
        trial = " For a short trial: a file that extends this one with metrics, expect and plots as `null`." * (
            more > 0
        )
        self.problems.append(
            f"{first.where('from')}: {first.what}{subject}: from {times} {verb} outside the run, {span}. "
            f"Change it or set stop_time to {least} {clock.text(needed)}.{trial}"
        )

    @property
    def end(self) -> clock.Time | None:
        """Stop time of the longest variant [ns]; None if the file does not set one."""
        base = self.keys.stop_time
        stops = [(self.keys.variants.get(name) or RunKeys()).stop_time or base for name in self.variants]
        return max((stop for stop in stops if stop is not None), default=None)

    def metric(self, name: str, keys: MetricKeys) -> Metric:
        """Create a metric with its reference values converted."""
        entry = self.at(("metrics", name), f"metrics.{name}")
        reference = keys.reference if isinstance(keys.reference, dict) else {}
        if keys.reference is not None and not isinstance(keys.reference, dict):
            reference = dict.fromkeys(self.variants, keys.reference)
        entry.existing_variants(reference, "reference", ".reference")
        unit = entry.unit(keys.unit, "unit") or first_unit(reference.values())
        if keys.tolerance is not None and not reference:
            entry.problem("a tolerance needs a figure to compare with. Add `reference`.", "tolerance")
        window = entry.window(keys)
        variants = entry.existing_variants(keys.variants, "variants", ".variants")
        metric = Metric(
            name,
            keys.signal,
            keys.reduce,
            window,
            unit,
            {},
            keys.tolerance,
            variants,
            keys.description,
            entry.where(),
            codes=keys.codes,
        )
        for variant, raw in reference.items():
            figure = entry.si(raw, unit, "reference", variant, name=".reference", is_difference=metric.is_difference)
            if figure is not None and variant in self.variants:
                metric.paper[variant] = figure
        return metric

    def expectation(self, index: int, keys: ExpectKeys, metrics: dict[str, Metric]) -> Expectation:
        """Create an expectation; report combinations of keys that are not allowed."""
        entry = self.at(("expect", index), f"expect {keys.name}".rstrip())
        metric = metrics.get(keys.metric or "")
        if keys.metric is not None and keys.metric not in self.metrics:
            entry.problem(f"no metric `{keys.metric}`.{nearest(keys.metric, self.metrics)}", "metric")
        if [keys.metric, keys.signal, keys.ends].count(None) != 2:
            entry.problem("give either `metric` or `signal`, or `ends`.")
        entry.check_combination(keys, metric)
        low, high = keys.within or (keys.at_least, keys.at_most)
        unit = entry.unit(keys.unit, "unit") or (metric.unit if metric else "") or first_unit((low, high))
        is_difference = (
            metric.is_difference if metric else keys.signal is not None and dimension.is_difference(keys.signal)
        )
        at_least, at_most = (
            entry.si(raw, unit, "within" if keys.within else key, is_difference=is_difference)
            for key, raw in (("at_least", low), ("at_most", high))
        )
        excluded = entry.existing_variants(keys.excluded, "except")
        variants = entry.existing_variants(keys.variants, "variants")
        if excluded:
            candidates = metric.variants if metric is not None and metric.variants else self.variants
            variants = tuple(name for name in candidates if name not in excluded)
            for key, names in {"variants": keys.variants, "ordered": keys.ordered}.items():
                if names:
                    entry.problem(f"`{key}` names the variants already. Leave `except` out.", "except")
            if not variants:
                entry.problem("no variant is left. Leave the expectation out.", "except")
        if at_least is not None and at_most is not None and at_least > at_most:
            entry.problem("the lower limit is above the upper one. Swap them.")
        return Expectation(
            keys.name,
            keys.metric,
            keys.signal,
            variants,
            at_least,
            at_most,
            entry.existing_variants(keys.ordered or (), "ordered"),
            keys.descending,
            entry.window(keys),
            keys.unit or first_unit((low, high)) or unit,
            keys.mean,
            entry.where(),
            keys.ends or "",
            is_difference,
            *entry.margin(keys.margin, unit),
            keys.nominal,
            excluded,
            entry.unlisted(keys, metric),
        )

    def check_combination(self, keys: ExpectKeys, metric: Metric | None) -> None:
        """Report keys of an expectation that cannot stand together."""
        limits = [key for key in ("at_least", "at_most", "within", "ordered") if getattr(keys, key) is not None]
        is_windowed = keys.start is not None or keys.stop is not None
        if keys.ends is not None and limits:
            self.problem(f"`ends` has no {limits[0]}. Give `from` and `to` for a stop.")
        if keys.ends == "completed" and is_windowed:
            self.problem("a run is completed at stop_time. Leave `from` and `to` out.")
        if not limits and keys.ends is None:
            self.problem("nothing is expected. Add at_least, at_most, within or ordered.")
        if len(limits) > 1 and set(limits) != {"at_least", "at_most"}:
            self.problem(f"{' and '.join(limits)} cannot stand together. Use two items.")
        if keys.ordered is not None and keys.signal is not None:
            self.problem("only metrics can be ordered. Name a metric.", "ordered")
        if keys.mean and (keys.metric is None or keys.ordered is not None):
            self.problem("the mean is that of a metric within limits. Name a metric.", "mean")
        if metric is not None and is_windowed:
            self.problem("a metric has its own from and to. Give them there.")
        key = "variants" if keys.variants else "ordered"
        for name in (keys.variants or keys.ordered or ()) if metric is not None and metric.variants else ():
            if name in self.variants and metric is not None and name not in metric.variants:
                variants = ", ".join(metric.variants)
                self.problem(f"`{metric.name}` is not taken in `{name}`, only in {variants}. Add it there.", key)
        if keys.margin is not None and keys.ordered is None:
            self.problem("a margin is that of an order. Add `ordered`, or leave it out.", "margin")

    def unlisted(self, keys: ExpectKeys, metric: Metric | None) -> tuple[str, ...]:
        """Return the variants of the scenario's own file that an inherited list of an expectation or its metric leaves out."""
        lists = [(*self.path, "variants")] * bool(keys.variants)
        lists += [("metrics", metric.name, "variants")] if metric is not None and metric.variants else []
        own_file = self.tree.location.file
        if all(self.tree.find(each).location.file == own_file for each in lists):
            return ()
        named = keys.variants or (metric.variants if metric else ())
        own = (name for name in self.variants if self.tree.find(("variants", name)).location.file == own_file)
        return tuple(name for name in own if name not in named)

    def margin(self, raw: Any, unit: str) -> tuple[float, float]:
        """Return the margin of an order: absolute in the metric's unit, and relative to the preceding value (`10 %`)."""
        is_part = isinstance(raw, str) and raw.rstrip().endswith("%")
        try:
            relative = fraction(raw) if is_part else 0.0
        except ValueError as error:
            self.problem(f"margin: {error}", "margin")
            relative = 0.0
        absolute = (None if is_part else self.si(raw, unit, "margin", name=": margin", is_difference=True)) or 0.0
        if absolute < 0.0:
            self.problem("the margin is below zero. Turn the order around instead.", "margin")
        return absolute, relative

    def plot(self, index: int, keys: PlotKeys) -> Plot:
        """Create a plot."""
        entry = self.at(("plots", index), f"plot `{keys.title}`")
        if (keys.xy is None) == (not keys.signals):
            entry.problem("give either `signals` or `xy: [x, y]`.")
        curves = tuple(PlotCurve(curve.signal, curve.label or curve.signal.text, curve.x) for curve in keys.signals)
        if len({curve.x is None for curve in curves}) > 1:
            entry.problem("some signals have an `x`. Give all of them one, or none.", "signals")
        if keys.xy is not None:
            curves = (PlotCurve(keys.xy[1], keys.xy[1].text, keys.xy[0]),)
        unit = entry.unit(keys.unit, "unit") or first_unit((*(keys.band or ()), *keys.lines))
        differs = bool(curves) and all(dimension.is_difference(curve.signal) for curve in curves)
        band, lines = (
            tuple(entry.si(raw, unit, key, name=f": {key}", is_difference=differs) for raw in values)
            for key, values in (("band", keys.band or ()), ("lines", keys.lines))
        )
        return Plot(
            keys.title,
            curves,
            keys.label,
            unit,
            keys.x_label,
            entry.unit(keys.x_unit, "x_unit"),
            entry.window(keys),
            keys.per == "variant",
            (band[0], band[1]) if len(band) == 2 and band[0] is not None and band[1] is not None else None,
            tuple(line for line in lines if line is not None),
            entry.existing_variants(keys.variants, "variants"),
            entry.where(),
            keys.points,
        )

    def analysis(self, name: str, keys: AnalysisKeys) -> Analysis:
        """Create an analysis."""
        entry = self.at(("analyses", name), f"analyses.{name}")
        if name in self.keys.members:
            entry.problem("a member has this name already. Choose another.")
        variants = entry.existing_variants(keys.variants, "variants", ".variants")
        return Analysis(name, keys.function, keys.inputs, entry.window(keys), variants, entry.where())


def first_unit(values: Iterable[Any]) -> str:
    """Return the unit of the first value that has one, as the display unit; "" if none."""
    for raw in values:
        parts = quantities.split(raw) if isinstance(raw, str) else None
        if parts and parts[1]:
            return parts[1]
    return ""


def figures(
    keys: ScenarioKeys, tree: Node, variants: list[str], names: Iterable[str]
) -> tuple[tuple[Analysis, ...], dict[str, Metric], tuple[Expectation, ...], tuple[Plot, ...], list[str]]:
    """Create analyses, metrics, expectations and plots; returns them and their problems."""
    builder = Builder(keys, tree, variants, names)
    metrics = {name: builder.metric(name, item_keys) for name, item_keys in keys.metrics.items()}
    expectations = tuple(builder.expectation(index, item_keys, metrics) for index, item_keys in enumerate(keys.expect))
    plots = tuple(builder.plot(index, item_keys) for index, item_keys in enumerate(keys.plots))
    analyses = tuple(builder.analysis(name, item_keys) for name, item_keys in keys.analyses.items())
    builder.report_late_windows()
    return analyses, metrics, expectations, plots, builder.problems


def scenes(keys: ScenarioKeys, tree: Node, variants: list[str]) -> tuple[tuple[Scene, ...], list[str]]:
    """Create scenes; returns them and the problems of the scenes and their environments."""
    if not keys.scenes:
        return (), []
    from twin.scenario.keys.scene_keys import scene

    builder = Builder(keys, tree, variants, ())
    made = tuple(scene(builder, index, scene_keys) for index, scene_keys in enumerate(keys.scenes))
    builder.report_late_windows()
    return made, builder.problems
