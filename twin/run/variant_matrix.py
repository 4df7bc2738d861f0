"""Figures of many variants as a matrix: a row for each variant, a column for each metric, to be sorted and filtered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.component import unit
from twin.results import coherent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.results import Evaluation, Failure, Metric

FROM = 5  # variants: fewer are seen at once


@dataclass(frozen=True)
class Cell:
    """A metric of a variant. `value`: in the unit of its column, to sort by; nothing if there is none."""

    text: str = ""
    value: float | None = None
    verdict: str = ""


@dataclass(frozen=True)
class Line:
    """A variant: its metrics, and the expectations that failed in it."""

    variant: str
    cells: tuple[Cell, ...]
    failed: tuple[str, ...]

    @property
    def bad(self) -> bool:
        """Whether anything of it is not as expected."""
        return bool(self.failed) or any(cell.verdict in ("fail", "none") for cell in self.cells)


@dataclass(frozen=True)
class Matrix:
    """The head of each column, with its unit and what it is, and the rows."""

    columns: tuple[tuple[str, str, str], ...] = ()
    lines: tuple[Line, ...] = ()

    @property
    def worth(self) -> bool:
        """Whether there are so many variants that a list of them is too long."""
        return len(self.lines) >= FROM


def matrix(evaluation: Evaluation, failures: Sequence[Failure]) -> Matrix:
    """The means of all metrics of all variants."""
    metrics: dict[str, Metric] = {one.metric.name: one.metric for one in evaluation.figures}
    found = {(one.variant, one.metric.name): one for one in evaluation.figures}
    broken: dict[str, list[str]] = {}
    for failure in failures:
        for variant in failure.variants:
            broken.setdefault(variant, []).append(failure.name)
    lines = []
    for variant in dict.fromkeys([*(one.variant for one in evaluation.figures), *broken]):
        cells = []
        for name, metric in metrics.items():
            one = found.get((variant, name))
            if one is None:
                cells.append(Cell())
                continue
            factor, offset = coherent(metric.unit, metric.is_difference)
            value = None if one.mean is None else (one.mean - offset) / factor
            text = "no value" if value is None else metric.shown(one.mean, one.scale)
            text = text.removesuffix(unit.shown(metric.unit)).rstrip()
            cells.append(Cell(text, value, one.verdict))
        lines.append(Line(variant, tuple(cells), tuple(broken.get(variant, ()))))
    columns = tuple(
        (name, unit.shown(metric.unit), metric.description or f"{metric.reduce} of {metric.signal.text}")
        for name, metric in metrics.items()
    )
    return Matrix(columns, tuple(lines))
