"""Access to python-can's interfaces and trace files: the only package that imports it."""

from hw_bridge.wire.adapter import open_bus, shut_down
from hw_bridge.wire.direct import link
from hw_bridge.wire.files import TraceWriter, read
from hw_bridge.wire.network import WireNetwork
from hw_bridge.wire.node_id_check import assert_node_id_free
from hw_bridge.wire.realtime import freeze_gc_and_set_fifo
from hw_bridge.wire.wire import Wire

__all__ = [
    "TraceWriter",
    "Wire",
    "WireNetwork",
    "assert_node_id_free",
    "freeze_gc_and_set_fifo",
    "link",
    "open_bus",
    "read",
    "shut_down",
]
