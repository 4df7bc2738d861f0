"""One case of a scenario on drives."""

from hw_bridge.session import outputs, targets
from hw_bridge.session.output_bindings import AGE
from hw_bridge.session.session import Observers, Session

__all__ = [
    "AGE",
    "Observers",
    "Session",
    "outputs",
    "targets",
]
