"""Nodes of a master without a bus: what they compute from values that a test sets, and what they write by SDO."""

import struct
from types import SimpleNamespace

from hw_bridge.bus import Frame
from hw_bridge.dictionary import Code, Dictionary, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Node
from tests.hw_bridge.axis import node as node_keys

NUMBER = 3
WORDS = {  # a statusword of each state, with the remote bit
    State.NOT_READY: 0x200,
    State.DISABLED: 0x240,
    State.READY: 0x221,
    State.SWITCHED_ON: 0x223,
    State.ENABLED: 0x227,
    State.QUICK_STOP: 0x207,
    State.REACTION: 0x20F,
    State.FAULT: 0x208,
}


def frame(service, data):
    """A frame of this node, by the identifier without its node-ID."""
    return Frame(service + NUMBER, data)


class SdoServer:
    """Answers SDO requests to a drive at once, from the values of its profile; it has no motor and no states.

    `missing`: indices, or pairs of index and subindex, that it does not have. `written`: index, subindex and value of
    each write. `refused`: addresses whose write is refused; `busy`: number of writes that are refused first, by address.
    `ignored`: those whose write has no effect.
    """

    def __init__(self, profile, values=(), missing=(), number=NUMBER):
        self.number = number
        self.dictionary = Dictionary(profile.objects, number)
        self.dictionary.values.update(values)
        self.missing, self.refused, self.ignored = set(missing), set(), set()
        self.busy = {}
        self.written, self.answer = [], lambda data: None

    def send(self, request):
        """Process a frame of the master."""
        if request.id != 0x600 + self.number:
            return
        head, index, sub = struct.unpack_from("<BHB", request.data)
        address = struct.pack("<HB", index, sub)
        entry = self.dictionary.objects.get(index, {}).get(sub)
        if entry is None or not self.missing.isdisjoint({index, (index, sub)}):
            code = Code.NO_SUBINDEX if entry is None and index in self.dictionary.objects else Code.NO_OBJECT
            self.answer(b"\x80" + address + struct.pack("<I", code))
        elif head == 0x40:
            data = entry.encode(self.dictionary.values[index, sub])
            self.answer(bytes([0x43 | (4 - len(data)) << 2]) + address + data.ljust(4, b"\0"))
        elif (index, sub) in self.refused or self.busy.get((index, sub), 0) > 0:
            self.busy[index, sub] = self.busy.get((index, sub), 0) - 1
            self.answer(b"\x80" + address + struct.pack("<I", Code.READ_ONLY))
        else:
            value = entry.decode(request.data[4 : 8 - (head >> 2 & 3)])
            self.written.append((index, sub, value))
            if (index, sub) not in self.ignored:
                self.dictionary.values[index, sub] = value
            self.answer(b"\x60" + address + bytes(4))


def unconnected_node(profile="faulhaber_v3", values=(), missing=(), **keys):
    """A drive with these keys of the hardware file; `node.server` answers its SDO requests."""
    file = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": node_keys(profile, NUMBER, **keys)}})
    own = file.nodes["axis"]
    server = SdoServer(own.drive, values, missing)
    network = SimpleNamespace(send=server.send, wall_clock=False)
    node = Node("axis", own, own.drive, network, lambda duration, done=None: None)
    server.answer = node.sdo.process_frame
    node.server = server
    node.measure_age(5_000_000)
    return node
