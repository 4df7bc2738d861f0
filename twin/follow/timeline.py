"""Following of measurements in any order: values by their time, and a model that is rewound to the step of a late one."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from twin import clock
from twin.follow.follower import Estimate, Follower, SavedFollower
from twin.identify import replay

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.arrays import Array
    from twin.follow.forecast import Forecast
    from twin.follow.live_problem import LiveProblem
    from twin.scenario import Case


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


class RevisableFollower:
    """Follower that accepts values up to `max_delay` late: the estimates are those of the same values in the order of their time.

    The first samples of the inputs must be in `timeline` at the start. Use it with `with`.
    """

    def __init__(self, problem: LiveProblem, timeline: Timeline, build: Path = Path("build")) -> None:
        self.problem, self.timeline = problem, timeline
        self.max_delay = max(1, int(problem.rig.max_delay // problem.experiment.case.step_ns))
        self._rows: list[Any] = []  # counters of the members that read the tables
        self._fill_tables(0, 0)
        self.follower = Follower(problem, build)
        recorded = {replay.member_name(number) for number in range(len(problem.inputs))}
        self._rows = [
            member.component.views["row"]  # type: ignore[attr-defined]
            for name, member in self.follower.batch.simulation.members.items()
            if name.partition("#")[0] in recorded  # of each copy, or shared by all
        ]
        self._changed = 0  # first step whose values have changed since it was computed
        self._snapshots: deque[SavedFollower] = deque([self.follower.save()])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.follower.__exit__()

    @property
    def tick(self) -> int:
        """Communication step reached."""
        return self.follower.tick

    @property
    def horizon(self) -> int:
        """Latest step that can no longer be changed."""
        return max(self.tick - self.max_delay, self._snapshots[0].tick)

    def add_measurement(self, number: int, time: float, value: float) -> bool:
        """Add a measured value of an output; False if it is too late."""
        if self.timeline.tick(time) <= self.horizon:
            return False
        self._note_change(self.timeline.add_measurement(number, time, value))
        return True

    def add_input(self, number: int, time: float, value: float) -> bool:
        """Add a sample of an input; False if it is too late. Values at and before the horizon remain as they were used."""
        if self.timeline.tick(time) <= self.horizon:
            return False
        self._note_change(self.timeline.add_input(number, time, value))
        return True

    def _note_change(self, tick: int | None) -> None:
        if tick is not None:
            self._changed = min(self._changed, max(tick, self.horizon + 1))

    def run(self, limit: int) -> list[Estimate]:
        """Advance to the last measurement up to a step; return the estimates from the first step that is new or has changed."""
        limit = max(limit, self.tick)
        if self._changed <= self.tick:
            self._rewind(self._changed)
        estimates = []
        for tick, measurements in self.timeline.visits(self.tick, limit, int(self.problem.longest_interval)):
            self._fill_tables(self.tick, tick)
            self.follower.advance(tick)
            estimates.append(self.follower.correct(measurements))
            self._snapshots.append(self.follower.save())
        self._changed = max(limit, self.tick) + 1
        while len(self._snapshots) > 1 and self._snapshots[1].tick <= self.tick - self.max_delay:
            self._snapshots.popleft()
        self.timeline.forget(self._snapshots[0].tick)
        return estimates

    def forecast(self) -> Forecast:
        """Forecast from the step reached, with all inputs held."""
        return self.follower.forecast()

    def _fill_tables(self, first: int, last: int) -> None:
        """Write the inputs of the next advance where the model reads them."""
        for number, table in enumerate(self.problem.tables):
            table[: last - first + 1] = self.timeline.rows(number, first, last)
        for row in self._rows:
            row[...] = 0

    def _rewind(self, tick: int) -> None:
        """Restore the last saved step before this one."""
        while len(self._snapshots) > 1 and self._snapshots[-1].tick >= tick:
            self._snapshots.pop()
        self.follower.restore(self._snapshots[-1])
