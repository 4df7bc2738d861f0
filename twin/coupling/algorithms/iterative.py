"""Every step is repeated until the inputs at its end agree with the outputs there: an implicit coupling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from twin.coupling.algorithms.algorithm import Algorithm, scheme_named
from twin.errors import CouplingError

CONSEQUENCES = ("note", "stop")


@dataclass(frozen=True, kw_only=True, eq=False)
class Iterative(Algorithm):
    """Members in sequence, again and again.

    `order` 0: inputs are those of the end of the step; 1, 2: their course over the step, which is more exact.
    `acceleration`: relaxed, aitken, anderson or newton. `agreement`: of each value, relative to the largest it had, or
    to `floor` [SI]. `scales`: such values that are known before. `unsolved`: what follows if `iterations` do not
    suffice: `note`, and the last one counts, or `stop`.
    """

    name: ClassVar[str] = "iterative"
    is_sequential: ClassVar[bool] = True

    acceleration: str = "anderson"
    agreement: float = 1e-6  # type: ignore[misc]
    iterations: int = 20  # type: ignore[misc]
    floor: float = 1e-12  # type: ignore[misc]
    scales: Mapping[str, Any] = field(default_factory=dict)  # type: ignore[misc]
    unsolved: str = "note"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._limited("agreement", 0.0, 1.0, above=True)
        self._limited("iterations", 1, 1000)
        self._limited("floor", 0.0, 1e300, above=True)
        scheme_named(self.acceleration, self.name)
        if self.unsolved not in CONSEQUENCES:
            raise CouplingError(f"algorithm: unsolved of {self.name} is {self.unsolved!r}. Give note or stop.")

    @property
    def is_strict(self) -> bool:  # type: ignore[override]
        """Whether a step that stays unsolved ends the run."""
        return self.unsolved == "stop"

    @property
    def scheme(self) -> int:  # type: ignore[override]
        """Number of the acceleration."""
        return scheme_named(self.acceleration, self.name)
