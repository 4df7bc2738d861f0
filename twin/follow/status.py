"""Status of a followed rig for a page: whether the twin represents it, estimates, changes and the last forecast.

It is a file of the run, `following.json`, that is replaced while the rig is followed.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.follow.changes import SETTLE, SURE, Alarm
from twin.results import run_folder

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.follow.follower import Estimate
    from twin.follow.forecast import Forecast
    from twin.follow.problem import FollowProblem

STATUS_FILE = "following.json"
RECENT, LEAST = 5.0, 50  # the twin is judged by the measurements of so long a time [s], and by at least so many
REPRESENTED = 0.8  # fraction of NIS in its band below which the model does not represent the rig
LOST = "The twin no longer represents the rig."


@dataclass
class FollowStatus:
    """Status after the estimates that were added. `since`: time from which on the twin does not represent the rig [s].

    The first seconds are not judged: the estimate is found first.
    """

    problem: FollowProblem
    alarms: list[Alarm] = field(default_factory=list)
    since: float | None = None
    reason: str = ""
    forecast: Forecast | None = None
    last: Estimate | None = None
    _begin: float | None = None  # time of the first estimate [s]
    _recent: deque[tuple[float, bool]] = field(default_factory=deque)  # time, NIS in its band

    def add(self, estimates: Sequence[Estimate]) -> None:
        """Add estimates in place of those from the first one's time on."""
        if not estimates:
            return
        begin = estimates[0].time
        self._begin = begin if self._begin is None else min(begin, self._begin)
        while self._recent and self._recent[-1][0] >= begin:
            self._recent.pop()
        self.alarms = [alarm for alarm in self.alarms if alarm.time < begin]
        if self.since is not None and self.since >= begin:
            self.since, self.reason = None, ""
        for estimate in estimates:
            self.last, self.forecast = estimate, estimate.forecast or self.forecast
            if estimate.alarm is not None:
                self.alarms.append(estimate.alarm)
            if estimate.band[1] > 0.0 and estimate.time >= self._begin + SETTLE:
                self._recent.append((estimate.time, estimate.is_in_band))
            while len(self._recent) > LEAST and self._recent[0][0] < estimate.time - RECENT:
                self._recent.popleft()
            self._judge(estimate)

    def _judge(self, estimate: Estimate) -> None:
        """Update `since` and `reason`."""
        reason = ""
        if len(self._recent) >= LEAST and self.fraction < REPRESENTED:
            reason = f"NIS was in its 95 % band at {100.0 * self.fraction:.0f} % of the last {len(self._recent)} times."
        if estimate.changes is not None and estimate.changes[1] > SURE:
            reason = "No listed change explains the measurements."
        if reason and self.since is None:
            self.since = estimate.time
        elif not reason:
            self.since = None
        self.reason = reason

    @property
    def fraction(self) -> float:
        """Fraction of the last times with measurements at which NIS lay in its band; NaN without any."""
        return float(np.mean([inside for _, inside in self._recent])) if self._recent else math.nan

    def content(self) -> dict[str, Any]:
        """Return the status as plain data, in the variables' own units and seconds."""
        assert self.last is not None
        return {
            "time": self.last.time,
            "represents": self.since is None,
            "since": self.since,
            "reason": self.reason,
            "nis_in_band": self.fraction,
            "estimates": {
                variable.name: {"value": float(value), "deviation": float(deviation)}
                for variable, value, deviation in zip(
                    self.problem.estimates, self.last.values, self.last.deviations, strict=True
                )
            },
            "looks_for_changes": bool(self.problem.changes),
            "changes": [asdict(alarm) for alarm in self.alarms],
            "forecast": self._forecast_content(),
        }

    def _forecast_content(self) -> dict[str, Any] | None:
        """Return the last forecast: times, and the 90 % band of each signal with the chance to leave its limits."""
        forecast, settings = self.forecast, self.problem.forecast
        if forecast is None or settings is None:
            return None
        bands = forecast.bands
        return {
            "start": forecast.start,
            "time": forecast.time.tolist(),
            "signals": {
                signal: {
                    **{name: bands[k, :, i].tolist() for k, name in enumerate(("low", "median", "high"))},
                    "chance": float(forecast.chance[i]),
                    "limits": list(settings.limits.get(signal, ())),
                }
                for i, signal in enumerate(forecast.signals)
            },
        }

    def write(self, folder: Path) -> None:
        """Write the file of a run; OSError if the disk does not take it."""
        run_folder.write_summary(folder / STATUS_FILE, self.content())
