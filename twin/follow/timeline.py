"""Values of a rig in the order of their time, in whatever order they arrive: measurements by step, and samples of the inputs."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.scenario import Case

    Array = np.ndarray[Any, Any]


@dataclass
class InputSamples:
    """Samples of one input, by time [s]: linear between two of them, held after the last one and in gaps longer than `gap` [s]."""

    gap: float
    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def insert(self, time: float, value: float) -> float | None:
        """Insert a sample; return the time after which values have changed, None for one that is there already."""
        row = bisect_left(self.times, time)
        if row < len(self.times) and self.times[row] == time:
            return None
        self.times.insert(row, time)
        self.values.insert(row, value)
        if row == 0:
            return -np.inf
        before = self.times[row - 1]
        return before if time - before <= self.gap else float(np.nextafter(time, -np.inf))

    def at(self, times: Array) -> Array:
        """Return the input at some times; before the first sample, that one."""
        sample_times, values = np.array(self.times), np.array(self.values)
        result = np.interp(times, sample_times, values)
        rows = np.searchsorted(sample_times, times, side="right") - 1
        inside = (rows >= 0) & (rows + 1 < len(sample_times))
        rows = np.clip(rows, 0, max(len(sample_times) - 2, 0))
        if len(sample_times) > 1:
            held = inside & (sample_times[rows + 1] - sample_times[rows] > self.gap)
            result[held] = values[rows[held]]
        return np.asarray(result)

    def forget(self, time: float) -> None:
        """Remove samples that are needed for no time from this one on."""
        row = bisect_right(self.times, time) - 1
        if row > 0:
            del self.times[:row], self.values[:row]


class Timeline:
    """Measurements and inputs of a case by its communication steps. `gap` [s]: longest distance between samples of an input that is interpolated."""

    def __init__(self, case: Case, input_count: int, gap: float) -> None:
        self._begin, self._step, self._per_second = clock.to_ticks(case.start_ns, case.step_ns)
        self.begin, self.step = clock.seconds(case.start_ns), clock.seconds(case.step_ns)
        self.inputs = [InputSamples(gap) for _ in range(input_count)]
        self._measured: dict[int, dict[int, tuple[float, float]]] = {}  # tick -> output -> time, value
        self._ticks: list[int] = []

    def tick(self, time: float) -> int:
        """Return the communication step nearest to a time [s]."""
        return int(np.rint((time - self.begin) / self.step))

    def add_measurement(self, number: int, time: float, value: float) -> int | None:
        """Add a value of an output; return its communication step, None if it changes nothing: a step uses its latest value."""
        tick = self.tick(time)
        values = self._measured.get(tick)
        if values is None:
            values = self._measured[tick] = {}
            insort(self._ticks, tick)
        if number in values and values[number][0] >= time:
            return None
        values[number] = (time, value)
        return tick

    def add_input(self, number: int, time: float, value: float) -> int | None:
        """Add a sample of an input; return the first communication step at which the input changes, None if it is there already."""
        since = self.inputs[number].insert(time, value)
        if since is None:
            return None
        return 0 if since == -np.inf else int(np.floor((since - self.begin) / self.step)) + 1

    def visits(self, after: int, limit: int, idle: int) -> Iterator[tuple[int, dict[int, float]]]:
        """Yield the steps to stop at after step `after` and up to `limit`, with their measurements in the order of the outputs.

        Where nothing is measured for `idle` steps, a step without measurements comes in between.
        """
        row = bisect_right(self._ticks, after)
        while True:
            tick = self._ticks[row] if row < len(self._ticks) else limit + 1
            while after + idle < min(tick, limit + 1):
                after += idle
                yield after, {}
            if tick > limit:
                return
            yield tick, {number: value for number, (_, value) in sorted(self._measured[tick].items())}
            after, row = tick, row + 1

    def rows(self, number: int, first: int, last: int) -> Array:
        """Return an input at the communication steps `first` to `last`, both included."""
        times = (self._begin + np.arange(first, last + 1) * self._step) / self._per_second
        return self.inputs[number].at(times)

    def forget(self, tick: int) -> None:
        """Remove what is needed for no step from this one on."""
        count = bisect_left(self._ticks, tick)
        for old in self._ticks[:count]:
            del self._measured[old]
        del self._ticks[:count]
        for samples in self.inputs:
            samples.forget(self.begin + tick * self.step)
