"""Step control by step doubling: the difference between one step and two halves estimates the error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.controlled import Controlled
from twin.coupling.variable_step.record_layout import DOUBLING


@dataclass(frozen=True, kw_only=True, eq=False)
class StepDoubling(Controlled):
    """Step doubling with Richardson extrapolation: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4.

    The two halves are kept; they are no shorter than `smallest`.
    """

    name: ClassVar[str] = "step_doubling"
    control: ClassVar[int] = DOUBLING
    fewest: ClassVar[int] = 2  # both halves
