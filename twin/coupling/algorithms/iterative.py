"""Implicit coupling: every step is iterated until the inputs at its end agree with the outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from twin.coupling.algorithms.algorithm import LIMITS, Algorithm, Limits
from twin.errors import CouplingError

CONSEQUENCES = ("note", "stop")


@dataclass(frozen=True, kw_only=True, eq=False)
class Iterative(Algorithm):
    """Implicit coupling with members in sequence.

    `order` 0: inputs have the values of the end of the step; 1, 2: they follow a polynomial over the step, which is more
    accurate. `acceleration`: relaxed, aitken, anderson or newton. `agreement`: tolerance of each value, relative to its
    largest value so far, or to `floor` [SI]. `scales`: such values known in advance. `unsolved`: consequence if
    `iterations` do not suffice: `note` (the last iteration is kept) or `stop`.
    """

    name: ClassVar[str] = "iterative"
    is_sequential: ClassVar[bool] = True
    limits: ClassVar[Mapping[str, Limits]] = {**LIMITS, "iterations": (1, 1000, False)}

    acceleration: str = "anderson"  # type: ignore[misc]
    agreement: float = 1e-6  # type: ignore[misc]
    iterations: int = 20  # type: ignore[misc]
    floor: float = 1e-12  # type: ignore[misc]
    scales: Mapping[str, Any] = field(default_factory=dict)  # type: ignore[misc]
    unsolved: str = "note"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unsolved not in CONSEQUENCES:
            raise CouplingError(f"algorithm: unsolved of {self.name} is {self.unsolved!r}. Give note or stop.")

    @property
    def is_strict(self) -> bool:  # type: ignore[override]
        """Whether a step that does not converge ends the run."""
        return self.unsolved == "stop"
