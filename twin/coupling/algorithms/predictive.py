"""Step control by the prediction error: extrapolated inputs against the values reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.controlled import Controlled
from twin.coupling.variable_step.record_layout import PREDICTED


@dataclass(frozen=True, kw_only=True, eq=False)
class Predictive(Controlled):
    """Step control by the prediction error; a step costs one step and a saved state, a third of step doubling."""

    name: ClassVar[str] = "predictive"
    control: ClassVar[int] = PREDICTED
