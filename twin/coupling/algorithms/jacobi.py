"""All members at once: everybody sees the others as they were at the begin of the step, or as they tend from there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.algorithm import Algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class Jacobi(Algorithm):
    """Members in parallel; with an `order`, inputs are extrapolated."""

    name: ClassVar[str] = "jacobi"


Algorithm.jacobi = Jacobi()
