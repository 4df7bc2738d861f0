"""Faults of simulated devices and of their bus."""

from hw_bridge.fault.action import inject
from hw_bridge.fault.check import problem
from hw_bridge.fault.fault import LARGEST, MEANINGS, Cause, Fault

__all__ = [
    "LARGEST",
    "MEANINGS",
    "Cause",
    "Fault",
    "inject",
    "problem",
]
