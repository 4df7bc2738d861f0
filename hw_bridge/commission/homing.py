"""Description of a hardware file's homing method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.commission import object_texts

if TYPE_CHECKING:
    from hw_bridge.hardware import NodeKeys


def explained(keys: NodeKeys) -> list[str]:
    """Describe the homing sequence step by step."""
    assert keys.homing is not None
    return object_texts.homing(keys.drive.homing[keys.homing.method])
