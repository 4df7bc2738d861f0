"""Drives that replace members of a scenario, for all cases of a run; or a trace of them."""

from hw_bridge.bridge.entry import load
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bridge.replay import Replay, replay

__all__ = [
    "Hardware",
    "Replay",
    "load",
    "replay",
]
