"""Conformance checks of components in every execution form, and their reference trajectories."""

from twin.conformance import agreement, reference

__all__ = [
    "agreement",
    "reference",
]
