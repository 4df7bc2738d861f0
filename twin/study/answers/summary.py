"""The answers of a study: as plain data for answers.json, as text for the terminal and the page."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import common_format, display_units
from twin.study.answers import clusters as failing
from twin.study.answers import paired, sensitivity, statistics
from twin.study.design import SAMPLED
from twin.study.execution.case_engine import DONE

if TYPE_CHECKING:
    from twin.study.answers.clusters import FailureCluster
    from twin.study.answers.paired import PairedDifference
    from twin.study.answers.sensitivity import Change, MetricSensitivity
    from twin.study.answers.statistics import LeftOut, MetricDistribution, PassRate
    from twin.study.design import KeepKeys
    from twin.study.execution.case_table import CaseTable

MAX_SENTENCES = 3  # of a kind


class Answers:
    """Answers of a study: statistics of its cases."""

    def __init__(self, cases: CaseTable) -> None:
        self.cases, self.study = cases, cases.study
        self.spreads: list[MetricDistribution] = statistics.metric_distributions(cases)
        self.shares: list[PassRate] = statistics.shares(cases)
        self.left_out: list[LeftOut] = statistics.left_out(cases)
        self.clusters: list[FailureCluster] = failing.clusters(cases)
        self.drivers: list[MetricSensitivity] = sensitivity.drivers(cases)
        self.changes: list[Change] = sensitivity.changes(cases)
        self.pairs: list[PairedDifference] = paired.paired_differences(cases)
        units = display_units({name: metric.unit for name, metric in self.study.metrics.items()})
        self.formats = {
            name: common_format(values[np.isfinite(values)].tolist(), units[name], metric.is_difference)
            for name, metric in self.study.metrics.items()
            for values in [cases.metric(name)]
        }

    @property
    def failed(self) -> int:
        """Cases that did not come to their end."""
        return statistics.failures(self.cases)

    @property
    def is_partial(self) -> bool:
        """Whether samples are missing: the study runs, or was interrupted."""
        return len(self.cases.where(SAMPLED)) < self.study.count

    @property
    def sample_count(self) -> int:
        """Samples of which a case is done: after an interruption fewer than the study has."""
        return len({self.cases.requests[i].sample for i in self.cases.where(SAMPLED)})

    def metric(self, name: str, value: float) -> str:
        """A value of a metric [SI] in its unit, with the decimals that all values of the metric have."""
        return self.formats[name].text(value) if np.isfinite(value) else "-"

    @property
    def parts(self) -> list[float]:
        """Parts of the quantiles that tables show: 0 and 1 where there are too few samples for those of the study."""
        count = self.sample_count * len(self.study.seeds(1))
        return [statistics.resolved_part(part, count) for part in self.study.keys.quantiles]

    @property
    def part_names(self) -> list[str]:
        """Names of these quantiles, `5 %` or `smallest`."""
        return [statistics.EXTREMES.get(part, percent(part)) for part in self.parts]

    def quantiles(self, spread: MetricDistribution) -> list[float]:
        """Return these quantiles of a metric, SI."""
        ends = {0.0: spread.least[1], 1.0: spread.most[1]}
        return [ends.get(part, own.value) for part, own in zip(self.parts, spread.quantiles, strict=False)]

    def between(self, name: str, low: float, high: float) -> str:
        """`0.031 to 0.034 N`; `above 0.031 N` without an upper end, `too few cases` without both."""
        ends = [self.metric(name, end) for end in (low, high)]
        if not (np.isfinite(low) and np.isfinite(high)):
            sides = {"above": (low, ends[0]), "below": (high, ends[1])}
            texts = [f"{side} {text}" for side, (end, text) in sides.items() if np.isfinite(end)]
            return texts[0] if texts else "too few cases"
        unit = ends[1].partition(" ")[2]
        first = ends[0].removesuffix(f" {unit}") if unit and ends[0].endswith(f" {unit}") else ends[0]
        return f"{first} to {ends[1]}"

    def difference(self, pair: PairedDifference) -> tuple[str, str]:
        """Mean difference of a pair, `-4.1 mN`, and its interval, `-5.0 to -3.2`; "" without one."""
        numbers = [number for number in (pair.mean, pair.low, pair.high) if np.isfinite(number)]
        largest = max(map(abs, numbers))
        digits = 2 - math.floor(math.log10(largest)) if largest else 0  # three significant ones of the largest
        own = common_format([round(number, digits) for number in numbers], self.formats[pair.metric].unit, True)
        mean, *ends = (own.text(number) for number in numbers)
        return mean, " to ".join(end.partition(" ")[0] for end in ends)

    def interval(self, pass_rate: PassRate) -> str:
        """Wilson's interval; nothing where the cases are no independent random samples."""
        return f"{percent(pass_rate.low)} to {percent(pass_rate.high)}" if self.is_random else ""

    @property
    def is_random(self) -> bool:
        """Whether the cases of a variant are independent random samples: confidence intervals need that."""
        return self.study.design.method in paired.INDEPENDENT_SAMPLES and len(self.study.seeds(1)) == 1

    def change(self, change: Change) -> str:
        """`sleeve.friction_coefficient 0.2`, `friction x 2`."""
        several = len(self.study.variants) > 1
        value = self.factor_value(change.factor, change.value)
        return f"{change.factor} {value}" + (f", {change.variant}" if several else "")

    def factor_value(self, name: str, value: float) -> str:
        """Format a value of a factor with the unit that the study file states."""
        return next(factor.shown(value) for factor in self.study.factors if factor.name == name)

    def plain(self) -> dict[str, Any]:
        """For a file: SI, nothing that is no number."""
        summary: dict[str, Any] = cleaned(
            {
                "cases": len(self.cases.rows),
                "failed": self.failed,
                "metrics": [asdict(spread) for spread in self.spreads],
                "expectations": [
                    {**asdict(share), "failing": share.failing[:20], "part": share.part} for share in self.shares
                ],
                **{
                    name: [asdict(answer) for answer in getattr(self, name)]
                    for name in ("left_out", "clusters", "drivers", "changes", "pairs")
                },
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
    """Numbers of the cases of which the study keeps everything: the worst that fail, and the worst of each metric and variant.

    Of failures: the worst case of each of the lowest pass rates, which sentences name, and of each kind of failure, then others.
    """
    numbers: list[int] = []
    if keep.failed:
        missed = sorted((rate for rate in statistics.shares(cases) if rate.part < 1.0), key=lambda rate: rate.part)
        worst = [(rate, statistics.worst_of_rate(cases, rate)) for rate in missed[:MAX_SENTENCES]]
        numbers += [entry.number for rate, entry in worst if entry and entry.number in rate.failing]
        numbers += [cluster.cases[0] for cluster in failing.clusters(cases)]
        numbers += [row.number for row in cases.rows if row.status != DONE or False in row.holds]
        numbers = list(dict.fromkeys(numbers))[: keep.failed]
    for metric, _, own in cases.by_metric() if keep.worst else ():
        values = cases.metric(metric.name)
        finite = sorted((i for i in own if np.isfinite(values[i])), key=lambda i: -abs(values[i]))
        numbers += [cases.requests[i].number for i in finite[: keep.worst]]
    return list(dict.fromkeys(numbers))
