"""Detect another master on the bus by frames that only this program may send to its nodes."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia301

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.bus import Frame

TARGETS = (0x200, 0x300, 0x400, 0x500)  # identifiers of RPDOs, without the node-ID
WRITES = (
    0,
    1,
)  # requests of SDO clients, bits 7 to 5: segment of a download, download. Clients that only read are tolerated
RESETS = (cia301.RESET_NODE, cia301.RESET_COMMUNICATION)


class ForeignMasterMonitor:
    """Monitor of all frames that this program did not send. `names`: of its nodes, by node-ID; `reads`: SDO uploads count too.

    A frame does not identify its sender: `unknown_nodes` are nodes with a heartbeat that are not in the hardware file.
    """

    def __init__(self, master: int, names: Mapping[int, str], reads: bool = False) -> None:
        self.master, self.names, self.reads = master, names, reads
        self.action = ""  # the first thing that another master did
        self.unknown_nodes: set[int] = set()
        self.resets: set[int] = set()  # node-IDs that another master has reset; 0: all

    def hear(self, frame: Frame) -> None:
        """Process a frame of another sender."""
        node = frame.id & 0x7F
        expected_nodes = (0, self.master, *self.names)
        if frame.id == cia301.ERROR_CONTROL + node and node not in expected_nodes and not frame.remote:
            self.unknown_nodes.add(node)
        if frame.id == cia301.NMT and len(frame.data) == 2 and frame.data[0] in RESETS:
            self.resets.add(frame.data[1])
        if not self.action:
            self.action = self._interference(frame, node)

    def _interference(self, frame: Frame, node: int) -> str:
        data = frame.data
        if frame.id == cia301.ERROR_CONTROL + self.master:
            return f"node {self.master}: another master tells that it lives on this ID. Stop it, or change `master`."
        if frame.id == cia301.SYNC:
            return "another master on the bus sent SYNC. Stop it."
        if frame.id == cia301.NMT and len(data) == 2 and data[1] in (0, *self.names):
            name = self.names.get(data[1], "all nodes")
            return f"another master on the bus sent NMT command {data[0]:02X}h to {name}. Stop it."
        if node not in self.names:
            return ""
        name, service = self.names[node], frame.id - node
        if service == cia301.SDO_REQUEST and len(data) == 8 and data[0] >> 5 in WRITES:
            index, sub = struct.unpack_from("<HB", data, 1)
            return f"another master on the bus writes {index:04X}h.{sub} of {name}. Stop it."
        if service == cia301.SDO_REQUEST and self.reads:
            return f"another program on the bus reads {name}."
        return f"another master on the bus sends {name} targets. Stop it." if service in TARGETS else ""

    def has_reset(self, node: int) -> bool:
        """Whether another master has reset a node."""
        return not self.resets.isdisjoint((0, node))

    @property
    def text(self) -> str:
        """The first action of another master, and its possible node-IDs; or an empty string."""
        nodes = ", ".join(map(str, sorted(self.unknown_nodes)))
        return (
            f"{self.action} It may be node {nodes}, not in the hardware file." if self.action and nodes else self.action
        )
