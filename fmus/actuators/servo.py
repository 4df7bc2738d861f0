"""Loops that the drives of both motors share: modes of operation, limits of the current, velocity loop."""

from __future__ import annotations

from typing import Any

# modes of operation, CiA 402 object 6060h; between them is 9, cyclic synchronous velocity
CYCLIC_SYNCHRONOUS_POSITION = 8
CYCLIC_SYNCHRONOUS_TORQUE = 10


def driven(demand: float, top: float, back: float) -> float:
    """What the supply lets through of a current [A]: `top` at standstill, and `back` less to push, or more to brake.

    Quasi-static: inductance is in `current_lag`. Above the no-load speed the diodes of the power stage brake.
    """
    return min(max(demand, -top - back), top - back)


def limited_current(demand: float, limit: float, top: float, back: float) -> float:
    """A current demand within the drive's `limit` and what the supply lets through [A]."""
    return driven(min(max(demand, -limit), limit), top, back)


def hold_current(self: Any, demand: float, limit: float, top: float, back: float) -> float:
    """Demand a current [A]; another mode goes on with it."""
    self.current_integral = limited_current(demand, limit, top, back)
    return float(self.current_integral)


def follow_velocity(self: Any, velocity: float, limit: float, top: float, back: float) -> float:
    """Velocity loop: the current [A] for a speed; its integral waits while current or voltage are at their limits."""
    error = min(max(velocity, -self.velocity_maximum), self.velocity_maximum) - self.measured_velocity
    demand = self.velocity_gain * error + self.current_integral
    possible = limited_current(demand, limit, top, back)
    if possible == demand:
        self.current_integral += self.velocity_integral * self.drive_period * error
    return possible
