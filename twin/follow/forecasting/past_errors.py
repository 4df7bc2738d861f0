"""Errors of past forecasts of measured signals: they say how wide the bands of the next ones have to be."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.follow.forecasting.forecast import Forecast

    Array = np.ndarray[Any, Any]

SHARE = 0.9  # of the measured values that a band is to hold
FEWEST = 9  # errors, before they change a band: the largest of nine is the quantile of 90 % of ten


class PastErrors:
    """Errors of forecasts, in half widths of their bands, of each measured signal (by its number) and point of a forecast.

    A band is widened or narrowed by the quantile of these errors in a time before it: split conformal prediction (Vovk, Gammerman
    and Shafer, Algorithmic Learning in a Random World, 2005) with a moving set of calibration, for errors that change over time.
    Measured values are interpolated between the two measurements around a point. `memory`: that time [communication steps].
    """

    def __init__(self, memory: int, measured: Mapping[int, int]) -> None:
        self.memory, self._signals = memory, dict(measured)  # number of the measured value -> signal of the forecasts
        self._due: deque[tuple[int, int, Array]] = deque()  # time and point of a forecast, its bands (3, signals)
        self._errors: dict[tuple[int, int], deque[tuple[int, float]]] = {}
        self._last: dict[int, tuple[int, float]] = {}

    def add(self, ticks: Array, bands: Array) -> None:
        """Add a forecast. `ticks`: of its points, (k,); `bands`: before they are widened, (3, k, signals)."""
        self._due.extend((tick, point, bands[:, point]) for point, tick in enumerate(ticks.tolist()))

    def measure(self, tick: int, number: int, value: float) -> None:
        """Take a measured value; one that is older than the last of this signal is ignored."""
        if number not in self._signals:
            return
        signal = self._signals[number]
        before = self._last.get(signal)
        if before is not None and tick <= before[0]:
            return
        self._last[signal] = tick, value
        if before is not None:
            for due, point, (low, median, high) in self._due:
                if before[0] < due <= tick:
                    part = (due - before[0]) / (tick - before[0])
                    error = before[1] + part * (value - before[1]) - median[signal]
                    width = high[signal] - median[signal] if error > 0.0 else median[signal] - low[signal]
                    if width > 0.0:
                        errors = self._errors.setdefault((point, signal), deque())
                        errors.append((due, abs(error) / width))
        is_complete = len(self._last) == len({*self._signals.values()})
        passed = min(last[0] for last in self._last.values()) if is_complete else tick - self.memory
        while self._due and self._due[0][0] <= passed:
            self._due.popleft()

    def factors(self, tick: int, points: int, signals: int) -> Array:
        """Return factors on the widths of bands, (points, signals): 1 where there are too few errors."""
        result = np.ones((points, signals))
        for (point, signal), errors in self._errors.items():
            while errors and errors[0][0] < tick - self.memory:
                errors.popleft()
            count = len(errors)
            if count >= FEWEST and point < points:
                level = min(1.0, SHARE * (count + 1) / count)
                result[point, signal] = np.quantile([error for _, error in errors], level, method="inverted_cdf")
        return result


def widened(forecast: Forecast, factors: Array) -> Array:
    """Return the draws of a forecast, (k, draws, signals), with their distances from the median by factors, (k, signals)."""
    median = np.median(forecast.draws, axis=1, keepdims=True)
    return np.asarray(median + factors[:, None, :] * (forecast.draws - median))
