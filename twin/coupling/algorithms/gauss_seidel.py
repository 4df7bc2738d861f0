"""Gauss-Seidel: members step one after the other along the connections; later members use outputs of the same step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from twin.coupling.algorithms.algorithm import Algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussSeidel(Algorithm):
    """Gauss-Seidel coupling; with an `order`, inputs are interpolated if the source stepped before, else extrapolated."""

    name: ClassVar[str] = "gauss_seidel"
    is_sequential: ClassVar[bool] = True


Algorithm.gauss_seidel = GaussSeidel()
