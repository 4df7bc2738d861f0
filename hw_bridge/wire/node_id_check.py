"""Check that a node-ID is free on a bus."""

from __future__ import annotations

import struct
import time

from hw_bridge.bus import Frame
from hw_bridge.wire.link import Link
from twin.errors import SimulationError

LISTENING = 0.5  # [s] how long another node may take to be heard
IDENTITY = ((0x1000, 0), (0x1018, 1), (0x1018, 2))  # objects that are read


def assert_node_id_free(link: Link, node: int) -> None:
    """Listen, then read device type and identity; any response on this ID is from another node."""
    own = {0x80 + node, 0x580 + node, 0x700 + node} | {0x180 + 0x100 * n + node for n in range(4)}
    for index, sub in IDENTITY:
        link.send(Frame(0x600 + node, struct.pack("<BHB4x", 0x40, index, sub)))
        until = time.monotonic() + LISTENING / len(IDENTITY)
        while (left := until - time.monotonic()) > 0:
            for frame, *_ in link.hear(left):
                if frame is not None and frame.id in own:
                    raise SimulationError(
                        f"node {node}: another node answers on this ID ({frame}). "
                        f"Choose another ID, or an interface without real drives."
                    )
