"""The answers of a study: as plain data for answers.json, as text for the terminal and the page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import common_format
from twin.study.answers import clusters as failing
from twin.study.answers import sensitivity, statistics
from twin.study.design import SAMPLED

if TYPE_CHECKING:
    from twin.study.answers.clusters import FailureCluster
    from twin.study.answers.sensitivity import Change, MetricSensitivity
    from twin.study.answers.statistics import MetricDistribution, PassRate
    from twin.study.design import KeepKeys
    from twin.study.execution.case_table import CaseTable

    Array = np.ndarray[Any, Any]


class Answers:
    """Answers of a study: statistics of its cases."""

    def __init__(self, cases: CaseTable) -> None:
        self.cases, self.study = cases, cases.study
        self.spreads: list[MetricDistribution] = statistics.metric_distributions(cases)
        self.shares: list[PassRate] = statistics.shares(cases)
        self.clusters: list[FailureCluster] = failing.clusters(cases)
        self.drivers: list[MetricSensitivity] = sensitivity.drivers(cases)
        self.changes: list[Change] = sensitivity.changes(cases)
        self.formats = {
            name: common_format(values[np.isfinite(values)].tolist(), metric.unit, metric.is_difference)
            for name, metric in self.study.metrics.items()
            for values in [cases.metric(name)]
        }

    @property
    def failed(self) -> int:
        """Cases that did not come to their end."""
        return statistics.failures(self.cases)

    def metric(self, name: str, value: float) -> str:
        """A value of a metric [SI] in its unit, with the decimals that all values of the metric have."""
        return self.formats[name].text(value) if np.isfinite(value) else "-"

    def between(self, name: str, low: float, high: float) -> str:
        """`0.031 to 0.034 N`; an end that is not known is open."""
        ends = [self.metric(name, one) if np.isfinite(one) else "open" for one in (low, high)]
        unit = ends[1].partition(" ")[2]
        first = ends[0].removesuffix(f" {unit}") if unit and ends[0].endswith(f" {unit}") else ends[0]
        return f"{first} to {ends[1]}"

    def interval(self, one: PassRate) -> str:
        """Wilson's interval; nothing where the cases are no sample of anything."""
        is_listed = self.study.design.method in ("one_at_a_time", "grid")
        return "" if is_listed else f"{percent(one.low)} to {percent(one.high)}"

    def change(self, one: Change) -> str:
        """`sleeve.friction_coefficient 0.2`, `friction x 2`."""
        (factor,) = (f for f in self.study.factors if f.name == one.factor)
        value = f"x {one.value:g}" if factor.scales else factor.shown(one.value)
        several = len(self.study.variants) > 1
        return f"{one.factor} {value}" + (f", {one.variant}" if several else "")

    def plain(self) -> dict[str, Any]:
        """For a file: SI, nothing that is no number."""
        summary: dict[str, Any] = cleaned(
            {
                "cases": len(self.cases.rows),
                "failed": self.failed,
                "metrics": [{**vars(one), "quantiles": [vars(item) for item in one.quantiles]} for one in self.spreads],
                "expectations": [{**vars(one), "failing": one.failing[:20], "part": one.part} for one in self.shares],
                "clusters": [{**vars(one), "factors": [vars(item) for item in one.factors]} for one in self.clusters],
                "drivers": [{**vars(one), "effects": [vars(item) for item in one.effects]} for one in self.drivers],
                "changes": [vars(one) for one in self.changes],
            }
        )
        return summary


def cleaned(value: Any) -> Any:
    """Plain data without NaN and infinities, which JSON has not."""
    if isinstance(value, dict):
        return {key: cleaned(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [cleaned(item) for item in value]
    if isinstance(value, np.generic):
        return cleaned(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def percent(part: float) -> str:
    """A part of one for people: never 100 % where it is less."""
    if not np.isfinite(part):
        return "-"
    text = f"{100 * part:.3g}"
    if text == "100" and part < 1.0:
        text = f"{math.floor(1e4 * part) / 100:g}"
    return f"{text} %"


def noteworthy(cases: CaseTable, keep: KeepKeys) -> list[int]:
    """Numbers of the cases of which the study keeps everything: some that fail, and the worst of each metric and variant."""
    study = cases.study
    numbers: list[int] = []
    if keep.failed:
        for one in failing.clusters(cases):
            numbers += one.cases[: keep.failed]
    if keep.worst:
        for name in study.metrics:
            values = cases.metric(name)
            for variant in study.variants:
                case_indices = [i for i in cases.where(SAMPLED, variant) if np.isfinite(values[i])]
                case_indices.sort(key=lambda i: -abs(values[i]))
                numbers += [cases.requests[i].number for i in case_indices[: keep.worst]]
    return list(dict.fromkeys(numbers))
