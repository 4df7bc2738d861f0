"""Clocks of sources: offset and drift against the host's clock, jumps, and the time of the model.

A message of stamp s arrives at a = s + offset(s) + delay with delay >= 0. The offset is therefore the line below all points
(s, a - s): the edge of their lower convex hull over the mean stamp (Zhang, Liu and Xia, IEEE INFOCOM 2002, after Moon, Skelly and
Towsley, IEEE INFOCOM 1999). The least delay of a source cannot be told from its offset: what remains of it is the error.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from twin import clock

if TYPE_CHECKING:
    from twin.follow.schema import RigKeys

BUCKET = 1.0  # of each second the message with the least delay counts [s]
WINDOW = 60  # buckets from which offset and drift follow
DRIFT_FROM = 10  # buckets from which on a drift is estimated: before, delays would be taken for one
PERSISTENCE = (
    1.0  # so long all stamps of a clock must be wrong until it has jumped [s]: a burst of delayed messages is shorter
)
FEWEST = 3  # messages in that time


@dataclass
class SensorClock:
    """Offset [s] and drift of a clock: host time = stamp + offset + drift * (stamp - origin).

    `tolerance` [s]: largest delay of a message. `outlier` [s]: how late the last message was whose stamp alone did not fit; 0: none.
    """

    tolerance: float
    offset: float = 0.0
    drift: float = 0.0
    origin: float = 0.0
    outlier: float = 0.0
    _points: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=WINDOW))  # stamp, least difference
    _strange: list[tuple[float, float]] = field(default_factory=list)  # arrival, difference of stamps that do not fit

    def at(self, stamp: float) -> float:
        """Return host time minus source time at a stamp [s]."""
        return self.offset + self.drift * (stamp - self.origin)

    def add(self, stamp: float, arrival: float, *, was_lost: bool = False) -> float | None:
        """Add a message; return 0, None if its stamp does not fit, or by how much the clock has jumped ahead [s].

        `was_lost`: the source was silent before, so that its clock may have begun anew.
        """
        self.outlier, difference = 0.0, arrival - stamp
        if not self._points:
            self._restart(stamp, difference)
            return 0.0
        lateness = difference - self.at(stamp)
        if abs(lateness) <= self.tolerance:
            if self._strange:
                self.outlier = self._strange[-1][1] - self.at(stamp)
                self._strange.clear()
            self._keep(stamp, difference)
            return 0.0
        self._strange = [(a, d) for a, d in self._strange if abs(d - difference) <= self.tolerance]
        self._strange.append((arrival, difference))
        lasts = arrival - self._strange[0][0] >= PERSISTENCE and len(self._strange) >= FEWEST
        if not (lasts or was_lost):
            return None
        least = min(d for _, d in self._strange)
        jump = self.at(self._points[-1][0]) - least
        self._restart(stamp, least)
        return jump

    def _restart(self, stamp: float, difference: float) -> None:
        self._points.clear()
        self._strange.clear()
        self._points.append((stamp, difference))
        self.origin, self.offset, self.drift = stamp, difference, 0.0

    def _keep(self, stamp: float, difference: float) -> None:
        last = self._points[-1]
        if stamp // BUCKET > last[0] // BUCKET:
            self._points.append((stamp, difference))
            self._fit()
        elif stamp // BUCKET == last[0] // BUCKET and difference < last[1]:
            self._points[-1] = (stamp, difference)
            self._fit()

    def _fit(self) -> None:
        """Fit the line below all points."""
        points = np.array(self._points)
        if len(points) < DRIFT_FROM:
            self.origin, self.offset, self.drift = float(points[-1, 0]), float(points[:, 1].min()), 0.0
            return
        hull: list[tuple[float, float]] = []
        for x, y in points.tolist():
            while len(hull) > 1 and slope(hull[-2], hull[-1]) >= slope(hull[-1], (x, y)):
                hull.pop()
            hull.append((x, y))
        mean = float(points[:, 0].mean())
        edge = next(i for i in range(1, len(hull)) if hull[i][0] >= mean)
        self.drift = slope(hull[edge - 1], hull[edge])
        self.origin, self.offset = hull[edge]


def slope(first: tuple[float, float], second: tuple[float, float]) -> float:
    """Return the slope of the line through two points."""
    return (second[1] - first[1]) / (second[0] - first[0])


class RigClock:
    """Times of the model from the stamps of all sources. The model follows the clock of the first source, exactly.

    Times of other clocks pass through the host's. `begin`: time of the model [s] at the stamp `origin` of the first source.
    """

    def __init__(self, rig: RigKeys, begin: float) -> None:
        tolerance = clock.seconds(rig.max_delay)
        self.kinds = {name: source.clock for name, source in rig.sources.items()}
        self.reference = next(iter(self.kinds))
        own = [
            name for name, kind in self.kinds.items() if kind != "arrival" and (kind == "own" or name == self.reference)
        ]
        self.clocks = {name: SensorClock(tolerance) for name in own}
        self.begin = begin
        self.origin: float | None = None

    def stamp(self, source: str, sent: float | None, arrival: float) -> float:
        """Return the stamp of a message on the clock of its source [s]; without one, that of its arrival."""
        return arrival if sent is None or self.kinds[source] == "arrival" else sent

    def add(self, source: str, sent: float | None, arrival: float, *, was_lost: bool) -> float | None:
        """Take a message into account; the result is that of `SensorClock.add`. After a jump the time of the model goes on."""
        if source not in self.clocks or sent is None:
            return 0.0
        jump = self.clocks[source].add(sent, arrival, was_lost=was_lost)
        if jump and source == self.reference and self.origin is not None:
            self.origin += jump
        return jump

    def time(self, source: str, stamp: float) -> float:
        """Return the time of the model at a stamp [s]."""
        assert self.origin is not None
        if source == self.reference or self.kinds[source] == "shared":
            return self.begin + (stamp - self.origin)
        own = self.clocks.get(source)
        return self.at(stamp + own.at(stamp) if own is not None else stamp)

    def at(self, host: float) -> float:
        """Return the time of the model at a time of the host [s]."""
        assert self.origin is not None
        sensor_clock = self.clocks.get(self.reference)
        if sensor_clock is None:
            return self.begin + (host - self.origin)
        stamp = host - sensor_clock.offset
        return self.begin + (host - sensor_clock.at(stamp) - self.origin)
