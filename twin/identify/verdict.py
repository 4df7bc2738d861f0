"""What the data do and do not tell about each unknown, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from twin.identify.intervals import SHARE, TOGETHER, WIDEST

if TYPE_CHECKING:
    from twin.identify.intervals import ParameterUncertainty
    from twin.identify.problem import Problem
    from twin.identify.search import Fit


NARROW = 0.1  # interval as part of the range between the bounds, below which correlation does no harm


def verdicts(problem: Problem, fit: Fit, knowledge: ParameterUncertainty) -> list[list[str]]:
    """For each unknown why its value is not to be relied on; nothing if it is."""
    names = [unknown.name for unknown in problem.unknowns]
    texts: list[list[str]] = [[] for _ in names]
    for i, unknown in enumerate(problem.unknowns):
        if not knowledge.effect[i]:
            texts[i].append("not identifiable: it changes nothing of what is compared")
            continue
        if bound := unknown.at_bound(float(fit.positions[i])):
            texts[i].append(f"at its {bound} bound: move the bound if the value makes no sense there")
        texts[i] += wide(knowledge, i)
        for k, name in enumerate(names):
            r = float(knowledge.correlation[i, k])
            if k != i and abs(r) > TOGETHER and not is_narrow(knowledge, i):
                texts[i].append(f"cannot be separated from {name}: correlation {r:.4f}")
    for i, text in combinations(names, knowledge):
        if not any("correlation" in text for text in texts[i]):
            texts[i].append(text)
    return texts


def is_narrow(knowledge: ParameterUncertainty, i: int) -> bool:
    """Whether an interval is small relative to the bounds, so that the value is determined."""
    return bool(knowledge.high[i] - knowledge.low[i] < NARROW)


def pairs(problem: Problem, knowledge: ParameterUncertainty) -> list[str]:
    """Unknowns that are known, but only together."""
    names = [unknown.name for unknown in problem.unknowns]
    return [
        f"{names[i]} and {names[k]} cannot be separated, correlation {knowledge.correlation[i, k]:.4f}. Take both from one file."
        for i in range(len(names))
        for k in range(i)
        if abs(knowledge.correlation[i, k]) > TOGETHER and is_narrow(knowledge, i) and is_narrow(knowledge, k)
    ]


def wide(knowledge: ParameterUncertainty, i: int) -> list[str]:
    """What is wrong with the interval of an unknown."""
    low, high = float(knowledge.low[i]), float(knowledge.high[i])
    if knowledge.method == "profile":
        open_ends = [side for side, end in (("lower", low), ("upper", high)) if np.isnan(end)]
        if open_ends:
            return [f"not identifiable: flat profile, open up to its {' and its '.join(open_ends)} bound"]
        return []
    if high - low > 1.0:
        return ["not identifiable: its interval is wider than its bounds"]
    return []


def combinations(names: list[str], knowledge: ParameterUncertainty) -> list[tuple[int, str]]:
    """Unknowns of which the data tell only other combinations than one of three or more."""
    rows = []
    for deviation, direction in zip(knowledge.singular, knowledge.directions, strict=True):
        own = [i for i in range(len(names)) if abs(direction[i]) > SHARE]
        if deviation > WIDEST and len(own) > 1:
            for i in own:
                others = " and ".join(names[k] for k in own if k != i)
                rows.append((i, f"not identifiable beside {others}: the data do not tell one combination of them"))
    return rows
