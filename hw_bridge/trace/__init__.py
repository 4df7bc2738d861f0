"""What was on the bus: its meaning, and what is made of it."""

from hw_bridge.trace.decoder import Decoder, Line
from hw_bridge.trace.party import Party
from hw_bridge.trace.recording import NAMES, POSITION, STATUSWORD, Recording
from hw_bridge.trace.watch import Watch

__all__ = [
    "NAMES",
    "POSITION",
    "STATUSWORD",
    "Decoder",
    "Line",
    "Party",
    "Recording",
    "Watch",
]
