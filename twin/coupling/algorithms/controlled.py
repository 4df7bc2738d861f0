"""Base class of algorithms with step control by an error estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from twin.coupling.algorithms.algorithm import Algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class Controlled(Algorithm):
    """Step control with members in parallel or in sequence; the scenario's step is the longest, `smallest` [ns] the shortest.

    `tolerance`: of each value in a step, relative to its largest value so far, or to `floor` [SI]; `scales`: such values
    known in advance. Steps are divisions of the longest by powers of two, so that they meet recorded points and events.
    `iterations` above 0: every step is iterated as by `iterative`, with `acceleration` and `agreement`; a step that does
    not converge is shortened.
    """

    sequential: bool = False
    tolerance: float = 1e-3  # type: ignore[misc]
    smallest: int = 1_000  # type: ignore[misc]  # [ns]
    floor: float = 1e-12  # type: ignore[misc]
    scales: Mapping[str, Any] = field(default_factory=dict)  # type: ignore[misc]
    iterations: int = 0  # type: ignore[misc]
    acceleration: str = "anderson"  # type: ignore[misc]
    agreement: float = 1e-6  # type: ignore[misc]

    @property
    def is_sequential(self) -> bool:  # type: ignore[override]
        """Whether members are stepped one by one."""
        return self.sequential or self.iterations > 0
