"""Order of variants by a metric: margin, and the seeds at which it holds."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from twin.errors import quote_names
from twin.results.evaluation.coverage import join_numbers, list_names
from twin.results.evaluation.metric_format import metric_format
from twin.results.recording.signals import format_value

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.results.evaluation.metrics import Expectation, MetricResult


def check_order(expectation: Expectation, results: Mapping[str, MetricResult]) -> tuple[str, str, str, str]:
    """Check whether the variants' means are in the expected order by the margin.

    Returns the name, verdict, detail and more of the result.
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
            "",
        )
    style = metric_format(list(results.values()), expectation.unit)
    names = dict(zip(expectation.ordered, quote_names(expectation.ordered), strict=True))
    texts = [f"{names[result.variant]} {style.text(result.mean, scale)}" for result in ordered_results]
    margin = format_margin(expectation)
    side, bound, sign = ("below", "at most", "less") if expectation.descending else ("above", "at least", "plus")
    failing = failing_pairs(expectation, ordered_results)
    seeds = failing_seeds(expectation, ordered_results)
    comparison = f"{expectation.metric}: {(' > ' if expectation.descending else ' < ').join(texts)}"
    if not failing:
        required = f" (required margin: {margin})" if margin else ""
        return name, "pass", f"{comparison}{required}{f'; not at {seeds}' * bool(seeds)}.", ""
    pairs = []
    for before, after in failing:
        first = style.text(before.mean, scale)
        if not margin or before.mean is None or after.mean is None:
            limit = f"{side} {first} ({names[before.variant]})"
        else:
            limit = f"{bound} {expectation.shown(expectation.bound(before.mean), scale)} ({names[before.variant]} {first} {sign} {margin})"
        pairs.append(f"{style.text(after.mean, scale)} in {names[after.variant]}, expected {limit}")
    detail = ", and ".join(pairs)
    return name, "fail", f"{detail}{f'; {seeds}' * bool(seeds)}.", f"{expectation.metric}: {', '.join(texts)}."


def failing_pairs(
    expectation: Expectation, ordered_results: Sequence[MetricResult]
) -> list[tuple[MetricResult, MetricResult]]:
    """Return the consecutive variants whose means are not in the expected order."""
    return [
        (before, after)
        for before, after in itertools.pairwise(ordered_results)
        if not is_ordered(expectation, before.mean, after.mean)
    ]


def is_ordered(expectation: Expectation, before: float | None, after: float | None) -> bool:
    """Whether two consecutive values are in the expected order; equal ones are not, unless a margin is met exactly."""
    if before is None or after is None:
        return False
    gap = expectation.gap(before, after)
    return gap > 0.0 or (gap == 0.0 and bool(expectation.margin or expectation.margin_part))


def format_margin(expectation: Expectation) -> str:
    """Format the margin in the metric's unit: `10 %`, `2 mN`; empty without one."""
    if expectation.margin_part:
        return f"{100 * expectation.margin_part:g} %"
    return format_value(expectation.margin, expectation.unit, is_difference=True) * bool(expectation.margin)


def failing_seeds(expectation: Expectation, results: list[MetricResult]) -> str:
    """Return the seeds at which the order does not hold, `all seeds` or `seeds 1, 3`; empty for one seed or if there are none."""
    seeds = [seed for seed in results[0].values if all(seed in result.values for result in results)]
    failing = [
        seed
        for seed in seeds
        for pairs in [itertools.pairwise(result.values[seed] for result in results)]
        if not all(is_ordered(expectation, before, after) for before, after in pairs)
    ]
    if len(seeds) < 2 or not failing:
        return ""
    return "all seeds" if failing == seeds else f"seed{'s' * (len(failing) > 1)} {join_numbers(failing)}"
