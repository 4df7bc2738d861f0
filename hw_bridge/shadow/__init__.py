"""Model-based monitoring: a simulated drive in parallel to the real one, whose residuals indicate a faulty part."""

from hw_bridge.shadow.shadow import Shadow, shadows
from hw_bridge.shadow.symptoms import SYMPTOMS

__all__ = [
    "SYMPTOMS",
    "Shadow",
    "shadows",
]
