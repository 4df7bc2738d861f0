"""Any python-can interface, or trace file of python-can's: the only room that knows it."""

from hw_bridge.wire.adapter import left, opened
from hw_bridge.wire.direct import link
from hw_bridge.wire.files import TraceWriter, read
from hw_bridge.wire.haste import settle
from hw_bridge.wire.network import WireNetwork
from hw_bridge.wire.taken import refuse_if_taken
from hw_bridge.wire.wire import Wire

__all__ = [
    "TraceWriter",
    "Wire",
    "WireNetwork",
    "left",
    "link",
    "opened",
    "read",
    "refuse_if_taken",
    "settle",
]
