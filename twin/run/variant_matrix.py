"""Matrix of metrics of many variants: a row for each variant, a column for each metric, sortable and filterable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.results import metric_formats, si_conversion
from twin.run.report import metric_definition

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.results import Evaluation, Metric, Violation

FAILED = ("fail", "none")  # verdicts of metrics
MIN_VARIANTS = 5  # a list of fewer is readable at a glance


@dataclass(frozen=True)
class MatrixCell:
    """Metric of a variant. `value`: in the unit of its column, for sorting; None if there is none. `paper`: its reference."""

    text: str = ""
    paper: str = ""
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
    """Title, unit and description of each column, and the rows."""

    columns: tuple[tuple[str, str, str], ...] = ()
    rows: tuple[MatrixRow, ...] = ()

    @property
    def is_large(self) -> bool:
        """Whether there are so many variants that a list of them is too long."""
        return len(self.rows) >= MIN_VARIANTS


def build_matrix(evaluation: Evaluation, violations: Sequence[Violation]) -> Matrix:
    """Collect the means of all metrics of all variants; failures come first, then metrics with a reference value."""
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
    for variant in dict.fromkeys([*(result.variant for result in evaluation.metric_results), *failed_names]):
        cells = []
        for name, metric in metrics.items():
            result = results.get((variant, name))
            if result is None:
                cells.append(MatrixCell())
                continue
            factor, offset = si_conversion(metric.unit, metric.is_difference)
            value = None if result.mean is None else (result.mean - offset) / factor
            text = "no value" if value is None else formats[name].number(result.mean, result.scale)
            paper = (
                ""
                if result.paper is None
                else formats[name].reference(result.paper).removesuffix(formats[name].label).rstrip()
            )
            verdict = "fail" if (variant, name) in failed_cells else result.verdict
            cells.append(MatrixCell(text, paper, value, verdict))
        failed_metrics = [
            name for name in metrics if (variant, name) in results and results[variant, name].verdict in FAILED
        ]
        rows.append(MatrixRow(variant, tuple(cells), (*failed_names.get(variant, ()), *failed_metrics)))
    columns = tuple(
        (name, formats[name].label, ": ".join(filter(None, (metric.description, metric_definition(metric)))))
        for name, metric in metrics.items()
    )
    return Matrix(columns, tuple(sorted(rows, key=lambda row: not row.failures)))
