"""Bound the acceleration of targets in csv and csp, whatever the scenario or the operator demands.

In csv and csp a drive follows its target as it comes: 6083h to 6085h act in profile modes and in a quick stop only. A target
that keeps to the limit itself passes unchanged, to the last bit. In cst the target is a force, and the mass that it moves is
not known: there the measured acceleration is monitored.
"""

from __future__ import annotations

from math import copysign, floor, inf, sqrt

EXACT = 1e-9  # rounding of a position [m or rad], and relative rounding of a speed
LEAST = 0.25  # of the limit that is left to catch up with a target that needs all of it itself
SPAN = 4  # cycles over which an acceleration is measured


def max_stoppable_speed(room: float, deceleration: float, h: float) -> float:
    """Largest speed from which whole cycles of `h` [s] of deceleration end within `room`, exact to the last bit.

    In n more cycles after this one it moves h (v + (v - s) + ... + (v - n s)) with s = deceleration * h.
    """
    if room == inf:
        return inf
    step = deceleration * h
    cycles = floor(0.5 * (sqrt(1.0 + 8.0 * max(room, 0.0) / (step * h)) - 1.0))
    return 0.5 * step * cycles + max(room, 0.0) / (h * (cycles + 1))


class AccelerationLimit:
    """Acceleration limiter for the targets of one drive, called once per cycle; allocates nothing.

    `position` and `velocity`: the limited target [m, m/s, or in rad]. `fastest`: speed limit while catching up [m/s or rad/s].
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
        """Restart from this state: no target of this program acts."""
        self.position, self.velocity = position, velocity
        self._target, self._target_velocity, self.limited = None, 0.0, False

    def shift(self, offset: float) -> None:
        """Add `offset` [m or rad] to all positions after the origin has moved."""
        self.position += offset
        if self._target is not None:
            self._target += offset

    def follow_velocity(self, wanted: float, position: float, h: float) -> None:
        """Limit the target velocity of a cycle of `h` [s]; `position`: the actual position."""
        step = self.acceleration * h
        self.velocity = min(max(wanted, self.velocity - step), self.velocity + step)
        self.position, self._target = position, None
        self._note(abs(wanted - self.velocity) > EXACT * step)

    def follow_position(self, wanted: float, h: float) -> None:
        """Limit the target position of a cycle of `h` [s]. A target that has run ahead is reached at its own speed."""
        step = self.acceleration * h
        before = wanted if self._target is None else self._target
        speed = (wanted - before) / h
        direct = (wanted - self.position) / h
        tolerance = step * (1.0 + EXACT)
        if abs(direct - self.velocity) <= tolerance and abs(direct - speed) <= tolerance:
            self.velocity, self.position = direct, wanted
            self._note(False)
        else:
            own = abs(speed - self._target_velocity) / h  # acceleration of the target itself
            left = max(self.acceleration - own, LEAST * self.acceleration)
            lag = before - self.position
            ahead = speed + copysign(max_stoppable_speed(abs(lag), left, h), lag)
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
        slot = self._cycles % (SPAN + 1)
        self._speeds[slot], self._times[slot] = velocity, time
        self._cycles += 1

    @property
    def measured(self) -> float:
        """Mean acceleration over the last cycles; 0 before there are enough [m/s2 or rad/s2]."""
        if self._cycles <= SPAN:
            return 0.0
        last, first = (self._cycles - 1) % (SPAN + 1), self._cycles % (SPAN + 1)
        return (self._speeds[last] - self._speeds[first]) * 1e9 / max(self._times[last] - self._times[first], 1)

    def forget(self) -> None:
        """Reset statistics at the start of a run."""
        self._cycles = self.count = 0
