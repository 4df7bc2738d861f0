"""Contact force monitor: the drive retracts if the force is too large or the sensor value stops changing."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from hw_bridge.hardware import TARGET_SHARE

if TYPE_CHECKING:
    from hw_bridge.hardware import ContactKeys
    from hw_bridge.master import Node

NEVER = 2**62
RETRACTION_TIME_FACTOR = 3  # longest retraction over the nominal one [-]


class ContactWatch:
    """Monitor of one contact force, evaluated every step. A sensor whose value is not finite or constant is stuck."""

    def __init__(self, name: str, keys: ContactKeys, node: Node, start: int) -> None:
        self.name, self.keys, self.node = name, keys, node
        self.reason = ""  # why it retracts, if it does
        # the drive's own limit may be narrower than the file's
        self.speed = min(keys.speed, TARGET_SHARE * node.keys.limits.velocity)
        self._value = float("nan")
        self._changed = self._now = start
        self._from = 0.0  # position where the retraction began [m]
        self._end = NEVER

    def look(self, t: int, force: float) -> None:
        """Evaluate the force [N] at t [ns]."""
        self._now = t
        if isfinite(force) and force != self._value:
            self._value, self._changed = force, t
        if self.reason:
            return
        silence = t - self._changed
        if force > self.keys.above:
            self._retract(f"{self.name}: {self.keys.signal} is {force:.3f} N, above {self.keys.above:g} N.")
        elif silence > self.keys.silent_for:
            self._retract(f"{self.name}: {self.keys.signal} has not changed for {silence / 1e6:.0f} ms.")

    def outcome(self) -> str:
        """Reason and distance of a retraction that has ended."""
        return f"{self.reason} Retracted {self.node.format_length(abs(self.node.position - self._from))}."

    def _retract(self, why: str) -> None:
        keys = self.keys
        self.reason = why
        self._from = self.node.position
        self._end = self._now + round(RETRACTION_TIME_FACTOR * 1e9 * keys.distance / self.speed)

    @property
    def sign(self) -> float:
        """Direction of the retraction."""
        return 1.0 if self.keys.direction == "positive" else -1.0

    def _room(self) -> float:
        """Distance to the position limit in that direction, minus a millimeter [m]."""
        low, high = self.node.keys.limits.position
        return (high - self.node.position if self.sign > 0 else self.node.position - low) - 1e-3

    def _arrived(self) -> bool:
        return self.sign * (self.node.position - self._from) >= self.keys.distance or self._room() <= 0.0

    def velocity(self) -> float:
        """Target velocity of the retraction [m/s]."""
        return 0.0 if self._arrived() else self.sign * self.speed

    def done(self) -> bool:
        """Whether the retraction has ended, or its time has elapsed."""
        return self._arrived() or self._now >= self._end
