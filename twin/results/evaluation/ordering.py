"""Order of variants by a metric: margin, and the seeds at which it holds."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from twin.results.evaluation.coverage import list_names, quote_names
from twin.results.evaluation.metric_format import MetricFormat, metric_format
from twin.results.recording.signals import format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.results.evaluation.metrics import Expectation, MetricResult


def check_order(expectation: Expectation, results: Mapping[str, MetricResult]) -> tuple[str, str, str]:
    """Check whether the variants' means are in the expected order by the margin.

    Returns name, verdict and detail of the result.
    """
    name = (
        expectation.name
        or f"{expectation.metric} {'falls' if expectation.descending else 'rises'}: {', '.join(expectation.ordered)}"
    )
    ordered_results = [results[variant] for variant in expectation.ordered if variant in results]
    scale = max((result.scale for result in results.values()), default=0.0)
    if len(ordered_results) < 2:
        given = f"only {quote_names([ordered_results[0].variant])[0]} has" if ordered_results else "none has"
        return (
            name,
            "skipped",
            f"Not judged: an order needs at least two of {list_names(expectation.ordered)}; {given} {expectation.metric} in this run.",
        )
    style = metric_format(list(results.values()))
    shown = style.text if style.unit else expectation.shown
    names = dict(zip(expectation.ordered, quote_names(expectation.ordered), strict=True))
    parts = [f"{names[ordered_results[0].variant]} {shown(ordered_results[0].mean, scale)}"]
    has_margin = bool(expectation.margin or expectation.margin_part)
    holds = ordered_results[0].mean is not None
    for before, after in itertools.pairwise(ordered_results):
        gap = expectation.gap(before.mean, after.mean) if before.mean is not None and after.mean is not None else np.nan
        is_ordered = gap > 0.0 or (gap == 0.0 and has_margin)
        sign = (
            (">" if expectation.descending else "<")
            if is_ordered
            else "but not " + ("above" if expectation.descending else "below")
        )
        parts.append(f"{sign} {names[after.variant]} {shown(after.mean, scale)}")
        holds = holds and is_ordered
    margin = f" (required margin: {format_margin(expectation, style)})" if has_margin else ""
    return (
        name,
        "pass" if holds else "fail",
        f"{expectation.metric}: {' '.join(parts)}{margin}.{describe_seeds(expectation, ordered_results)}",
    )


def format_margin(expectation: Expectation, style: MetricFormat) -> str:
    """Format the margin in the metric's unit: `10 %`, `2 mN`."""
    if expectation.margin_part:
        return f"{100 * expectation.margin_part:g} %"
    return format_value(expectation.margin, style.unit or expectation.unit, is_difference=True)


def describe_seeds(expectation: Expectation, results: list[MetricResult]) -> str:
    """Describe the seeds at which the order holds; empty if it holds at all of them."""
    seeds = [seed for seed in results[0].values if all(seed in result.values for result in results)]
    if len(seeds) < 2:
        return ""

    def holds(seed: int) -> bool:
        values = [result.values[seed] for result in results]
        return all(
            before is not None and after is not None and expectation.gap(before, after) >= 0.0 and before != after
            for before, after in itertools.pairwise(values)
        )

    broken = [seed for seed in seeds if not holds(seed)]
    return f" {format_seeds(seeds, broken)}" if broken else ""


def format_seeds(seeds: list[int], broken: list[int]) -> str:
    """Format the seeds as `It holds at seeds 1, 2, not at 3.`"""
    passing = [str(seed) for seed in seeds if seed not in broken]
    failing = [str(seed) for seed in broken]
    if not passing:
        return f"It holds at no seed: {', '.join(failing)}."
    return f"It holds at seed{'s' * (len(passing) > 1)} {', '.join(passing)}, not at {', '.join(failing)}."


def list_failed_variants(fails: Mapping[str, str], cases: Iterable[str]) -> str:
    """List the variants that fail, with their failing and passing seeds if there are several."""
    seeds: dict[str, dict[str, bool]] = {}  # variant -> seed -> whether it fails
    for case in cases:
        variant, _, seed = case.rpartition(", seed ")
        seeds.setdefault(variant, {})[seed] = case in fails
    parts = []
    for variant, fails_by_seed in seeds.items():
        failing = [seed for seed, failed in fails_by_seed.items() if failed]
        passing = [seed for seed, failed in fails_by_seed.items() if not failed]
        if not failing:
            continue
        suffix = f"; passes at {', '.join(passing)}" if passing else ""
        at = f"seed{'s' * (len(failing) > 1)} {', '.join(failing)}"
        parts.append(f"{variant} (fails at {at}{suffix})" if len(fails_by_seed) > 1 else variant)
    return ", ".join(parts)
