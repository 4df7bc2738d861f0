"""Steps as long as the error allows: what inputs were thought to become, against what they became."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.controlled import Controlled
from twin.coupling.variable_step.record_layout import PREDICTED


@dataclass(frozen=True, kw_only=True, eq=False)
class Predictive(Controlled):
    """A step costs one step and what it takes to go back, a third of step doubling."""

    name: ClassVar[str] = "predictive"
    control: ClassVar[int] = PREDICTED
