"""Conformance checks of components in every execution form, and their reference trajectories."""

from twin.conformance import agreement as agreement
from twin.conformance import reference as reference
