"""Drives instead of members of a scenario, for all cases of a run; or what a trace says of them."""

from hw_bridge.bridge.entry import load
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bridge.replay import Replay, replay

__all__ = [
    "Hardware",
    "Replay",
    "load",
    "replay",
]
