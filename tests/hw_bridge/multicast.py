"""CAN over multicast between processes of one machine; tests that need it are skipped where it does not get through."""

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import can
import canopen
import pytest

BOOT_TIMEOUT = 30.0  # of a drive in a process of its own on a loaded machine [s]


def own(number: int) -> str:
    """A multicast group, `239.NUMBER.x.y`, of this test process alone."""
    pid = os.getpid()
    return f"239.{number}.{pid >> 8 & 0xFF}.{pid & 0xFF}"


def needed(group: str, **options: int) -> str:
    """The group, if what one sends the other hears; else the test is skipped."""
    if sys.platform != "linux":
        pytest.skip("multicast on this machine")
    try:
        with (
            can.Bus(channel=group, interface="udp_multicast", **options) as one,
            can.Bus(channel=group, interface="udp_multicast", **options) as other,
        ):
            one.send(can.Message(arbitration_id=1, is_extended_id=False))
            if other.recv(1.0) is None:
                pytest.skip("multicast does not reach this machine itself")
    except (can.CanError, OSError) as error:
        pytest.skip(f"no multicast: {error}")
    return group


def wait_for_frame(
    bus: can.BusABC, identifier: int, data: bytes = b"", timeout: float = 10.0, request: can.Message | None = None
) -> can.Message | None:
    """The next frame with this identifier whose data begin so; None after `timeout` [s], whatever else is received.

    `request` is sent at once and then every 0.2 s until the answer comes. The bus may echo our own frames.
    """
    deadline, next_request = time.monotonic() + timeout, time.monotonic()
    while (now := time.monotonic()) < deadline:
        if request is not None and now >= next_request:
            bus.send(request)
            next_request = now + 0.2
        message = bus.recv(min(deadline - now, 0.2))
        if message is not None and message.arbitration_id == identifier and bytes(message.data).startswith(data):
            return message
    return None


def wait_for_boot(node: Any, timeout: float = BOOT_TIMEOUT) -> None:
    """Return once a CANopen node answers an SDO request; AssertionError after `timeout` [s]."""
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        try:
            node.sdo.upload(0x1000, 0)
        except canopen.SdoCommunicationError:
            continue
        return
    raise AssertionError(f"node {node.id} did not answer within {timeout} s")


def wait_until(condition: Callable[[], bool], timeout: float = 10.0) -> bool:
    """Whether a condition holds before `timeout` [s] is over; looked at every 10 ms."""
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()
