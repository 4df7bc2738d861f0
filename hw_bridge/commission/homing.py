"""The homing method of a hardware file in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import words

if TYPE_CHECKING:
    from hw_bridge.hardware import NodeKeys


def explained(keys: NodeKeys) -> list[str]:
    """What the drive will do, move by move."""
    assert keys.homing is not None
    return words.homing(keys.drive.homing[keys.homing.method])
