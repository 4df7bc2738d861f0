"""Dead zone, shared by play and dry friction."""

from math import copysign


def dead_zone(value: float, limit: float) -> float:
    """What is left of a value outside of +-limit: play, or force beyond friction. What is no number stays none."""
    if abs(value) <= limit:
        return 0.0
    return value - copysign(limit, value)
