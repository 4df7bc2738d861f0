"""Following from Python: an iterator of estimates that becomes a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.errors import SimulationError
from twin.follow.follower import follow, signals_of
from twin.follow.live import LiveFollowing
from twin.follow.live_problem import LiveProblem, has_rig, load_live
from twin.follow.problem import FollowProblem, load
from twin.installed import import_optional

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.follow.follower import Estimate


class Following:
    """Estimates of a follow file's recording or rig, one after the other while the iteration goes on.

    `rig`: address of JSON messages such as udp://127.0.0.1:4710, mqtt:// or zenoh://127.0.0.1/rig, or a file of sources; a rig has no end: leave the loop.
    After late measurements the estimates since then come again; `estimates` has the latest ones in the order of time.
    """

    def __init__(
        self,
        file: str | Path,
        recording: str | Path | None = None,
        rig: str | Path | None = None,
        build: str | Path = "build",
    ) -> None:
        self.build = Path(build)
        self.estimates: list[Estimate] = []
        is_live = rig is not None or (recording is None and has_rig(file))
        self.problem: FollowProblem | LiveProblem = load_live(file, rig) if is_live else load(file, recording)

    def __iter__(self) -> Iterator[Estimate]:
        self.estimates = []
        for estimates in self._revisions():
            while self.estimates and estimates and self.estimates[-1].time >= estimates[0].time:
                self.estimates.pop()
            for estimate in estimates:
                self.estimates.append(estimate)
                yield estimate

    def _revisions(self) -> Iterator[list[Estimate]]:
        if isinstance(self.problem, LiveProblem):
            yield from LiveFollowing(self.problem, self.build).revisions()
        else:
            for estimate in follow(self.problem, self.build):
                yield [estimate]

    def to_xarray(self) -> Any:
        """Return a Dataset over time [s] of all estimates so far, with the signals and units of a run of `twin follow`."""
        xarray = import_optional("xarray", "python", "a Dataset")
        if not self.estimates:
            raise SimulationError("there is no estimate yet. Iterate first: for estimate in twin.follow(...).")
        signals, columns = signals_of(self.problem, self.estimates)
        arrays = {
            column.name: ("time", signals.values[column.name], {"units": column.unit, "long_name": column.description})
            for column in columns
        }
        return xarray.Dataset(arrays, {"time": ("time", signals.time, {"units": "s"})})
