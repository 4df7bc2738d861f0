"""Jacobi: all members step at once, with inputs of the begin of the step, or extrapolated from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.algorithm import Algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class Jacobi(Algorithm):
    """Jacobi coupling; with an `order`, inputs are extrapolated."""

    name: ClassVar[str] = "jacobi"


Algorithm.jacobi = Jacobi()
