"""Following of measurements in any order: a late one rewinds the model to its step, and all later ones are repeated."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from twin.follow.follower import Follower, SavedFollower
from twin.follow.timeline import Timeline
from twin.identify import replay

if TYPE_CHECKING:
    from twin.follow.follower import Estimate
    from twin.follow.forecasting.forecast import Forecast
    from twin.follow.live_problem import LiveProblem


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
