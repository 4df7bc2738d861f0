"""Nodes of a master without a bus: what they compute from values that a test sets."""

from types import SimpleNamespace

from hw_bridge.bus import Frame
from hw_bridge.dictionary import State
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


def unconnected_node(profile="faulhaber_v3", **keys):
    """A drive with these keys of the hardware file; `sent` has the frames that it sends."""
    file = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": node_keys(profile, NUMBER, **keys)}})
    sent = []
    network = SimpleNamespace(send=sent.append, wall_clock=False)
    node = Node("axis", file.nodes["axis"], file.nodes["axis"].drive, network, lambda duration, done=None: None)
    node.measure_age(5_000_000)
    node.sent = sent
    return node


def frame(service, data):
    """A frame of this node, by the identifier without its node-ID."""
    return Frame(service + NUMBER, data)
