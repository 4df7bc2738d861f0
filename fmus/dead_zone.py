"""Dead zone: what play and dry friction have in common."""


def beyond(value: float, limit: float) -> float:
    """What is left of a value outside of +-limit: play, or force beyond friction."""
    if value > limit:
        return value - limit
    if value < -limit:
        return value + limit
    return 0.0
