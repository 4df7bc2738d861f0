"""Fixed-lag smoothing: past estimates are corrected by the measurements that come after them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from twin.arrays import Array
    from twin.follow.filters import Ensemble, SquareRootFilter


@dataclass(frozen=True)
class SmoothedEstimate:
    """Estimate at `time` [s] with the measurements up to one lag later. `values` (n,), `covariance` (n, n)."""

    time: float
    values: Array
    covariance: Array

    @property
    def deviations(self) -> Array:
        """Standard deviations."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


class FixedLagSmoother:
    """Estimates of the last `lag` communication steps, corrected by each measurement.

    Rauch, Tung and Striebel, AIAA J. 3(8), 1965, with gains by the points of the filter (Sarkka, IEEE Trans. Autom. Control 53(3),
    2008; with an ensemble: Raanes, Q. J. R. Meteorol. Soc. 142, 2016). The recursion over the window is solved forwards: each past
    estimate keeps the product of the gains since then, so that a measurement corrects all of them at once. Arrays are replaced, never
    changed, so that a shallow copy is a saved state.
    """

    def __init__(self, lag: int, low: Array, high: Array) -> None:
        self.lag, self.low, self.high = lag, low, high
        n = len(low)
        self._ticks: Array = np.zeros(0, int)
        self._times = np.zeros(0)
        self._means, self._covariances, self._gains = np.zeros((0, n)), np.zeros((0, n, n)), np.zeros((0, n, n))

    def correct(
        self, filter_: SquareRootFilter | Ensemble, tick: int, time: float, past: Array, points: Array
    ) -> SmoothedEstimate | None:
        """Correct the window after a measurement at `points`, as the model has moved them. `past`: `filter_.past_deviations`.

        Return the latest estimate that is at least one lag old, None before the first one.
        """
        points = points + filter_.excess
        predicted, moved = filter_.center(points), filter_.deviations(points)
        gains = self._gains @ regression(moved, past)
        change = filter_.covariance - moved.T @ moved
        means = self._means + gains @ (filter_.mean - predicted)
        covariances = self._covariances + gains @ change @ gains.transpose(0, 2, 1)
        n = len(self.low)
        self._ticks, self._times = np.append(self._ticks, tick), np.append(self._times, time)
        self._means = np.vstack([means, filter_.mean])
        self._covariances = np.concatenate([covariances, filter_.covariance[None]])
        self._gains = np.concatenate([gains, np.eye(n)[None]])
        first = int(np.searchsorted(self._ticks, tick - self.lag, side="right")) - 1
        if first < 0:
            return None
        self._ticks, self._times, self._gains = self._ticks[first:], self._times[first:], self._gains[first:]
        self._means, self._covariances = self._means[first:], self._covariances[first:]
        values = np.clip(self._means[0], self.low, self.high)
        return SmoothedEstimate(float(self._times[0]), values, self._covariances[0])


def regression(moved: Array, past: Array) -> Array:
    """Return G, (n, n), with the least squares of `past` - `moved` G', both (rows, n): the gain of the smoother."""
    scale = np.linalg.norm(moved, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray((np.linalg.lstsq(moved / scale, past, rcond=None)[0] / scale[:, None]).T)
