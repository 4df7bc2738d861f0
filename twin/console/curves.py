"""Signals of a session as curves of a chart: elements of arrays separately, in display units."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from twin.live import RefusedError
from twin.web import frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from twin.live import CatalogSignal, LiveSession

MAX_ELEMENTS = 16  # larger arrays, e.g. shapes and spectra, are shown by the animation only


class SessionCurves:
    """The source of the charts of a session."""

    def __init__(self, live: LiveSession) -> None:
        assert live.catalog is not None
        self.live, self._catalog = live, live.catalog
        self.signals = {
            name: signal for signal in live.catalog.signals.values() if signal.recorded for name in elements(signal)
        }
        self._clock = next(iter(self.signals), "")

    def names(self) -> Collection[str]:
        """Return the recorded scalars."""
        return self.signals.keys()

    def span(self) -> tuple[float, float]:
        """Return the times from the start to the last row [s]."""
        start = self._catalog.start
        with suppress(RefusedError):  # no row is recorded yet
            time = self.live.latest([self._clock]).time
            return start, float(time[-1]) if time.size else start
        return start, start

    def read(
        self, name: str, start: float, stop: float, points: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a window with the row before it, so that a line begins at the edge."""
        try:
            rows = self.live.read([name], start - self._catalog.every, stop)
        except RefusedError:
            return np.empty(0), np.empty(0)
        signal, time = self.signals[name], rows.time
        values = np.asarray(rows.values[name], np.float64).reshape(len(time))
        first = round((time[0] - self._catalog.start) / self._catalog.every) if len(time) else 0
        return frames.decimate(time, signal.factor * values + signal.offset, points, first)


def elements(signal: CatalogSignal) -> Iterator[str]:
    """Yield the names of the scalars of a signal; none of a large array or a text."""
    if signal.type == "String" or prod(signal.shape) > MAX_ELEMENTS:
        return
    if not signal.shape:
        yield signal.name
    else:
        for index in product(*(range(1, size + 1) for size in signal.shape)):
            yield f"{signal.name}[{','.join(map(str, index))}]"
