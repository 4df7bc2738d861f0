"""Description of a hardware file's homing method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import object_texts

if TYPE_CHECKING:
    from hw_bridge.hardware import NodeKeys

NO_HOMING = (
    "has no `homing` in the hardware file. Add it, such as homing: {method: -3, at: POSITION, speed: 20 mm/s}, with the position "
    "of its mechanical stop."
)


def explained(keys: NodeKeys) -> list[str]:
    """Describe the homing sequence step by step."""
    assert keys.homing is not None
    return object_texts.homing(keys.drive.homing[keys.homing.method])
