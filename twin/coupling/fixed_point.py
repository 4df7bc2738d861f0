"""Solver of algebraic loops: G(x) = x by Newton's method with a Jacobian by differences, or by repeated substitution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Vector = np.ndarray[Any, Any]

DIFFERENCE = 1e-7  # relative step of the differences


@dataclass
class FixedPoint:
    """An equation G(x) = x.

    `tolerance`: relative change of x at which it is solved. `smallest`: magnitude below which the steps of the differences
    are not reduced further. `renewal`: iterations for which a Jacobian is used; the last one serves the next solution too.
    `singular`: condition number above which a solution is given up, see `is_singular`. Not `is_smooth`: repeated substitution.
    """

    evaluate: Callable[[Vector], Vector]
    tolerance: float
    iterations: int
    smallest: float
    renewal: int = 1
    singular: float = np.inf
    is_smooth: bool = True
    jacobian: Vector | None = None

    def solve(self, x: Vector) -> tuple[Vector, Vector] | None:
        """Return the solution from a first guess, and G of it, which was evaluated last; None if none was found."""
        for iteration in range(self.iterations):
            image = self.evaluate(x)
            scale = np.maximum(np.maximum(np.abs(x), np.abs(image)), 1e-12)
            if np.all(np.abs(image - x) <= self.tolerance * scale):
                return x, image
            if not self.is_smooth:
                x = image
            else:
                system = np.eye(len(x)) - self._find_jacobian(x, image, iteration)
                if self.singular < np.inf and is_singular(system, self.singular):
                    break
                try:
                    x = x + np.linalg.solve(system, image - x)
                except np.linalg.LinAlgError:
                    break
            if not np.all(np.isfinite(x)):
                break
        self.jacobian = None
        return None

    def _find_jacobian(self, x: Vector, image: Vector, iteration: int) -> Vector:
        """Return the Jacobian of G, by differences if it is due."""
        if self.jacobian is None or (iteration + 1) % self.renewal == 0:
            self.jacobian = np.empty((len(x), len(x)))
            for i in range(len(x)):
                step = DIFFERENCE * max(abs(x[i]), self.smallest)
                shifted = x.copy()
                shifted[i] += step
                self.jacobian[:, i] = (self.evaluate(shifted) - image) / step
        return self.jacobian


def is_singular(system: Vector, limit: float) -> bool:
    """Whether the condition number of I - J exceeds a limit; the largest singular value counts as at least 1, that of I.

    So a single equation can be singular too, whose ordinary condition number is always 1.
    """
    sizes = np.linalg.svd(system, compute_uv=False)
    return bool(max(1.0, sizes[0]) > limit * sizes[-1])
