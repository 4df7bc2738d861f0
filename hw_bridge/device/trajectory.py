"""Profile generators: trapezoids in speed as closed formulas over integer time, so that nothing accumulates."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, copysign, sqrt

SECOND = 1_000_000_000  # [ns]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A motion that begins at `start` [ns] from position and speed; `segments` are (duration [s], acceleration).

    `target` is the position, `velocity_end` the speed after the last segment, exactly.
    """

    start: int
    position: float
    velocity: float
    segments: tuple[tuple[float, float], ...]
    target: float
    velocity_end: float = 0.0

    @property
    def end(self) -> int:
        """End time [ns]; at least 1 ns after the start unless the target is reached, also where the durations underflow to 0."""
        there = (self.position, self.velocity) == (self.target, self.velocity_end)
        return self.start + max(ceil(self._length * SECOND), not there)

    @property
    def _length(self) -> float:
        return sum(duration for duration, _ in self.segments)

    def at(self, time: int) -> tuple[float, float]:
        """Position and speed at a time [ns]."""
        elapsed = (time - self.start) / SECOND
        if time >= self.end:
            return self.target + self.velocity_end * max(elapsed - self._length, 0.0), self.velocity_end
        x, v = self.position, self.velocity
        for duration, acceleration in self.segments:
            part = min(elapsed, duration)
            x += part * (v + 0.5 * acceleration * part)
            v += acceleration * part
            elapsed -= part
        return x, v


def _brake(x: float, v: float, deceleration: float) -> tuple[float, tuple[float, float]]:
    """Where braking to zero ends, and its segment."""
    return x + 0.5 * v * abs(v) / deceleration, (abs(v) / deceleration, -copysign(deceleration, v))


def to_position(
    start: int, x: float, v: float, target: float, speed: float, acceleration: float, deceleration: float
) -> Trajectory:
    """Go to a target and stop there, with no more than `speed`; turns round if it is too late to brake."""
    segments: list[tuple[float, float]] = []
    stop, braking = _brake(x, v, deceleration)
    position, velocity = x, v
    if v != 0.0 and (target - stop) * v < 0.0:
        segments.append(braking)
        x, v = stop, 0.0
    distance = abs(target - x)
    sign = copysign(1.0, target - x) if target != x else copysign(1.0, v)
    v = abs(v)
    if v > speed:
        segments.append(((v - speed) / deceleration, -sign * deceleration))
        distance -= (v * v - speed * speed) / (2.0 * deceleration)
        v = speed
    peak = sqrt((2.0 * distance * acceleration * deceleration + deceleration * v * v) / (acceleration + deceleration))
    peak = min(max(peak, v), speed)
    ramps = (peak * peak - v * v) / (2.0 * acceleration) + peak * peak / (2.0 * deceleration)
    segments.append(((peak - v) / acceleration, sign * acceleration))
    if peak > 0.0:
        segments.append((max(distance - ramps, 0.0) / peak, 0.0))
    segments.append((peak / deceleration, -sign * deceleration))
    return Trajectory(start, position, velocity, tuple(segments), target)


def to_velocity(start: int, x: float, v: float, target: float, acceleration: float, deceleration: float) -> Trajectory:
    """Change the speed: braking with `deceleration`, also through zero, speeding up with `acceleration`."""
    segments: list[tuple[float, float]] = []
    end, speed = x, v
    if v * target < 0.0:
        end, braking = _brake(x, v, deceleration)
        segments.append(braking)
        speed = 0.0
    rate = acceleration if abs(target) > abs(speed) else deceleration
    duration = abs(target - speed) / rate
    segments.append((duration, copysign(rate, target - speed)))
    end += 0.5 * (speed + target) * duration
    return Trajectory(start, x, v, tuple(segments), end, target)
