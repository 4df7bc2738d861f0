"""A model that is a formula, as an identification sees it: what is linear has intervals that are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from twin.errors import SimulationError
from twin.identify import Output, Unknown

MATRIX = np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 3.0], [0.5, -1.0], [3.0, 1.0], [0.0, 2.0], [1.0, 1.0], [2.0, -1.0]])
TRUTH = np.array([0.4, 0.6])


class Formula:
    """Predicts `function(positions)`, an array for each output; a SimulationError where it is None."""

    def __init__(self, function, measured, *, noise=0.01, loss="linear", unknowns=2, slopes=None):
        noises = [noise] * len(measured) if not isinstance(noise, list) else noise
        outputs = tuple(
            Output(
                f"y{i}", "a.csv", f"m.y{i}", "m", "mm", np.arange(len(y)) * 0.1, np.array(y, float), 0.0, 0.0, noise=n
            )
            for i, (y, n) in enumerate(zip(measured, noises, strict=True))
        )
        self.problem = SimpleNamespace(
            outputs=outputs,
            unknowns=tuple(
                Unknown(f"m.p{i}", "m", 0.0, 10.0, 5.0, member="m", variable=f"p{i}") for i in range(unknowns)
            ),
            count=sum(len(one.values) for one in outputs),
            positions=lambda: np.full(unknowns, 0.5),
            keys=SimpleNamespace(loss=loss, confidence=0.9),
        )
        self.function, self._slopes = function, slopes
        self.refused, self.compared, self.used, self.count, self.derivatives = "", False, False, 0, "differences"

    def predicted(self, positions):
        self.count += 1
        if (found := self.function(np.array(positions))) is None:
            raise SimulationError("it fails")
        return found

    def slopes(self, positions):
        return None if self._slopes is None else self._slopes(positions)


def straight(errors, **options):
    """A linear model of two unknowns, measured at their true values with these errors."""
    return Formula(lambda x: [MATRIX @ x], [MATRIX @ TRUTH + np.asarray(errors)], **options)
