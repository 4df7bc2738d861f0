"""Signals of a session as curves of a chart: elements of arrays separately, in display units."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.live import RefusedError
from twin.web import frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from twin.live import CatalogSignal, LiveSession, RecordingReader

PREVIOUS = "previous run: "  # prefix of a signal: the same signal of the previous run
MAX_ELEMENTS = 16  # larger arrays, e.g. shapes and spectra, are shown by the animation only


class SessionCurves:
    """The source of the charts of one run of a session. `previous_run`: shown faintly for comparison."""

    def __init__(self, live: LiveSession, previous_run: SessionCurves | None = None) -> None:
        assert live.catalog is not None
        self.live, self._catalog, self.epoch = live, live.catalog, live.state.epoch
        self._reader: RecordingReader | None = None
        self._begin = time.strftime("%H:%M")
        if previous_run is not None and not previous_run.has_moved:  # nothing to compare with
            previous_run = previous_run.previous_run
        self.previous_run: SessionCurves | None = previous_run
        if self.previous_run is not None:
            self.previous_run.previous_run = None
        self.signals = {
            name: signal for signal in live.catalog.signals.values() if signal.recorded for name in elements(signal)
        }
        self._clock = next(iter(self.signals), "")

    @property
    def title(self) -> str:
        """Variant, whether values were changed by hand, and time of day; with controls everything is by hand."""
        is_changed = bool(self.live.changes.get(self.epoch)) and not self._catalog.controls
        return f"{self._catalog.variant}{', changed by hand' * is_changed}, {self._begin}"

    @property
    def has_moved(self) -> bool:
        """Whether the run went on beyond its start, as far as the charts have read it."""
        return self._reader is not None and self.span()[1] > self._catalog.start

    def names(self) -> Collection[str]:
        """Return the recorded scalars, also those of the previous run."""
        return [*self.signals, *(f"{PREVIOUS}{name}" for name in self.signals if self.previous(name))]

    def previous(self, name: str) -> str:
        """Return the name of the same signal of the previous run, or nothing."""
        return f"{PREVIOUS}{name}" if self.previous_run is not None and name in self.previous_run.signals else ""

    def reader(self) -> RecordingReader:
        """Return the reader of this run, valid also during the next run. RefusedError if there are none."""
        if self._reader is None:
            if self.live.state.epoch != self.epoch:
                raise RefusedError("nothing was recorded.")
            self._reader = self.live.reader()
        return self._reader

    def span(self) -> tuple[float, float]:
        """Return the times from the start to the last row [s]."""
        start = self._catalog.start
        with suppress(RefusedError):  # no row is recorded yet
            times = self.reader().latest([self._clock]).time
            return start, float(times[-1]) if times.size else start
        return start, start

    def read(
        self, name: str, start: float, stop: float, points: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a window with the row before it, so that a line begins at the edge."""
        if name.startswith(PREVIOUS) and self.previous_run is not None:
            return self.previous_run.read(name.removeprefix(PREVIOUS), start, stop, points)
        try:
            rows = self.reader().read([name], start - self._catalog.every, stop)
        except RefusedError:
            return np.empty(0), np.empty(0)
        signal, times = self.signals[name], rows.time
        values = np.asarray(rows.values[name], np.float64).reshape(len(times))
        first = round((times[0] - self._catalog.start) / self._catalog.every) if len(times) else 0
        return frames.decimate(times, signal.factor * values + signal.offset, points, first)


def elements(signal: CatalogSignal) -> Iterator[str]:
    """Yield the names of the scalars of a signal; none of a large array or a text."""
    if signal.type == "String" or prod(signal.shape) > MAX_ELEMENTS:
        return
    if not signal.shape:
        yield signal.name
    else:
        for index in product(*(range(1, size + 1) for size in signal.shape)):
            yield f"{signal.name}[{','.join(map(str, index))}]"


def start_value(name: str, signal: CatalogSignal) -> Any:
    """Return the start value of a scalar of a signal, in its own unit."""
    value = signal.start
    for index in name[len(signal.name) + 1 : -1].split(",") if name != signal.name else []:
        value = value[int(index) - 1] if isinstance(value, list | tuple) and value else None
    return value


def shown_value(signal: CatalogSignal, value: Any) -> float:
    """Return a value in the display unit; 0 for what is no number."""
    own = float(value) if isinstance(value, int | float) else 0.0
    return float(f"{signal.factor * own + signal.offset:.9g}")


def value_text(signal: CatalogSignal, value: Any) -> str:
    """Return a value of a signal in words: with its display unit, or the text of its item."""
    if signal.type == "Boolean":
        return str(bool(value)).lower()
    item = next((text for text, number in signal.items.items() if number == value), "")
    return item or f"{shown_value(signal, value):.6g} {signal.display_unit}".rstrip()
