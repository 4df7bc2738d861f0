"""Decoding of CANopen traffic, and recordings."""

from hw_bridge.trace.decoder import DecodedFrame as DecodedFrame
from hw_bridge.trace.decoder import Decoder as Decoder
from hw_bridge.trace.listener import BusListener as BusListener
from hw_bridge.trace.recording import NAMES as NAMES
from hw_bridge.trace.recording import POSITION as POSITION
from hw_bridge.trace.recording import STATUSWORD as STATUSWORD
from hw_bridge.trace.recording import Recording as Recording
from hw_bridge.trace.traced_node import TracedNode as TracedNode
from hw_bridge.trace.watch import Watch as Watch
