"""Copies of a model that carry tangents: the points of the extended Kalman filter are those of the linearized model."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling import Transfer
from twin.follow.batch import Batch
from twin.follow.filtering.tangent_components import slope_name
from twin.follow.filtering.tangent_model import with_tangents

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.coupling import Catalog
    from twin.follow.problem import FollowProblem

    Array = np.ndarray[Any, Any]


class TangentBatch(Batch):
    """Batch whose first copy is the model at the estimate; the next ones are the same model, each with its direction.

    A point of `write` is the estimate plus a direction; `read` and `outputs` return it moved by the linearized model.
    """

    def __init__(
        self,
        problem: FollowProblem,
        count: int,
        build: Path,
        parameters: Sequence[str] = (),
        interval: float = inf,
    ) -> None:
        model = with_tangents(problem, interval)
        signals = [output.signal for output in problem.outputs]
        own = [path for path in map(slope_name, signals) if has_variable(path, model.experiment.catalog)]
        super().__init__(model, count, build, parameters, [*signals, *own], interval)
        self._numbers = {
            number: len(signals) + own.index(slope_name(signal))
            for number, signal in enumerate(signals)
            if slope_name(signal) in own
        }
        self._slopes = np.zeros((count, len(problem.estimates)))
        table = self._table([slope_name(estimate.name) for estimate in problem.estimates], self._slopes)
        self._put_slopes = Transfer(self.simulation, build, [(array, value, 1) for value, array in table])
        self._take_slopes = Transfer(self.simulation, build, [(value, array, 1) for value, array in table])

    def write(self, points: Array, *, sharing: int) -> None:
        """Set the first copies to the first point, with the directions to the other ones."""
        values = points.copy()
        values[:sharing] = points[0]
        self._slopes[:] = 0.0
        self._slopes[1:sharing] = points[1:sharing] - points[0]
        self.copy_memory(range(1, sharing))  # the first copy has tangents of zero
        self._put_slopes()
        super().write(values, sharing=0)

    def read(self) -> Array:
        """Return the estimated variables of all copies moved by their directions, (count, n)."""
        values = super().read()
        self._take_slopes()
        return self._finite(values + self._slopes, [estimate.name for estimate in self.problem.estimates])

    def outputs(self, numbers: Sequence[int]) -> Array:
        """Return measured signals of all copies moved by their directions, (count, m)."""
        carried = [column for column, number in enumerate(numbers) if number in self._numbers]
        values = super().outputs([*numbers, *(self._numbers[numbers[column]] for column in carried)])
        result = values[:, : len(numbers)]
        result[:, carried] += values[:, len(numbers) :]
        return result


def has_variable(path: str, catalog: Catalog) -> bool:
    """Whether a member has a variable."""
    member, _, name = path.partition(".")
    return name.partition("[")[0] in catalog[member]
