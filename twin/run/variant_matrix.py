"""Matrix of metrics of many variants: one row for each variant, sortable and filterable, or one for each of more metrics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin import clock
from twin.results import join_numbers, metric_formats, si_conversion
from twin.run.report import metric_definition

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results import Evaluation, EventLine, Metric, MetricFormat, MetricResult, Plot, Violation

FAILED = ("fail", "none")  # verdicts of metrics
MIN_VARIANTS, MAX_ROWS = 5, 24  # a list of fewer variants, or of no more rows, is readable at a glance


@dataclass(frozen=True)
class MatrixCell:
    """Metric of a variant. `value`: in the unit of its column, for sorting; None if there is none. `notes`: below its text."""

    text: str = ""
    notes: tuple[str, ...] = ()
    value: float | None = None
    verdict: str = ""


@dataclass(frozen=True)
class MatrixRow:
    """Row of a variant: its metrics, and the names of its failed expectations and metrics."""

    variant: str
    cells: tuple[MatrixCell, ...]
    failures: tuple[str, ...]


@dataclass(frozen=True)
class Matrix:
    """Title, unit, description and definition of each column, and the rows."""

    columns: tuple[tuple[str, str, str, str], ...] = ()
    rows: tuple[MatrixRow, ...] = ()

    @property
    def is_large(self) -> bool:
        """Whether there are so many variants, or metrics of several variants, that a list of them is too long."""
        return len(self.rows) >= MIN_VARIANTS or (len(self.rows) > 1 and len(self.rows) * len(self.columns) > MAX_ROWS)

    @property
    def is_wide(self) -> bool:
        """Whether it has more metrics than variants, so that metrics are its rows."""
        return len(self.columns) >= len(self.rows)


def remarks_on_cell(result: MetricResult, plots: Iterable[Plot], events: Iterable[EventLine]) -> list[str]:
    """Return the events of its variant alone in the window of a metric, and the band of a plot that an extreme value leaves."""
    metric, window = result.metric, result.metric.window
    own = [
        number
        for number, event in enumerate(events, 1)
        if result.variant in event.variants and window.start_ns is not None and window.stop_ns is not None
        if clock.seconds(window.start_ns) < event.time < clock.seconds(window.stop_ns)
    ]
    texts = [f"with event{'s' * (len(own) > 1)} {join_numbers(own)}"] * bool(own)
    for plot in plots if metric.reduce in ("min", "max") else ():
        is_own = any(curve.signal.text == metric.signal.text for curve in plot.curves)
        if is_own and plot.band and result.mean is not None and not plot.band[0] <= result.mean <= plot.band[1]:
            texts.append(f"outside of {' to '.join(map(plot.shown, plot.band))}, not judged")
            break
    return texts


def matrix_cell(result: MetricResult, style: MetricFormat, verdict: str, remarks: Iterable[str] = ()) -> MatrixCell:
    """Return the mean of a metric of a variant with its worst seed, its published value, the ratio of both, and remarks."""
    metric = result.metric
    factor, offset = si_conversion(metric.unit, metric.is_difference)
    if result.mean is None:
        return MatrixCell("no value", verdict=verdict)
    seeds = [value for value in result.values.values() if value is not None]
    text, worst, low, high = (
        style.number(value, result.scale) for value in (result.mean, result.worst, min(seeds), max(seeds))
    )
    notes = [f"worst {worst}"] * (worst != text) if metric.has_worst else [f"seeds {low} to {high}"] * (low != high)
    if result.paper is not None:
        tolerance = "" if metric.tolerance is None else f" ± {100 * metric.tolerance:g} %"
        notes.append(f"paper {style.reference(result.paper).removesuffix(style.label).rstrip()}{tolerance}")
        mark = {"pass": " ✓", "fail": " ✗"}.get(result.verdict, "")
        notes += [f"ratio {result.ratio:.2f}{mark}"] * (result.ratio is not None)
    return MatrixCell(metric.named(result.mean, text), (*notes, *remarks), (result.mean - offset) / factor, verdict)


def build_matrix(
    evaluation: Evaluation,
    violations: Sequence[Violation],
    order: Sequence[str] = (),
    plots: Sequence[Plot] = (),
    events: Sequence[EventLine] = (),
) -> Matrix:
    """Collect the means of all metrics of all variants; rows with failures come first, and metrics with a reference value.

    `order`: of the variants. `plots` and `events`: for the remarks on values that are not judged.
    """
    by_weight = sorted(
        evaluation.metric_results, key=lambda result: (result.verdict not in FAILED, result.paper is None)
    )
    metrics: dict[str, Metric] = {result.metric.name: result.metric for result in by_weight}
    results = {(result.variant, result.metric.name): result for result in evaluation.metric_results}
    formats = metric_formats(evaluation.metric_results)
    failed_names: dict[str, list[str]] = {}
    failed_cells = {(variant, violation.metric) for violation in violations for variant in violation.variants}
    for violation in violations:
        for variant in violation.variants:
            failed_names.setdefault(variant, []).append(violation.name)
    rows = []
    names = dict.fromkeys([*(result.variant for result in evaluation.metric_results), *failed_names])
    for variant in dict.fromkeys([*(name for name in order if name in names), *names]):
        cells = []
        for name in metrics:
            result = results.get((variant, name))
            if result is None:
                cells.append(MatrixCell())
                continue
            verdict = "fail" if (variant, name) in failed_cells else result.verdict
            is_judged = any(variant in each.variants and each.concerns(result.metric.signal) for each in violations)
            remarks = remarks_on_cell(result, () if is_judged else plots, events)
            cells.append(matrix_cell(result, formats[name], verdict, remarks))
        failed_metrics = [
            name for name in metrics if (variant, name) in results and results[variant, name].verdict in FAILED
        ]
        rows.append(MatrixRow(variant, tuple(cells), (*failed_names.get(variant, ()), *failed_metrics)))
    columns = tuple(
        (name, formats[name].label, metric.description, metric_definition(metric)) for name, metric in metrics.items()
    )
    is_wide = Matrix(columns, tuple(rows)).is_wide  # then variants are columns, in the order of the scenario
    return Matrix(columns, tuple(rows if is_wide else sorted(rows, key=lambda row: not row.failures)))
