"""Base class of algorithms with step control by an error estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from twin import clock
from twin.coupling.algorithms.algorithm import Algorithm, halvings, scheme_number


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
    smallest: int = 1_000  # [ns]
    floor: float = 1e-12  # type: ignore[misc]
    scales: Mapping[str, Any] = field(default_factory=dict)  # type: ignore[misc]
    iterations: int = 0  # type: ignore[misc]
    acceleration: str = "anderson"
    agreement: float = 1e-6  # type: ignore[misc]

    def __post_init__(self) -> None:
        super().__post_init__()
        self._limited("tolerance", 0.0, 1.0, above=True)
        self._limited("smallest", 1, 1e18)
        self._limited("floor", 0.0, 1e300, above=True)
        self._limited("iterations", 0, 1000)
        self._limited("agreement", 0.0, 1.0, above=True)
        scheme_number(self.acceleration, self.name)

    @property
    def is_sequential(self) -> bool:  # type: ignore[override]
        """Whether members are stepped one by one."""
        return self.sequential or self.iterations > 0

    @property
    def scheme(self) -> int:  # type: ignore[override]
        """Number of the acceleration."""
        return scheme_number(self.acceleration, self.name)

    def divisions(self, step: clock.Time) -> int:
        """Return the number of smallest steps in a step [ns]."""
        return halvings(step, self.smallest)
