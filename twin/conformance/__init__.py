"""Whether a component is the same in every form, and the trajectory that all must reproduce."""

from twin.conformance import agreement, reference

__all__ = [
    "agreement",
    "reference",
]
