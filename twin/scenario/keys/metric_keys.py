"""Metrics, expectations and plots of a scenario file, converted to coherent SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin import clock
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


class Builder:
    """Converter of analyses, metrics, expectations, plots and scenes; collects their problems."""

    def __init__(self, keys: ScenarioKeys, tree: Node, variants: list[str], metrics: Iterable[str]) -> None:
        self.keys = keys
        self.tree = tree
        self.variants = variants
        self.metrics = metrics  # all names in the file, including invalid metrics
        self.problems: list[str] = []
        self.late_windows: list[tuple[tuple[str | int, ...], str, Window]] = []  # that begin after the run

    def problem(self, path: tuple[str | int, ...], message: str) -> None:
        """Add a problem at a path of the tree."""
        self.problems.append(f"{self.tree.find(path).location}: {message}")

    def si(
        self, path: tuple[str | int, ...], raw: Any, unit: str, what: str, is_difference: bool = False
    ) -> float | None:
        """Convert a value to SI; None if absent or invalid. `unit`: its display unit, which must have the same dimension."""
        try:
            return None if raw is None else quantities.si(raw, unit, what, is_difference)
        except CouplingError as error:
            self.problem(path, str(error))
            return None

    def unit(self, path: tuple[str | int, ...], unit: str, what: str) -> str:
        """Return a unit; report an unknown one and return ""."""
        try:
            quantities.to_si(unit)
        except CouplingError:
            self.problem(path, f"{what}: unit `{unit}` is not known. Write it like N, mm/s, mm/(s*N), deg.")
            return ""
        return unit

    def existing_variants(self, path: tuple[str | int, ...], names: Iterable[str], what: str) -> tuple[str, ...]:
        """Return the names that are variants; report the others and duplicates."""
        names = list(names)
        for name in names:
            if name not in self.variants:
                self.problem(path, f"{what}: there is no variant `{name}`.{nearest(name, self.variants)}")
        for name in {name for name in names if names.count(name) > 1}:
            self.problem(path, f"{what}: variant `{name}` is given twice. Keep one.")
        return tuple(name for name in names if name in self.variants)

    def window(self, path: tuple[str | int, ...], keys: WindowKeys, what: str) -> Window:
        """Create a time window; report one that is empty or outside the longest variant's run."""
        begin, end = self.keys.start_time, self.end
        start, stop = keys.start, keys.stop
        span = f"outside the run, {clock.text(begin)} to {clock.text(end or 0)}. Change it or stop_time."
        if start is not None and end is not None and start >= end:
            self.late_windows.append(((*path, "from"), what, Window(start, stop)))
        elif start is not None and start < begin:
            self.problem((*path, "from"), f"{what}: from {clock.text(start)} lies {span}")
        elif stop is not None and stop < begin:
            self.problem((*path, "to"), f"{what}: to {clock.text(stop)} lies {span}")
        elif start is not None and stop is not None and stop <= start:
            self.problem((*path, "to"), f"{what}: to is not after from. Swap them.")
        return Window(start, stop)

    def report_late_windows(self) -> None:
        """Add one problem for all windows that begin after the run, with the stop time that they need."""
        if not self.late_windows:
            return
        path, what, _ = self.late_windows[0]
        starts = sorted({window.start_ns or 0 for _, _, window in self.late_windows})
        needed = max(window.stop_ns or window.start_ns or 0 for _, _, window in self.late_windows)
        more = len(self.late_windows) - 1
        subject, verb = (f"{what} and {more} more", "lie") if more else (what, "lies")
        times = " or ".join(map(clock.text, starts))
        span = f"{clock.text(self.keys.start_time)} to {clock.text(self.end or 0)}"
        least = "at least" if needed > starts[-1] else "more than"
        self.problem(
            path,
            f"{subject}: from {times} {verb} outside the run, {span}. Change it or set stop_time to {least} {clock.text(needed)}.",
        )

    @property
    def end(self) -> clock.Time | None:
        """Stop time of the longest variant [ns]; None if the file does not set one."""
        base = self.keys.stop_time
        stops = [(self.keys.variants.get(name) or RunKeys()).stop_time or base for name in self.variants]
        return max((stop for stop in stops if stop is not None), default=None)

    def metric(self, name: str, keys: MetricKeys) -> Metric:
        """Create a metric with its reference values converted."""
        path, what = ("metrics", name), f"metrics.{name}"
        reference = keys.reference if isinstance(keys.reference, dict) else {}
        if keys.reference is not None and not isinstance(keys.reference, dict):
            reference = dict.fromkeys(self.variants, keys.reference)
        self.existing_variants((*path, "reference"), reference, f"{what}.reference")
        unit = self.unit((*path, "unit"), keys.unit, what) or first_unit(reference.values())
        if keys.tolerance is not None and not reference:
            self.problem((*path, "tolerance"), f"{what}: a tolerance needs a figure to compare with. Add `reference`.")
        window = self.window(path, keys, what)
        where = str(self.tree.find(path).location)
        variants = self.existing_variants((*path, "variants"), keys.variants, f"{what}.variants")
        metric = Metric(
            name, keys.signal, keys.reduce, window, unit, {}, keys.tolerance, variants, keys.description, where
        )
        for variant, raw in reference.items():
            figure = self.si((*path, "reference", variant), raw, unit, f"{what}.reference", metric.is_difference)
            if figure is not None and variant in self.variants:
                metric.paper[variant] = figure
        return metric

    def expectation(self, index: int, keys: ExpectKeys, metrics: dict[str, Metric]) -> Expectation:
        """Create an expectation; report combinations of keys that are not allowed."""
        path, what = ("expect", index), f"expect {keys.name}".rstrip()
        metric = metrics.get(keys.metric or "")
        if keys.metric is not None and keys.metric not in self.metrics:
            self.problem((*path, "metric"), f"{what}: no metric `{keys.metric}`.{nearest(keys.metric, self.metrics)}")
        if [keys.metric, keys.signal, keys.ends].count(None) != 2:
            self.problem(path, f"{what}: give either `metric` or `signal`, or `ends`.")
        self.check_combination(path, keys, metric, what)
        low, high = keys.within or (keys.at_least, keys.at_most)
        unit = self.unit((*path, "unit"), keys.unit, what) or (metric.unit if metric else "") or first_unit((low, high))
        is_difference = (
            metric.is_difference if metric else keys.signal is not None and dimension.is_difference(keys.signal)
        )
        at_least = self.si((*path, "within" if keys.within else "at_least"), low, unit, what, is_difference)
        at_most = self.si((*path, "within" if keys.within else "at_most"), high, unit, what, is_difference)
        excluded = self.existing_variants((*path, "except"), keys.excluded, what)
        variants = self.existing_variants((*path, "variants"), keys.variants, what)
        if excluded:
            candidates = metric.variants if metric is not None and metric.variants else self.variants
            variants = tuple(name for name in candidates if name not in excluded)
            for key, names in {"variants": keys.variants, "ordered": keys.ordered}.items():
                if names:
                    self.problem((*path, "except"), f"{what}: `{key}` names the variants already. Leave `except` out.")
            if not variants:
                self.problem((*path, "except"), f"{what}: no variant is left. Leave the expectation out.")
        if at_least is not None and at_most is not None and at_least > at_most:
            self.problem(path, f"{what}: the lower limit is above the upper one. Swap them.")
        return Expectation(
            keys.name,
            keys.metric,
            keys.signal,
            variants,
            at_least,
            at_most,
            self.existing_variants((*path, "ordered"), keys.ordered or (), what),
            keys.descending,
            self.window(path, keys, what),
            keys.unit or first_unit((low, high)) or unit,
            keys.mean,
            str(self.tree.find(path).location),
            keys.ends or "",
            is_difference,
            *self.margin(path, keys, unit, what),
            keys.nominal,
            excluded,
            self.unlisted(path, keys, metric),
        )

    def check_combination(
        self, path: tuple[str | int, ...], keys: ExpectKeys, metric: Metric | None, what: str
    ) -> None:
        """Report keys of an expectation that cannot stand together."""
        limits = [key for key in ("at_least", "at_most", "within", "ordered") if getattr(keys, key) is not None]
        if keys.ends is not None and limits:
            self.problem(path, f"{what}: `ends` has no {limits[0]}. Give `from` and `to` for a stop.")
        if keys.ends == "completed" and (keys.start is not None or keys.stop is not None):
            self.problem(path, f"{what}: a run is completed at stop_time. Leave `from` and `to` out.")
        if not limits and keys.ends is None:
            self.problem(path, f"{what}: nothing is expected. Add at_least, at_most, within or ordered.")
        if len(limits) > 1 and set(limits) != {"at_least", "at_most"}:
            self.problem(path, f"{what}: {' and '.join(limits)} cannot stand together. Use two items.")
        if keys.ordered is not None and keys.signal is not None:
            self.problem((*path, "ordered"), f"{what}: only metrics can be ordered. Name a metric.")
        if keys.mean and (keys.metric is None or keys.ordered is not None):
            self.problem((*path, "mean"), f"{what}: the mean is that of a metric within limits. Name a metric.")
        if metric is not None and (keys.start is not None or keys.stop is not None):
            self.problem(path, f"{what}: a metric has its own from and to. Give them there.")
        if metric is not None and metric.variants:
            self.check_variants(path, keys, metric, what)
        if keys.margin is not None and keys.ordered is None:
            self.problem((*path, "margin"), f"{what}: a margin is that of an order. Add `ordered`, or leave it out.")

    def unlisted(self, path: tuple[str | int, ...], keys: ExpectKeys, metric: Metric | None) -> tuple[str, ...]:
        """Return the variants of the scenario's own file that an inherited list of an expectation or its metric leaves out."""
        lists = [(*path, "variants")] * bool(keys.variants)
        lists += [("metrics", metric.name, "variants")] if metric is not None and metric.variants else []
        own_file = self.tree.location.file
        if all(self.tree.find(each).location.file == own_file for each in lists):
            return ()
        named = keys.variants or (metric.variants if metric else ())
        own = (name for name in self.variants if self.tree.find(("variants", name)).location.file == own_file)
        return tuple(name for name in own if name not in named)

    def check_variants(self, path: tuple[str | int, ...], keys: ExpectKeys, metric: Metric, what: str) -> None:
        """Report variants of an expectation in which its metric is not taken."""
        key = "variants" if keys.variants else "ordered"
        for name in keys.variants or keys.ordered or ():
            if name in self.variants and name not in metric.variants:
                metric_variants = ", ".join(metric.variants)
                self.problem(
                    (*path, key),
                    f"{what}: `{metric.name}` is not taken in `{name}`, only in {metric_variants}. Add it there.",
                )

    def margin(self, path: tuple[str | int, ...], keys: ExpectKeys, unit: str, what: str) -> tuple[float, float]:
        """Return the margin of an order: absolute in the metric's unit, and relative to the preceding value (`10 %`)."""
        raw = keys.margin
        is_part = isinstance(raw, str) and raw.rstrip().endswith("%")
        try:
            relative = fraction(raw) if is_part else 0.0
        except ValueError as error:
            self.problem((*path, "margin"), f"{what}: margin: {error}")
            relative = 0.0
        absolute = (None if is_part else self.si((*path, "margin"), raw, unit, f"{what}: margin", True)) or 0.0
        if absolute < 0.0:
            self.problem((*path, "margin"), f"{what}: the margin is below zero. Turn the order around instead.")
        return absolute, relative

    def plot(self, index: int, keys: PlotKeys) -> Plot:
        """Create a plot."""
        path, what = ("plots", index), f"plot `{keys.title}`"
        if (keys.xy is None) == (not keys.signals):
            self.problem(path, f"{what}: give either `signals` or `xy: [x, y]`.")
        curves = tuple(
            PlotCurve(curve_keys.signal, curve_keys.label or curve_keys.signal.text, curve_keys.x)
            for curve_keys in keys.signals
        )
        if any(curve_keys.x for curve_keys in keys.signals) and not all(curve_keys.x for curve_keys in keys.signals):
            self.problem((*path, "signals"), f"{what}: some signals have an `x`. Give all of them one, or none.")
        if keys.xy is not None:
            curves = (PlotCurve(keys.xy[1], keys.xy[1].text, keys.xy[0]),)
        unit = self.unit((*path, "unit"), keys.unit, what) or first_unit((*(keys.band or ()), *keys.lines))
        differs = bool(curves) and all(dimension.is_difference(curve.signal) for curve in curves)
        band = [self.si((*path, "band"), raw, unit, f"{what}: band", differs) for raw in keys.band or ()]
        lines = [self.si((*path, "lines"), raw, unit, f"{what}: lines", differs) for raw in keys.lines]
        return Plot(
            keys.title,
            curves,
            keys.label,
            unit,
            keys.x_label,
            self.unit((*path, "x_unit"), keys.x_unit, what),
            self.window(path, keys, what),
            keys.per == "variant",
            (band[0], band[1]) if len(band) == 2 and band[0] is not None and band[1] is not None else None,
            tuple(line for line in lines if line is not None),
            self.existing_variants((*path, "variants"), keys.variants, what),
            str(self.tree.find(path).location),
            keys.points,
        )

    def analysis(self, name: str, keys: AnalysisKeys) -> Analysis:
        """Create an analysis."""
        path, what = ("analyses", name), f"analyses.{name}"
        if name in self.keys.members:
            self.problem(path, f"{what}: a member has this name already. Choose another.")
        variants = self.existing_variants((*path, "variants"), keys.variants, f"{what}.variants")
        window, where = self.window(path, keys, what), str(self.tree.find(path).location)
        return Analysis(name, keys.function, keys.inputs, window, variants, where)


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
