"""Decoding of CANopen traffic, and recordings."""

from hw_bridge.trace.decoder import DecodedFrame, Decoder
from hw_bridge.trace.listener import BusListener
from hw_bridge.trace.recording import NAMES, POSITION, STATUSWORD, Recording
from hw_bridge.trace.traced_node import TracedNode
from hw_bridge.trace.watch import Watch

__all__ = [
    "NAMES",
    "POSITION",
    "STATUSWORD",
    "BusListener",
    "DecodedFrame",
    "Decoder",
    "Recording",
    "TracedNode",
    "Watch",
]
