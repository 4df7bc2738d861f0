"""Steps as long as the error allows: every step is made whole and in two halves, and what differs tells the error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin import clock
from twin.coupling.algorithms.algorithm import halvings
from twin.coupling.algorithms.controlled import Controlled
from twin.coupling.variable_step.record_layout import DOUBLING


@dataclass(frozen=True, kw_only=True, eq=False)
class StepDoubling(Controlled):
    """Error by Richardson's extrapolation: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4.

    The halves stay; they are no shorter than `smallest`.
    """

    name: ClassVar[str] = "step_doubling"
    control: ClassVar[int] = DOUBLING

    def divisions(self, step: clock.Time) -> int:
        """Down to the smallest half."""
        return halvings(step, self.smallest, 2)
