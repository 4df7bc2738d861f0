"""Display of metrics: one unit for each quantity of a scenario, and the same number of decimals in each row."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.component import unit
from twin.results.recording.signals import LARGER_UNITS, MILLI_UNITS, format_value, si_conversion

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results.evaluation.metrics import MetricResult

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
        return unit.label(self.unit)

    def number(self, value: float | None, scale: float = 0.0) -> str:
        """Format a value [SI] without its unit. `scale`: as in `format_value`."""
        return format_value(value, self.unit, scale, self.is_difference, self.decimals, keeps_unit=True).partition(" ")[
            0
        ]

    def text(self, value: float | None, scale: float = 0.0, digits: int = 4) -> str:
        """Format a value [SI] with its unit; `digits` apply without `decimals`."""
        return format_value(value, self.unit, scale, self.is_difference, self.decimals, digits)

    def reference(self, value: float | None) -> str:
        """Format a published value [SI] with its unit and its own digits: `25 deg`, where others are `24.87 deg`."""
        return format_value(value, self.unit, 0.0, self.is_difference, None, 6)


def display_units(declared: Mapping[str, str]) -> dict[str, str]:
    """Return the unit in which each metric of a scenario is shown: its own, or the smaller one that another metric has.

    Values do not matter: a metric has one unit in all runs of its scenario, and a quantity has one unit in a table.
    """
    symbols = set(declared.values())
    return {
        name: MILLI_UNITS[symbol] if MILLI_UNITS.get(symbol) in symbols else symbol for name, symbol in declared.items()
    }


def larger_unit(values: Iterable[float], symbol: str) -> str:
    """Return the unit for some values [SI] of a comparison: N instead of mN for 8.11 N."""
    larger = LARGER_UNITS.get(symbol, symbol)
    return larger if max(map(abs, values), default=0.0) >= si_conversion(larger)[0] else symbol


def metric_formats(results: Iterable[MetricResult]) -> dict[str, MetricFormat]:
    """Return the format of each metric of a run, the same for all variants. `results`: of all metrics."""
    by_name: dict[str, list[MetricResult]] = {}
    for result in results:
        by_name.setdefault(result.metric.name, []).append(result)
    units = display_units({name: group[0].metric.unit for name, group in by_name.items()})
    return {name: metric_format(group, units[name]) for name, group in by_name.items()}


def metric_format(results: list[MetricResult], symbol: str) -> MetricFormat:
    """Return the format of the results of one metric in a unit."""
    values = [value for result in results for value in (result.mean, result.worst, result.paper) if value is not None]
    return common_format(values, symbol, results[0].metric.is_difference)


def common_format(values: Sequence[float], symbol: str, is_difference: bool = False) -> MetricFormat:
    """Return the format of some values [SI] in a unit."""
    factor, offset = si_conversion(symbol, is_difference)
    in_unit = [(value - offset) / factor for value in values]
    largest = max(map(abs, in_unit), default=0.0)
    if not SMALLEST <= largest < 10.0**DIGITS:
        return MetricFormat(symbol, None, is_difference)
    most = DIGITS - 1 - math.floor(math.log10(largest))
    decimals = max(len(f"{value:.{most}f}".rstrip("0").partition(".")[2]) for value in in_unit)
    return MetricFormat(symbol, decimals, is_difference)
