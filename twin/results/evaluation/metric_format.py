"""Display of metrics: a unit in which their numbers are short, and the same number of decimals in each row."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.component import unit
from twin.results.recording.signals import format_value, si_conversion

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from twin.results.evaluation.metrics import MetricResult

SMALLER = {"N": "mN", "m": "mm", "s": "ms", "A": "mA", "V": "mV", "m/s": "mm/s", "N*m": "mN*m"}
LIMIT = 0.1  # metrics all of whose values are below are shown in the smaller unit
DIGITS = 4  # of the largest value of a metric
SMALLEST = 1e-3  # largest values below it are shown with powers of ten


@dataclass(frozen=True)
class MetricFormat:
    """Unit and decimals of a metric; `decimals` is None for four digits of each value."""

    unit: str = ""
    decimals: int | None = None
    is_difference: bool = False

    @property
    def label(self) -> str:
        """Unit as it is printed."""
        return unit.shown(self.unit)

    def number(self, value: float | None, scale: float = 0.0) -> str:
        """Format a value [SI] without its unit. `scale`: as in `format_value`."""
        return format_value(value, self.unit, scale, self.is_difference, self.decimals).partition(" ")[0]

    def text(self, value: float | None, scale: float = 0.0, digits: int = 4) -> str:
        """Format a value [SI] with its unit; `digits` apply without `decimals`."""
        return format_value(value, self.unit, scale, self.is_difference, self.decimals, digits)

    def reference(self, value: float | None) -> str:
        """Format a published value [SI] with its unit and its own digits: `25 deg`, where others are `24.87 deg`."""
        return format_value(value, self.unit, 0.0, self.is_difference, None, 6)


def metric_formats(results: Iterable[MetricResult]) -> dict[str, MetricFormat]:
    """Return the format of each metric, the same for all variants."""
    by_name: dict[str, list[MetricResult]] = {}
    for result in results:
        by_name.setdefault(result.metric.name, []).append(result)
    return {name: metric_format(group) for name, group in by_name.items()}


def metric_format(results: list[MetricResult]) -> MetricFormat:
    """Return the format of the results of one metric."""
    metric = results[0].metric
    values = [value for result in results for value in (result.mean, result.worst, result.paper) if value is not None]
    return common_format(values, metric.unit, metric.is_difference)


def common_format(values: Sequence[float], symbol: str, is_difference: bool = False) -> MetricFormat:
    """Return the format of some values [SI] in a unit, or in a smaller one if all are small."""

    def in_unit(symbol: str) -> list[float]:
        factor, offset = si_conversion(symbol, is_difference)
        return [(value - offset) / factor for value in values]

    def largest(symbol: str) -> float:
        return max(map(abs, in_unit(symbol)), default=0.0)

    if symbol in SMALLER and 0.0 < largest(symbol) < LIMIT:
        symbol = SMALLER[symbol]
    if not SMALLEST <= largest(symbol) < 10.0**DIGITS:
        return MetricFormat(symbol, None, is_difference)
    most = DIGITS - 1 - math.floor(math.log10(largest(symbol)))
    decimals = max(len(f"{value:.{most}f}".rstrip("0").partition(".")[2]) for value in in_unit(symbol))
    return MetricFormat(symbol, decimals, is_difference)
