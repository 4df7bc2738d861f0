"""Targets with a bounded acceleration: what a drive is told in csv and csp, whatever the scenario or a person asks for.

In csv and csp a drive follows its target as it comes: 6083h to 6085h act in profile modes and in a quick stop only. A target
that keeps to the limit itself goes through unchanged, to the last bit. In cst a force is told, and the mass that it moves is
not known: there the measured acceleration is watched.
"""

from __future__ import annotations

from math import copysign, floor, inf, sqrt

EXACT = 1e-9  # rounding of a position [m or rad], and relative rounding of a speed
LEAST = 0.25  # of the limit that is left to catch up with a target that needs all of it itself
SPAN = 4  # cycles over which an acceleration is measured


def stoppable(room: float, deceleration: float, h: float) -> float:
    """The largest speed from which whole cycles of `h` [s] of deceleration end within `room`, to the last bit of it.

    In n more cycles after this one it goes h (v + (v - s) + ... + (v - n s)) with s = deceleration * h.
    """
    if room == inf:
        return inf
    step = deceleration * h
    cycles = floor(0.5 * (sqrt(1.0 + 8.0 * max(room, 0.0) / (step * h)) - 1.0))
    return 0.5 * step * cycles + max(room, 0.0) / (h * (cycles + 1))


class AccelerationLimit:
    """Limits the targets of one drive, once in a cycle; its state is a few numbers, nothing is allocated.

    `position` and `velocity`: what the drive is told [m, m/s, or in rad]. `fastest` [m/s or rad/s]: of catching up.
    """

    def __init__(self, acceleration: float, fastest: float) -> None:
        self.acceleration, self.fastest = acceleration, fastest
        self.position = self.velocity = 0.0
        self.limited = False  # whether the last target was
        self.count = 0  # of cycles in which it was
        self._target: float | None = None  # position that was asked for in the cycle before
        self._target_velocity = 0.0  # its speed then
        self._speeds = [0.0] * (SPAN + 1)  # measured, of the last cycles
        self._times = [0] * (SPAN + 1)  # when they were [ns]
        self._cycles = 0

    def begin(self, position: float, velocity: float = 0.0) -> None:
        """No target of this program acts: the next one is limited from here on."""
        self.position, self.velocity = position, velocity
        self._target, self._target_velocity, self.limited = None, 0.0, False

    def shift(self, way: float) -> None:
        """Positions count from another place: all of them are larger by `way` [m or rad]."""
        self.position += way
        if self._target is not None:
            self._target += way

    def follow_velocity(self, wanted: float, position: float, h: float) -> None:
        """Target velocity of a cycle of `h` [s]; `position`: where the drive is."""
        step = self.acceleration * h
        self.velocity = min(max(wanted, self.velocity - step), self.velocity + step)
        self.position, self._target = position, None
        self._note(abs(wanted - self.velocity) > EXACT * step)

    def follow_position(self, wanted: float, h: float) -> None:
        """Target position of a cycle of `h` [s]. One that was left behind is caught up with, and reached at its speed."""
        step = self.acceleration * h
        before = wanted if self._target is None else self._target
        speed = (wanted - before) / h
        direct = (wanted - self.position) / h
        within = step * (1.0 + EXACT)
        if abs(direct - self.velocity) <= within and abs(direct - speed) <= within:
            self.velocity, self.position = direct, wanted
            self._note(False)
        else:
            own = abs(speed - self._target_velocity) / h  # acceleration of the target itself
            left = max(self.acceleration - own, LEAST * self.acceleration)
            lag = before - self.position
            ahead = speed + copysign(stoppable(abs(lag), left, h), lag)
            most = max(self.fastest, abs(speed))
            ahead = min(max(ahead, -most), most)
            self.velocity = min(max(ahead, self.velocity - step), self.velocity + step)
            self.position += self.velocity * h
            if abs(wanted - self.position) < EXACT:
                self.position = wanted
            self._note(True)
        self._target, self._target_velocity = wanted, speed

    def _note(self, limited: bool) -> None:
        self.limited = limited
        self.count += limited

    def measure(self, velocity: float, time: int) -> None:
        """The measured velocity of a cycle [m/s or rad/s], and when it was sampled [ns]."""
        place = self._cycles % (SPAN + 1)
        self._speeds[place], self._times[place] = velocity, time
        self._cycles += 1

    @property
    def measured(self) -> float:
        """Mean acceleration over the last cycles; 0 before there are enough [m/s2 or rad/s2]."""
        if self._cycles <= SPAN:
            return 0.0
        last, first = (self._cycles - 1) % (SPAN + 1), self._cycles % (SPAN + 1)
        return (self._speeds[last] - self._speeds[first]) * 1e9 / max(self._times[last] - self._times[first], 1)

    def forget(self) -> None:
        """A run begins: what was measured and counted before does not count."""
        self._cycles = self.count = 0
