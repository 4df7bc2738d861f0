"""Whether homing would pass a limit: decided by the hardware file alone, before the drive moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import HomingEvent

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.hardware.keys import NodeKeys

ENDS = (HomingEvent.NEGATIVE, HomingEvent.POSITIVE, HomingEvent.BLOCK)  # of a rail


def search_direction(keys: NodeKeys) -> int:
    """Direction of the search for an end stop or limit switch, as the member counts: 1, -1, or 0 for other methods."""
    assert keys.homing is not None
    sequence = keys.drive.homing.get(keys.homing.method, ())
    direction = next((step.direction for step in sequence if step.until in ENDS), 0)
    return -direction if keys.inverted else direction


def homing_conflict(keys: NodeKeys, to_text: Callable[[float], str]) -> str:
    """Return why homing would pass a limit, or an empty string. `to_text` formats a position."""
    homing, limits = keys.homing, keys.limits
    assert homing is not None
    if homing.speed > limits.velocity:
        return f"speed {to_text(homing.speed)}/s is above limits.velocity {to_text(limits.velocity)}/s. Lower it."
    direction = search_direction(keys)
    low, high = limits.position
    if (homing.at - 0.5 * (low + high)) * direction < 0.0:
        ends = ("positive", "negative")
        return (
            f"method {homing.method} goes to the {ends[direction < 0]} end, but `at` {to_text(homing.at)} is at the "
            f"{ends[direction > 0]} end of {to_text(low)} to {to_text(high)}: it would run through the limits. "
            "Correct method, `at` or `inverted`."
        )
    if (beyond := max(low - homing.at, homing.at - high)) > high - low:
        return (
            f"`at` {to_text(homing.at)} is {to_text(beyond)} outside of limits.position, {to_text(low)} to "
            f"{to_text(high)}, more than the way between them. Correct one of them."
        )
    return ""
