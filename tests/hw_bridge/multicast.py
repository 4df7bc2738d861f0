"""CAN over multicast between processes of one machine; tests that need it are skipped where it does not get through."""

import os
import sys
import time

import can
import pytest

# Of this test process alone: on one machine, groups of one port are not kept apart. Below the ports that the system gives out.
PORT = 20_000 + os.getpid() % 12_000

REACHED = 5.0  # [s]


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
            end = time.monotonic() + REACHED
            while (message := other.recv(max(end - time.monotonic(), 0.0))) is None or message.arbitration_id != 1:
                if time.monotonic() > end:
                    pytest.skip("multicast does not reach this machine itself")
    except (can.CanError, OSError) as error:
        pytest.skip(f"no multicast: {error}")
    return group
