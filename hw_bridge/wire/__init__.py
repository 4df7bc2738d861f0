"""Access to python-can's interfaces and trace files: the only package that imports it."""

from hw_bridge.wire.adapter import open_bus as open_bus
from hw_bridge.wire.adapter import shut_down as shut_down
from hw_bridge.wire.direct import link as link
from hw_bridge.wire.files import TraceWriter as TraceWriter
from hw_bridge.wire.files import read as read
from hw_bridge.wire.network import WireNetwork as WireNetwork
from hw_bridge.wire.node_id_check import assert_node_id_free as assert_node_id_free
from hw_bridge.wire.realtime import freeze_gc_and_set_fifo as freeze_gc_and_set_fifo
from hw_bridge.wire.wire import Wire as Wire
