"""Charts of failed metrics for a report: values of variants and seeds beside the limits, or beside the margin of an order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.results import figure_files, metric_formats, plot_annotations, plotting, source_analyses
from twin.run.report_figure import ReportFigure

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results import Analysis, Evaluation, Expectation, MetricFormat, MetricResult

WIDTH = 4.0  # [inch]: legible at 360 px
MAX_ROWS = 12  # variants of a chart


def draw_metric_charts(
    expectations: Iterable[Expectation], evaluation: Evaluation, analyses: Sequence[Analysis] = ()
) -> list[ReportFigure]:
    """Draw each failed expectation of a metric that no single sample of a recorded signal violates."""
    formats = metric_formats(evaluation.metric_results)
    figures = []
    for expectation, outcome in zip(expectations, evaluation.expectation_results, strict=False):
        results = {result.variant: result for result in evaluation.metric_results if expectation.judges(result)}
        if outcome.verdict != "fail" or not results:
            continue
        metric = next(iter(results.values())).metric
        if not expectation.is_aggregate(metric) and not source_analyses(analyses, metric.signal):
            continue
        rows = [results[name] for name in expectation.ordered or results if name in results]
        style = formats[rows[0].metric.name]
        more = len(rows) - MAX_ROWS
        notes = [
            "dots: means, light: seeds",
            "red: limits that the means must meet" if expectation.ordered else "red: limits",
        ]
        figures.append(
            ReportFigure(
                f"Failed: {outcome.name}",
                chart_svg(expectation, rows[:MAX_ROWS], style),
                "; ".join(
                    [rows[0].metric.description or rows[0].metric.name, *notes, *[f"{more} more variants"] * (more > 0)]
                ),
                violations=(outcome.name,),
            )
        )
    return figures


def chart_svg(expectation: Expectation, rows: Sequence[MetricResult], style: MetricFormat) -> str:
    """Draw a row for each variant: its mean, its seeds, and its own limit or those of all."""
    metric = rows[0].metric

    def in_unit(value: float) -> float:
        return float(plotting.to_unit(value, style.unit, metric.is_difference))

    def draw(grid: Any) -> None:
        axis = grid[0, 0]
        for row, result in enumerate(rows):
            seeds = [in_unit(value) for value in result.values.values() if value is not None]
            axis.plot(seeds, [row] * len(seeds), "o", color=plotting.COLORS[0], alpha=0.3, markeredgewidth=0)
            if result.mean is not None:
                axis.plot(in_unit(result.mean), row, "o", color=plotting.COLORS[0])
                axis.annotate(
                    style.text(result.mean, result.scale),
                    (in_unit(result.mean), row),
                    (0, 6),
                    textcoords="offset points",
                    horizontalalignment="center",
                    fontsize=8,
                )
        for row, bound in row_bounds(expectation, rows):
            axis.plot(
                [in_unit(bound)] * 2, [row - 0.35, row + 0.35], color=plot_annotations.VIOLATION_COLOR, linewidth=2.0
            )
        for limit in (expectation.at_least, expectation.at_most):
            if limit is not None:
                axis.axvline(in_unit(limit), color=plot_annotations.VIOLATION_COLOR, linestyle=(0, (2, 1.5)))
        axis.set_yticks(range(len(rows)), [result.variant for result in rows])
        axis.set_ylim(len(rows) - 0.4, -0.7)
        axis.margins(x=0.1)
        axis.set_xlabel(plotting.axis_label(metric.name, style.unit))

    return figure_files.render_svg((WIDTH, 0.7 + 0.36 * len(rows)), expectation.name or metric.name, draw)


def row_bounds(expectation: Expectation, rows: Sequence[MetricResult]) -> Iterable[tuple[int, float]]:
    """Return the value [SI] from which each mean of an order must not be less (or more): the mean before and the margin."""
    for row, before in enumerate(rows[:-1] if expectation.ordered else (), 1):
        if before.mean is not None:
            yield row, expectation.bound(before.mean)
