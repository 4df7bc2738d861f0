"""One member after the other, along the connections: whoever comes later sees what was published just before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.algorithm import Algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussSeidel(Algorithm):
    """Members in sequence; with an `order`, inputs are interpolated where the source went before, else extrapolated."""

    name: ClassVar[str] = "gauss_seidel"
    is_sequential: ClassVar[bool] = True


Algorithm.gauss_seidel = GaussSeidel()
