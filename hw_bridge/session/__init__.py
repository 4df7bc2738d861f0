"""One case of a scenario on drives."""

from hw_bridge.session import outputs, targets
from hw_bridge.session.session import Company, Session
from hw_bridge.session.showing import AGE

__all__ = [
    "AGE",
    "Company",
    "Session",
    "outputs",
    "targets",
]
