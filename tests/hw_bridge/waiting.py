"""Waits for what comes on a bus, bounded by time: on multicast a bus also receives what it has sent itself.

A count of receives is no measure of time. Each function ends in an AssertionError after `timeout` [s].
"""

import time

import can
import canopen

TIMEOUT = 30.0  # for what takes an idle machine a moment [s]
REPEAT = 0.2  # between two requests to a device that may still boot [s]


def wait_for_frame(bus, identifier, data=b"", timeout=TIMEOUT):
    """Receive until a frame has this identifier and begins with `data`."""
    end = time.monotonic() + timeout
    while (left := end - time.monotonic()) > 0:
        message = bus.recv(left)
        if message is not None and message.arbitration_id == identifier and bytes(message.data).startswith(data):
            return message
    raise AssertionError(f"no frame {identifier:03X}h {data.hex()} in {timeout:g} s")


def wait_for_boot(bus, node, timeout=TIMEOUT):
    """Ask a node for its device type until it answers: it boots before that, and says nothing."""
    end = time.monotonic() + timeout
    request = can.Message(arbitration_id=0x600 + node, data=[0x40, 0, 0x10, 0, 0, 0, 0, 0], is_extended_id=False)
    while True:
        bus.send(request)
        try:
            return wait_for_frame(bus, 0x580 + node, timeout=REPEAT)
        except AssertionError:
            assert time.monotonic() < end, f"node {node} has not answered in {timeout:g} s"


def wait_for_node(node, timeout=TIMEOUT):
    """The same with a node of python-canopen, which waits 0.3 s for each answer."""
    end = time.monotonic() + timeout
    while True:
        try:
            return node.sdo.upload(0x1000, 0)
        except canopen.SdoCommunicationError:
            assert time.monotonic() < end, f"node {node.id} has not answered in {timeout:g} s"
