"""The order of variants by a metric: by what margin it holds, and at which seeds."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from twin.results.signals import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.results.metrics import Expectation, Figure


def ordered(one: Expectation, own: Mapping[str, Figure]) -> tuple[str, str, str]:
    """Name, verdict and detail of an outcome: whether the variants' means are in the expected order, by the margin; and at which seeds they are."""
    name = one.name or f"{one.metric} {'falls' if one.descending else 'rises'}: {', '.join(one.ordered)}"
    figures = [own[variant] for variant in one.ordered if variant in own]
    scale = max((figure.scale for figure in own.values()), default=0.0)
    if len(figures) < 2:
        return (name, "skipped", f"{one.metric} is known for fewer than two of the variants.")
    parts = [f"{figures[0].variant} {one.shown(figures[0].mean, scale)}"]
    holds = figures[0].mean is not None
    for before, after in itertools.pairwise(figures):
        gap = one.gap(before.mean, after.mean) if before.mean is not None and after.mean is not None else np.nan
        right = gap > 0.0 or (gap == 0.0 and bool(one.margin or one.margin_part))
        sign = (">" if one.descending else "<") if right else "but not " + ("above" if one.descending else "below")
        parts.append(f"{sign} {after.variant} {one.shown(after.mean, scale)}")
        holds = holds and right
    by = f" by {margin_text(one)}" if one.margin or one.margin_part else ""
    return (name, "pass" if holds else "fail", f"{one.metric}: {' '.join(parts)}{by}.{by_seed(one, figures)}")


def margin_text(one: Expectation) -> str:
    """`10 %`, `0.002 N`."""
    return f"{100 * one.margin_part:g} %" if one.margin_part else shown(one.margin, one.unit, is_difference=True)


def by_seed(one: Expectation, figures: list[Figure]) -> str:
    """The seeds at which the order holds, and those at which it does not; nothing if it holds at all of them."""
    seeds = [seed for seed in figures[0].values if all(seed in figure.values for figure in figures)]
    if len(seeds) < 2:
        return ""

    def holds(seed: int) -> bool:
        values = [figure.values[seed] for figure in figures]
        return all(
            before is not None and after is not None and one.gap(before, after) >= 0.0 and before != after
            for before, after in itertools.pairwise(values)
        )

    broken = [seed for seed in seeds if not holds(seed)]
    return f" {told(seeds, broken)}" if broken else ""


def told(seeds: list[int], broken: list[int]) -> str:
    """`It holds at seeds 1, 2, not at 3.`"""
    right = [str(seed) for seed in seeds if seed not in broken]
    wrong = [str(seed) for seed in broken]
    if not right:
        return f"It holds at no seed: {', '.join(wrong)}."
    return f"It holds at seed{'s' * (len(right) > 1)} {', '.join(right)}, not at {', '.join(wrong)}."
