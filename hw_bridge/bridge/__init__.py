"""Drives that replace members of a scenario, for all cases of a run; or a trace of them."""

from hw_bridge.bridge.entry import load as load
from hw_bridge.bridge.hardware import Hardware as Hardware
from hw_bridge.bridge.replay import Replay as Replay
from hw_bridge.bridge.replay import replay as replay
