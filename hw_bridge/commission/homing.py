"""The homing method of a hardware file in words, and where a person's drive goes after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import words
from hw_bridge.profiles import profile

if TYPE_CHECKING:
    from hw_bridge.hardware import NodeKeys


def explained(keys: NodeKeys) -> list[str]:
    """What the drive will do, move by move."""
    assert keys.homing is not None
    return words.homing(profile(keys.profile).homing[keys.homing.method])


def resting_position(keys: NodeKeys) -> float:
    """Where it goes after it was homed [m or rad]: the place that was found, or the limit nearest to it."""
    assert keys.homing is not None
    low, high = keys.limits.position
    return min(max(keys.homing.at, low), high)
