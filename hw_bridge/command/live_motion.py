"""Live values of a motion command, read from what it prints: for the tiles and the chart of a page."""

from __future__ import annotations

import re
import time
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from hw_bridge.command.bench.single_axis import LIVE_VALUES, NO_DATA
from hw_bridge.commission import IN_DRIVE
from hw_bridge.dictionary import State
from twin import web

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

CAPACITY = 18_000  # samples: a quarter of an hour at twenty a second
CURVES = ("position", "current")


class LiveMotion:
    """The latest values of a motion as texts, and position and current over time since power (a `web.frames.CurveSource`).

    `directions`: those in which the command has sent targets. Written by one thread, read by others.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget the motion before."""
        self.state = self.position = self.velocity = self.current = self.direction = ""
        self.origin, self.unit = "", "mm"
        self.directions = set[str]()
        self.no_data_since = ""  # time of the last sample, if the values are older than the command's last cycles
        self._rest = ""  # of a line that has not ended
        self._begin_time = -1.0  # of the first sample with power
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=CAPACITY)

    @property
    def has_samples(self) -> bool:
        """Whether the command has printed values."""
        return bool(self._samples)

    def process_output(self, text: str) -> None:
        """Take the values from a part of the command's output."""
        *lines, self._rest = re.split(r"[\r\n]", self._rest + text)
        for values in filter(None, map(LIVE_VALUES.match, lines)):
            position, is_homed_now = float(values["position"]), self.origin == IN_DRIVE != values["origin"]
            self.unit, self.origin, self.state = values["unit"], values["origin"], values["state"]
            self.position, self.velocity = f"{values['position']} {self.unit}", values["velocity"]
            has_current = values["current"] != "-"  # not read once the power is off
            self.current = f"{values['current']} A" if has_current else ""
            self.direction = {">": "positive", "<": "negative"}.get(values["mark"], "")
            self.directions |= {*filter(None, [self.direction])}
            is_old = values.string.startswith(NO_DATA, values.end())
            self.no_data_since = f"{self.span()[1]:.2f} s" if is_old and self._samples else ""
            if is_old or not has_current:
                continue
            now = time.monotonic()
            if not self._samples:
                if self.state != State.ENABLED:
                    continue
                self._begin_time = now
            elif is_homed_now:  # it stands where it was: all of the curve counts from the reference now
                shift = position - self._samples[-1][1]
                self._samples = deque(((t, p + shift, i) for t, p, i in self._samples), maxlen=CAPACITY)
            self._samples.append((now - self._begin_time, position, float(values["current"])))

    def names(self) -> Collection[str]:
        """Names of the curves."""
        return CURVES

    def span(self) -> tuple[float, float]:
        """First and last time [s]."""
        samples = list(self._samples)
        return (samples[0][0], samples[-1][0]) if samples else (0.0, 0.0)

    def read(
        self, name: str, start: float, stop: float, points: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times [s] and values of a window, with the sample before it."""
        samples = np.array(list(self._samples)).reshape(-1, 3)
        first, last = np.searchsorted(samples[:, 0], [start, stop], side="right")
        window = samples[max(int(first) - 1, 0) : int(last)]
        return web.frames.decimate(window[:, 0], window[:, 1 + CURVES.index(name)], points)
