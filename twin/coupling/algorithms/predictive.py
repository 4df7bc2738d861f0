"""Steps as long as the error allows: what inputs were thought to become, against what they became."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, ClassVar

from twin import clock
from twin.coupling.algorithms.algorithm import Algorithm, halvings
from twin.coupling.walk.fields import PREDICTED
from twin.dataclass import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class Predictive(Algorithm):
    """Members in parallel or in sequence; the scenario's step is the longest, `smallest` [ns] the shortest.

    A step costs one step and what it takes to go back, a third of step doubling.
    `tolerance`: of each value in a step, relative to the largest it had, or to `floor` [SI]. Steps are
    divisions of the longest by powers of two, so that points of the recording and events are met.
    """

    name: ClassVar[str] = "predictive"
    control: ClassVar[int] = PREDICTED

    sequential: bool = False
    tolerance: float = 1e-3  # type: ignore[misc]
    smallest: int = 1_000  # [ns]
    floor: float = 1e-12  # type: ignore[misc]
    scales: Mapping[str, Any] = field(default_factory=dict)  # type: ignore[misc]

    def __post_init__(self) -> None:
        super().__post_init__()
        self._limited("tolerance", 0.0, 1.0, above=True)
        self._limited("smallest", 1, 1e18)
        self._limited("floor", 0.0, 1e300, above=True)

    @property
    def is_sequential(self) -> bool:  # type: ignore[override]
        """Whether members are stepped one by one."""
        return self.sequential

    def divisions(self, step: clock.Time) -> int:
        """Down to the smallest one."""
        return halvings(step, self.smallest)
