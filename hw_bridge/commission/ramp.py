"""Set-points with bounded speed and acceleration, one for each cycle, that never pass a bound."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, inf

from hw_bridge.master import max_stoppable_speed

NOTHING = 1e-9  # rounding of a position [m or rad]


@dataclass
class Ramp:
    """Set-point generator: `acceleration` to speed up, `deceleration` to slow down [m/s2]."""

    position: float
    acceleration: float
    deceleration: float
    low: float = -inf
    high: float = inf
    velocity: float = 0.0

    def follow(self, speed: float, h: float) -> float:
        """Position after h [s] on the way to this speed; it stops in front of the bounds."""
        slower = abs(speed) < abs(self.velocity) or speed * self.velocity < 0.0
        step = (self.deceleration if slower else self.acceleration) * h
        velocity = min(max(speed, self.velocity - step), self.velocity + step)
        if slower and speed * self.velocity < 0.0 and velocity * self.velocity < 0.0:
            velocity = 0.0  # through zero with the other acceleration
        room = self.high - self.position if velocity > 0.0 else self.position - self.low
        self.velocity = copysign(min(abs(velocity), self.max_stoppable_speed(room, h)), velocity)
        self.position += self.velocity * h
        return self.position

    def approach(self, goal: float, speed: float, h: float) -> float:
        """Position after h [s] on the way to a goal, where it comes to rest."""
        distance = goal - self.position
        faster = abs(self.velocity) + self.acceleration * h
        self.velocity = copysign(min(speed, faster, self.max_stoppable_speed(abs(distance), h)), distance)
        self.position += self.velocity * h
        if abs(goal - self.position) < NOTHING:
            self.position = goal
        return self.position

    def max_stoppable_speed(self, room: float, h: float) -> float:
        """The largest speed from which it comes to rest within `room` [m/s or rad/s]."""
        return max_stoppable_speed(room, self.deceleration, h)
