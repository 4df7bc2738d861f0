"""One case of a scenario on drives."""

from hw_bridge.session import outputs, targets
from hw_bridge.session.session import Company, Session

__all__ = [
    "Company",
    "Session",
    "outputs",
    "targets",
]
