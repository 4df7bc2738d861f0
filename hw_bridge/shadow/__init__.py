"""A simulated drive beside the real one: what they do differently points at a part."""

from hw_bridge.shadow.shadow import Shadow, shadows
from hw_bridge.shadow.symptoms import SYMPTOMS

__all__ = [
    "SYMPTOMS",
    "Shadow",
    "shadows",
]
