"""Limits for metrics, from their spread over seeds that no scenario lists.

    python -m benchmarks.ranges racs tip_error drive_current      lines for `expect:`, of two metrics

The limits are the least and the largest value of 20 seeds from 101 on, widened by a tenth of the mean on both sides, so that
they hold at other seeds and on other platforms. Variants whose limits are alike share a line. Limits that are found in this
way come after the results: they notice that a machine changes and do not prove that it is right.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator

from benchmarks.mutations import FIRST_SEED, SCENARIOS, tables_of
from twin.results import Metric, evaluate
from twin.scenario import ScenarioSpec, load_scenario

MARGIN = 0.1  # of the mean
ROUNDING = 1e-12  # what is smaller is left of a zero, and no limit
ALIKE = 1.3  # so much wider may the limits of a group of variants be than the widest of its variants

Limits = dict[str, tuple[float, float]]


def spreads(
    scenario: ScenarioSpec, metrics: list[str], variants: tuple[str, ...], seeds: int
) -> Iterator[tuple[Metric, Limits]]:
    """The limits [SI] of each metric by variant."""
    tables, failure = tables_of(scenario, variants, tuple(range(FIRST_SEED, FIRST_SEED + seeds)))
    if failure:
        raise SystemExit(failure)
    result = evaluate({name: scenario.metrics[name] for name in metrics}, (), tables)
    for name in metrics:
        limits: Limits = {}
        for figure in result.metric_results:
            values = [value for value in figure.values.values() if value is not None]
            if figure.metric.name == name and values and (max(map(abs, values)) > ROUNDING or not any(values)):
                margin = MARGIN * abs(sum(values) / len(values))
                limits[figure.variant] = min(values) - margin, max(values) + margin
        yield scenario.metrics[name], limits


def groups(limits: Limits) -> Iterator[tuple[list[str], tuple[float, float]]]:
    """Variants whose limits are alike, with limits that hold for all of them."""
    chosen: list[str] = []
    least = most = widest = 0.0
    for variant, (low, high) in sorted(limits.items(), key=lambda item: item[1]):
        together = min(low, least), max(high, most)
        if chosen and together[1] - together[0] <= ALIKE * max(widest, high - low):
            chosen.append(variant)
            (least, most), widest = together, max(widest, high - low)
            continue
        if chosen:
            yield chosen, (least, most)
        chosen, least, most, widest = [variant], low, high, high - low
    if chosen:
        yield chosen, (least, most)


def lines(metric: Metric, limits: Limits) -> Iterator[str]:
    """Expectations as lines of a scenario file."""
    found = list(groups(limits))
    for variants, ends in found:
        within = ", ".join(f"{metric.shown(end)}" for end in ends)
        only = "" if len(found) == 1 and not metric.variants else f", variants: {json.dumps(variants)}"
        label = metric.name.replace("_", " ") + (f", {variants[0]}" if len(found) > 1 else "")
        yield f"  - {{name: {json.dumps(label)}, metric: {metric.name}, within: [{within}]{only}}}"


def main() -> None:
    """Print expectations."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ranges")
    parser.add_argument("scenario")
    parser.add_argument("metric", nargs="+")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--variant", action="append", default=[])
    asked = parser.parse_args()
    scenario = load_scenario(SCENARIOS / f"{asked.scenario}.yaml")
    for metric, limits in spreads(scenario, asked.metric, tuple(asked.variant), asked.seeds):
        for line in lines(metric, limits):
            print(line, flush=True)


if __name__ == "__main__":
    main()
